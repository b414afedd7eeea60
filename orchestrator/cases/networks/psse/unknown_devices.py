"""Devices of which a file has only the solution.

These are generic network elements (GNE), whose models the user writes, and FACTS devices whose series part is a
voltage, or linked with others'."""

from dataclasses import dataclass

from orchestrator.cases.networks.psse.devices import DeviceEnd, HeldDevice, Voltages


@dataclass(frozen=True)
class UnknownDevice(HeldDevice):
    """A device that feeds what its buses lack in the file's solution."""

    place: str
    buses: tuple[int, ...]
    kind: str = "gne"  # with which the names of its loads begin

    @property
    def places(self) -> tuple[int, ...]:
        return self.buses

    def endings(self, voltages: Voltages) -> tuple[DeviceEnd, ...]:
        return tuple(
            DeviceEnd(self.ending_name(self.kind, bus), bus, is_unknown=True) for bus in self.buses
        )

"""Devices of which a file has only the solution: generic network elements (GNE), whose models the user writes."""

from dataclasses import dataclass

from orchestrator.cases.networks.psse.devices import DeviceEnd, HeldDevice, Voltages


@dataclass(frozen=True)
class UnknownDevice(HeldDevice):
    """A device that feeds what its buses lack in the file's solution."""

    place: str
    buses: tuple[int, ...]

    @property
    def places(self) -> tuple[int, ...]:
        return self.buses

    def endings(self, voltages: Voltages) -> tuple[DeviceEnd, ...]:
        return tuple(
            DeviceEnd(self.ending_name("gne", bus), bus, is_unknown=True) for bus in self.buses
        )

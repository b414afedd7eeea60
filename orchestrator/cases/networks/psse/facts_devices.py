"""FACTS devices of a PSS/E file: a shunt part that holds its bus' voltage, and a series part that sets a power."""

import math
from dataclasses import dataclass

from orchestrator.cases.networks.psse.devices import DeviceEnd, HeldDevice, Hold, Voltages

# MODE: the series part sets a power, is bypassed, or is an impedance
NORMAL = 1
BYPASSED = 2
IMPEDANCE = 3


@dataclass(frozen=True)
class FactsDevice(HeldDevice):
    """A FACTS device: its shunt part holds a voltage, its series part lets a power flow on to another bus."""

    sending: int  # the bus of the shunt part
    terminal: int  # the bus behind the series part; 0 for none
    mode: int
    power: complex  # PDES + jQDES that arrive behind the series part [MW, Mvar]
    v_pu: float  # VSET
    most_mva: float  # SHMX: of the shunt part at 1 pu
    is_remote: bool  # whether it controls the voltage of another bus

    @property
    def sets_power(self) -> bool:
        """Return whether a series part is there that sets a power."""
        return bool(self.terminal) and self.mode == NORMAL

    @property
    def places(self) -> tuple[int, ...]:
        return (self.sending, self.terminal) if self.terminal else (self.sending,)

    def endings(self, voltages: Voltages) -> tuple[DeviceEnd, ...]:
        """Return what the device gives at the sending bus, and behind its series part where that sets a power."""
        v = abs(voltages[self.sending])
        held = v if self.is_remote else self.v_pu
        fed = series = 0j  # series: power that flows into the series part
        found = []
        if self.sets_power:
            # the shunt part brings what active power the series part takes; both are at the sending bus
            current = (self.power / voltages[self.terminal]).conjugate()
            series = voltages[self.sending] * current.conjugate()
            fed = complex(-self.power.real)
            name = self.ending_name("facts", self.terminal)
            found.append(DeviceEnd(name, self.terminal, self.power))
        # SHMX is of the apparent power, as in the solutions of PSS/E's example: what the series part
        # inserts, the shunt part draws
        inserted = (series + fed).real
        most = math.sqrt(max((self.most_mva * v) ** 2 - inserted**2, 0.0))
        hold = Hold(held, -most - series.imag, most - series.imag)
        name = self.ending_name("facts", self.sending)
        return (DeviceEnd(name, self.sending, fed, hold), *found)

    def doubts(self, voltages: Voltages) -> tuple[str, ...]:
        if self.is_remote:
            return ("voltage control of another bus: its own is held at the file's voltage",)
        return ()

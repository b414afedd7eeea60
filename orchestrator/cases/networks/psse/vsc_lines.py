"""DC lines with voltage source converters of a PSS/E file."""

import math
from dataclasses import dataclass

from orchestrator.cases.form.remedies import without_kinds
from orchestrator.cases.networks.psse.devices import DeviceEnd, HeldDevice, Hold, Voltages
from orchestrator.cases.networks.source_changes import Remark
from orchestrator.core.errors import InputError

# TYPE: out of service, holds the DC voltage, or sets a power
OUT = 0
DC_VOLTAGE = 1
POWER = 2
# MODE: holds the voltage of its bus, or a power factor
HOLDS_VOLTAGE = 1
POWER_FACTOR = 2
_ROUNDS = 500
_ACCURATE = 1e-12  # change of the current in a round [kA]


@dataclass(frozen=True, slots=True)
class Converter:
    bus: int
    type: int
    mode: int
    dc_setting: float  # DCSET: DC voltage [kV], or power that it feeds into its bus [MW]
    ac_setting: float  # ACSET: voltage [pu] or power factor
    loss_mw: float  # ALOSS
    loss_kv: float  # BLOSS [MW/kA]
    least_loss_mw: float  # MINLOSS
    rating_mva: float  # SMAX; 0 for none
    rating_ka: float  # IMAX
    most_mvar: float
    least_mvar: float
    is_remote: bool  # whether it controls the voltage of another bus
    base_kv: float

    def loss(self, current: float) -> float:
        """Return the losses [MW] at a DC current [kA]."""
        return max(self.least_loss_mw, self.loss_mw + self.loss_kv * abs(current))

    def reactive(self, p_mw: float) -> float:
        """Return what it feeds by its power factor [Mvar], of P's sign, as in PSS/E's own solutions."""
        if not self.ac_setting:
            return 0.0
        factor = min(1.0, abs(self.ac_setting))
        return math.copysign(math.tan(math.acos(factor)), self.ac_setting) * p_mw

    def limits(self, p_mw: float, v_pu: float) -> tuple[float, float]:
        """Return the least and the largest reactive power [Mvar] beside an active power, at a voltage."""
        ratings = [self.rating_mva] if self.rating_mva > 0 else []
        if self.rating_ka > 0 and self.base_kv > 0:
            ratings.append(math.sqrt(3) * self.base_kv * v_pu * self.rating_ka)
        room = math.sqrt(max(0.0, min(ratings) ** 2 - p_mw**2)) if ratings else math.inf
        return max(self.least_mvar, -room), min(self.most_mvar, room)


@dataclass(frozen=True)
class VscLine(HeldDevice):
    """A line of two converters: one holds the DC voltage, the other a power, each beside its bus' voltage or a power
    factor."""

    place: str
    r_ohm: float
    converters: tuple[Converter, Converter]

    @property
    def places(self) -> tuple[int, ...]:
        return self.converters[0].bus, self.converters[1].bus

    def endings(self, voltages: Voltages) -> tuple[DeviceEnd, ...]:
        found = []
        for converter, p in zip(self.converters, self.powers(), strict=True):
            if converter.type == OUT:
                continue
            name, bus = self.ending_name("vsc", converter.bus), converter.bus
            v = abs(voltages[bus])
            if converter.mode == POWER_FACTOR:
                found.append(DeviceEnd(name, bus, complex(p, converter.reactive(p))))
                continue
            held = v if converter.is_remote else converter.ac_setting
            found.append(DeviceEnd(name, bus, complex(p), Hold(held, *converter.limits(p, v))))
        return tuple(found)

    def doubts(self, voltages: Voltages) -> tuple[str, ...]:
        found = list[str]()
        types = [converter.type for converter in self.converters]
        if types.count(DC_VOLTAGE) != 1 and OUT not in types:
            text = (
                f"no converter, or both, hold the DC voltage (TYPE is {types[0]} and {types[1]}), where PSS/E wants "
                "one with TYPE = 1: each feeds its DCSET, and nothing links the two"
            )
            found.append(Remark(text, "a DC voltage that no converter holds, or both"))
        for converter, p in zip(self.converters, self.powers(), strict=True):
            least, most = converter.limits(p, abs(voltages[converter.bus]))
            if least == most and converter.mode == HOLDS_VOLTAGE:
                text = (
                    f"the power at bus {converter.bus} takes the whole rating (SMAX, IMAX): it is not reduced, as "
                    "PSS/E does by PWF, and no reactive power is left"
                )
                found.append(Remark(text, "a converter without reactive power"))
            if converter.is_remote and converter.mode == HOLDS_VOLTAGE:
                found.append(
                    "voltage control of another bus: its own is held at the file's voltage"
                )
        return tuple(found)

    def powers(self) -> tuple[float, float]:
        """Return what both converters feed into their buses [MW]."""
        types = [converter.type for converter in self.converters]
        if OUT in types:
            return 0.0, 0.0
        if types.count(DC_VOLTAGE) != 1:
            powers = [c.dc_setting if c.type == POWER else 0.0 for c in self.converters]
            return powers[0], powers[1]
        holding = types.index(DC_VOLTAGE)
        volts, power = self.converters[holding], self.converters[1 - holding]
        current, voltage = 0.0, volts.dc_setting  # current into the converter that sets the power
        for _ in range(_ROUNDS):
            there = voltage - self.r_ohm * current
            if there <= 0:
                break
            wanted = (power.dc_setting + power.loss(current)) / there
            if abs(wanted - current) <= _ACCURATE * max(1.0, abs(current)):
                fed = -voltage * current - volts.loss(current)
                return (fed, power.dc_setting) if holding == 0 else (power.dc_setting, fed)
            current = (current + wanted) / 2
        raise InputError.at(
            f"{self.place}, line {self.line}",
            f"the DC line {self.name!r} cannot carry DCSET = {power.dc_setting:g} MW with "
            f"{voltage:g} kV and RDC = {self.r_ohm:g} ohm; mend the record, or write "
            f"{without_kinds([self.section])}",
        )

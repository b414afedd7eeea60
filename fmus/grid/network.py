"""A network as data: buses, lines, loads, shunts, and the ports where devices meet it."""

import difflib
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from fmus.grid.element_data import (
    LEAST_LOW_VOLTAGE,
    SMALLEST_REACTANCE,
    Line,
    Load,
    Port,
    Shunt,
    ThreeWinding,
    Zip,
)

__all__ = [
    "OPEN_CHARGING",
    "SMALLEST_REACTANCE",
    "Line",
    "Load",
    "Network",
    "Port",
    "Shunt",
    "ThreeWinding",
    "Zip",
]

OPEN_CHARGING = 1e-3
"""Part of an open line's charging that stays connected. A bus that only this line supports then keeps a defined
voltage."""

_ONLY_PHASORS = (
    "; the current of such an equivalent of a reduced network would grow in an EMT network, and the model phasor_grid "
    "takes it as an admittance"
)


@dataclass(frozen=True)
class Network:
    """Buses, and the elements that are connected to them.

    ``stray_B``: capacitance to earth [pu, 100 MVA] of every bus without capacitance of its own (charging, capacitor).
    If it is 0, such a bus needs a load with P > 0. A unit at a bus with a weak load needs the stray capacitance as
    well: v = Σi/G would jump with the unit's current. ``faults``: buses at which there can be a fault;
    ``transformers``: those with three windings; others are lines with a ratio; ``phasors``: whether it is for a model
    without transients, where a bus needs neither a load nor capacitance, and a line may have a negative resistance or
    reactance, as equivalents of reduced networks have them; ``injections``: buses at which the FMU has a current of its
    own besides, as tunable parameters that start at 0.

    Raises a `ValueError` that names every element that refers to an unknown bus, has no reactance or repeats a name,
    and, unless it is for phasors, every line with a negative resistance or reactance, and every bus that has neither a
    resistive load nor capacitance."""

    name: str
    buses: tuple[str, ...]
    lines: tuple[Line, ...]
    loads: tuple[Load, ...]
    ports: tuple[Port, ...]
    shunts: tuple[Shunt, ...] = ()
    stray_B: float = 0.0
    faults: tuple[str, ...] = ()
    transformers: tuple[ThreeWinding, ...] = ()
    phasors: bool = False
    injections: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        problems = [
            *self._unknown_buses(),
            *self._repeated_names(),
            *self._bad_elements(),
            *self._floating_buses(),
        ]
        problems += self._bad_loads()
        if problems:
            raise ValueError(f"network {self.name!r}: " + "; ".join(problems))

    def has_capacitance(self, bus: str) -> bool:
        """Return whether the bus voltage is a state, because of line charging, a capacitive load or shunt, or stray
        capacitance."""
        return (
            self._has_fixed_capacitance(bus)
            or bool(self._capacitive_loads(bus))
            or self.needs_stray(bus)
        )

    def floats(self, bus: str) -> bool:
        """Return whether the bus has neither capacitance nor a load or shunt that conducts."""
        return not self.has_capacitance(bus) and not self._has_conductance(bus)

    def needs_stray(self, bus: str) -> bool:
        """Return whether the bus gets `stray_B`."""
        return self.stray_B > 0 and not self._has_fixed_capacitance(bus)

    def hangs_on(self, load: Load) -> bool:
        """Return whether this load alone determines its bus's voltage, and therefore cannot be switched off."""
        if self._has_fixed_capacitance(load.bus) or self.needs_stray(load.bus):
            return False
        capacitive = self._capacitive_loads(load.bus)
        if capacitive:
            return capacitive == [load]
        return load.conductance_mw > 0 and not self._has_conductance(load.bus, without=load)

    def loads_decide(self, bus: str) -> bool:
        """Return whether only switchable loads determine the bus's voltage."""
        return not (self._has_fixed_capacitance(bus) or self.needs_stray(bus)) and (
            bool(self._capacitive_loads(bus))
            or bus not in self._conducting
            or any(load.conductance_mw < 0 for load in self._loads_at.get(bus, ()))
        )

    def _has_fixed_capacitance(self, bus: str) -> bool:
        return bus in self._charged

    def _capacitive_loads(self, bus: str) -> list[Load]:
        return [load for load in self._loads_at.get(bus, ()) if load.susceptance_mvar < 0]

    def _has_conductance(self, bus: str, without: Load | None = None) -> bool:
        return bus in self._conducting or any(
            x.conductance_mw > 0 and x is not without for x in self._loads_at.get(bus, ())
        )

    @cached_property
    def _charged(self) -> frozenset[str]:
        """Buses with a line's charging or a capacitor."""
        ends = [bus for line in self.lines if line.B > 0 for bus in (line.from_bus, line.to_bus)]
        return frozenset([*ends, *(shunt.bus for shunt in self.shunts if shunt.b_mvar > 0)])

    @cached_property
    def _conducting(self) -> frozenset[str]:
        """Buses with a shunt that is a conductance."""
        return frozenset(shunt.bus for shunt in self.shunts if shunt.g_mw > 0)

    @cached_property
    def _loads_at(self) -> dict[str, list[Load]]:
        found: dict[str, list[Load]] = {}
        for load in self.loads:
            found.setdefault(load.bus, []).append(load)
        return found

    def _unknown_buses(self) -> Iterable[str]:
        known = set(self.buses)
        for line in self.lines:
            for bus in {line.from_bus, line.to_bus} - known:
                yield f"line {line.name!r} ends at bus {bus!r}, which does not exist{self._near(bus)}"
        attached = [("load", x.name, x.bus) for x in self.loads] + [
            ("shunt", x.name, x.bus) for x in self.shunts
        ]
        attached += [("port", x.name, x.bus) for x in self.ports]
        attached += [("transformer", x.name, bus) for x in self.transformers for bus in x.buses]
        attached += [("fault", bus, bus) for bus in self.faults]
        attached += [("injection", bus, bus) for bus in self.injections]
        for kind, name, bus in attached:
            if bus not in known:
                yield f"{kind} {name!r} is at bus {bus!r}, which does not exist{self._near(bus)}"

    def _near(self, bus: str) -> str:
        """A hint at buses of nearly this name, such as another case of letters or the same number."""
        number = re.sub(r"\D", "", bus)
        alike = [
            x
            for x in self.buses
            if x.lower() == bus.lower() or (number and re.sub(r"\D", "", x) == number)
        ]
        close = alike or difflib.get_close_matches(bus, self.buses, 3)
        return f"; did you mean {' or '.join(map(repr, close[:3]))}?" if close else ""

    def _repeated_names(self) -> Iterable[str]:
        names = [*self.buses, *(x.name for x in self.lines), *(x.name for x in self.loads)]
        names += [*(x.name for x in self.shunts), *(x.name for x in self.ports)]
        names += [x.name for x in self.transformers]
        yield from (
            f"the name {name!r} is used twice"
            for name in sorted(n for n, k in Counter(names).items() if k > 1)
        )

    def _bad_lines(self) -> Iterable[str]:
        for line in self.lines:
            ends = f"between buses {line.from_bus!r} and {line.to_bus!r}"
            if line.from_bus == line.to_bus:
                yield f"line {line.name!r} begins and ends at bus {line.from_bus!r}"
            if not (abs(line.X) if self.phasors else line.X) >= SMALLEST_REACTANCE:
                yield f"line {line.name!r} has the reactance {line.X:g} pu {ends}; {self._reactance_rule(line)}"
            if not 0 <= line.X_C < max(line.X, SMALLEST_REACTANCE):
                yield (
                    f"line {line.name!r} has the series capacitor X_C = {line.X_C:g} pu and the reactance X = "
                    f"{line.X:g} pu {ends}; X_C must not be negative, and be less than X"
                )
            for quantity, value, why in (
                ("resistance", 0.0 if self.phasors and line.R < 0 else line.R, _ONLY_PHASORS),
                ("charging", line.B, ""),
            ):
                if not value >= 0:
                    yield f"line {line.name!r} has the {quantity} {value:g} pu {ends}; it must not be negative{why}"
            if not line.tap > 0:
                yield f"line {line.name!r} has the ratio {line.tap:g} {ends}; it must exceed 0, and is 1 without one"

    def _reactance_rule(self, line: Line) -> str:
        if self.phasors:
            return f"its size must be at least {SMALLEST_REACTANCE:g}: merge buses that nothing separates"
        return (
            f"it must be at least {SMALLEST_REACTANCE:g}: give a series capacitor as X_C of the line in series with "
            "it, merge the star point of a transformer equivalent, and merge buses that nothing separates"
            f"{_ONLY_PHASORS if line.X < 0 else ''}"
        )

    def _bad_elements(self) -> Iterable[str]:
        yield from self._bad_lines()
        for x in self.transformers:
            values = ", ".join(f"{value:g}" for value in x.X)
            if not x.is_passive or not min(abs(value) for value in x.X) >= SMALLEST_REACTANCE:
                yield (
                    f"transformer {x.name!r} has the reactances {values} pu of windings 1, 2, 3 in its star; any two "
                    f"together and all three must be inductive, and none within {SMALLEST_REACTANCE:g} of 0"
                )
            if len(set(x.buses)) < 3:
                yield f"transformer {x.name!r} has two windings at one bus: {', '.join(x.buses)}"
            if not min(x.tap) > 0:
                yield f"transformer {x.name!r} has the ratio {min(x.tap):g}; it must exceed 0, and is 1 without one"
        if not self.phasors:
            yield from (
                f"line {x.name!r}: ends that switch one by one, and faults along it, are for networks of phasors"
                for x in self.lines
                if not x.is_plain
            )
            yield from (
                f"shunt {x.name!r} has the negative conductance {x.g_mw:g} MW{_ONLY_PHASORS}"
                for x in self.shunts
                if x.g_mw < 0
            )
        if not self.stray_B >= 0:
            yield f"stray_B = {self.stray_B:g} pu; it must not be negative"

    def _bad_loads(self) -> Iterable[str]:
        for load in self.loads:
            for which, law in (("active", load.active), ("reactive", load.reactive)):
                total = law.z + law.i + law.p
                if not abs(total - 1) <= 1e-6:
                    yield (
                        f"load {load.name!r}: the shares of its {which} power are z = {law.z:g}, i = {law.i:g}, "
                        f"p = {law.p:g}, {total:g} together; they must sum to 1"
                    )
            if (load.active.p or load.reactive.p) and not load.low_voltage >= LEAST_LOW_VOLTAGE:
                yield (
                    f"load {load.name!r} has a share of constant power down to v_min = {load.low_voltage:g} pu; its "
                    f"current would grow without bound, so v_min must be at least {LEAST_LOW_VOLTAGE:g} pu"
                )
            elif not 0 <= load.low_voltage < 1:
                yield f"load {load.name!r} has v_min = {load.low_voltage:g} pu; it must be from 0 to below 1"

    def _floating_buses(self) -> Iterable[str]:
        floating = [b for b in self.buses if self.floats(b)]
        if floating and not self.phasors:
            named = ", ".join(map(repr, floating[:10])) + (", …" if len(floating) > 10 else "")
            begin = f"bus {named} has" if len(floating) == 1 else f"buses {named} have"
            yield (
                f"{begin} neither a load with P > 0 nor line charging, so no voltage is determined there; "
                "add a load, or B to a line "
                "there, or give the network a small capacitance for such buses: stray_B = 0.05"
            )

"""A network as data: buses, lines, loads, and the ports where devices meet it."""

from collections.abc import Iterable
from dataclasses import dataclass

SYSTEM_BASE_MVA = 100.0


@dataclass(frozen=True, slots=True)
class Line:
    """A π section; R, X, B [pu, 100 MVA], B the charging of the whole line."""

    name: str
    from_bus: str
    to_bus: str
    X: float
    R: float = 0.0
    B: float = 0.0


@dataclass(frozen=True, slots=True)
class Load:
    """A constant-impedance load that draws P + jQ [MW, Mvar] at the power flow's voltage."""

    name: str
    bus: str
    p_mw: float
    q_mvar: float = 0.0


@dataclass(frozen=True, slots=True)
class Port:
    """Where one device injects its current."""

    name: str
    bus: str


@dataclass(frozen=True)
class Network:
    """Buses with what is connected to them.

    Raises
    ------
    ValueError
        Naming every element that refers to an unknown bus, has no reactance or repeats a name,
        and every bus that has neither a resistive load nor charging.
    """

    name: str
    buses: tuple[str, ...]
    lines: tuple[Line, ...]
    loads: tuple[Load, ...]
    ports: tuple[Port, ...]

    def __post_init__(self) -> None:
        problems = [*self._unknown_buses(), *self._bad_elements(), *self._floating_buses()]
        if problems:
            raise ValueError(f"network {self.name!r}: " + "; ".join(problems))

    def has_capacitance(self, bus: str) -> bool:
        """Whether the bus voltage is a state: some line charging or a capacitive load is there."""
        return any(line.B > 0 and bus in (line.from_bus, line.to_bus) for line in self.lines) or any(
            load.bus == bus and load.q_mvar < 0 for load in self.loads
        )

    def _unknown_buses(self) -> Iterable[str]:
        known = set(self.buses)
        for line in self.lines:
            for bus in {line.from_bus, line.to_bus} - known:
                yield f"line {line.name!r} ends at bus {bus!r}, which does not exist"
        attached = [("load", x.name, x.bus) for x in self.loads] + [("port", x.name, x.bus) for x in self.ports]
        for kind, name, bus in attached:
            if bus not in known:
                yield f"{kind} {name!r} is at bus {bus!r}, which does not exist"

    def _bad_elements(self) -> Iterable[str]:
        names = [
            *self.buses,
            *(x.name for x in self.lines),
            *(x.name for x in self.loads),
            *(x.name for x in self.ports),
        ]
        yield from (f"the name {name!r} is used twice" for name in sorted({n for n in names if names.count(n) > 1}))
        for line in self.lines:
            if line.X <= 0:
                yield f"line {line.name!r} has the reactance {line.X:g} pu; it must exceed 0"
            if line.from_bus == line.to_bus:
                yield f"line {line.name!r} begins and ends at bus {line.from_bus!r}"

    def _floating_buses(self) -> Iterable[str]:
        for bus in self.buses:
            resistive = any(load.bus == bus and load.p_mw > 0 for load in self.loads)
            if not resistive and not self.has_capacitance(bus):
                yield (
                    f"bus {bus!r} has neither a load with P > 0 nor line charging, so its voltage is not "
                    "determined; add a load, or B to one of its lines"
                )

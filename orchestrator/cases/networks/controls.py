"""Taps and switched shunts that move in the power flow after an outage until voltages are in their bands."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from fmus.grid.names import line_variable
from fmus.grid.network import Shunt
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.networks.conversion import ImportedNetwork, branch_names, bus_of
from orchestrator.cases.networks.psse.raw_network import RawNetwork
from orchestrator.core.errors import number_of
from orchestrator.systems.coupling.system import ComponentPlan

TAP = "tap"  # parameter that a transformer's control moves
SUSCEPTANCE = "B"  # parameter that a shunt's control moves
_OFF_MVAR = 1e-6  # of a shunt without a step that is on: without any it would be no element
_SHOWN = 5  # decimals of a position
_SAME = 1e-9  # part of a position by which two are one
_INSIDE = 1e-9  # voltage by which a band may be left [pu], below what a power flow resolves


@dataclass(frozen=True)
class Control:
    """A variable of the grid that moves over ``positions``, rising, to keep a bus between ``least`` and ``most`` [pu].

    ``raises``: whether a higher value raises the voltage."""

    element: str
    quantity: str  # `TAP` of a line, or `SUSCEPTANCE` of a shunt [Mvar]
    bus: str
    least: float
    most: float
    positions: tuple[float, ...]
    raises: bool

    @property
    def variable(self) -> str:
        """Name in the grid's FMU."""
        if self.quantity == TAP:
            return line_variable(self.element, TAP)
        return f"{self.element}.{self.quantity}"

    def direction(self, magnitude: float) -> int:
        """Return 1 or -1 where a higher or a lower value is wanted at a voltage [pu], and 0 within the band."""
        low, high = magnitude < self.least - _INSIDE, magnitude > self.most + _INSIDE
        wanted = int(low) - int(high)
        return wanted if self.raises else -wanted

    def beside(self, value: float, direction: int) -> float | None:
        """Return the next position from a value in a direction; None at the end."""
        near = _SAME * max(abs(x) for x in self.positions)
        if direction > 0:
            return next((x for x in self.positions if x > value + near), None)
        return next((x for x in reversed(self.positions) if x < value - near), None)


@dataclass(frozen=True)
class MovingNetwork:
    """A network with the elements that controls need, the controls, and how many of the file's cannot move."""

    network: ImportedNetwork
    controls: tuple[Control, ...]
    taps: int
    shunts: int

    @property
    def in_words(self) -> str:
        """Tell what moves."""
        return (
            f"{self.counts_in_words} can move step by step to hold a voltage (COD1 = 1 of two windings, MODSW = 1): "
            "they do in the power flow after an outage; all others are held"
        )

    @property
    def counts_in_words(self) -> str:
        """Count the taps and shunts that can move; "" where none can."""
        kinds = {"tap": self.taps, "switched shunt": self.shunts}
        return " and ".join(number_of(number, what) for what, number in kinds.items() if number)


def with_controls(raw: RawNetwork, network: ImportedNetwork) -> MovingNetwork:
    """Find the controls of a RAW file, and make the network's ratios and shunts such that they can move."""
    names = branch_names(raw.tables)
    lines = {line.name: line for line in network.lines}
    buses = set(network.buses)
    controls = []
    for row, tap in raw.taps.items():
        line, (start, end, ratio) = lines.get(names[row] or ""), raw.tables.branch[row][[0, 1, 8]]
        ends = tuple(bus_of(raw.tables.labels[int(bus)]) for bus in (start, end))
        seen = bus_of(raw.tables.labels[tap.bus])
        if line and (line.from_bus, line.to_bus, line.tap) == (*ends, ratio) and seen in buses:
            lines[line.name] = replace(line, adjustable=True)
            control = Control(
                line.name,
                TAP,
                bus=seen,
                least=tap.least,
                most=tap.most,
                positions=tap.positions,
                raises=tap.raises,
            )
            controls.append(control)
    taps, shunts = len(controls), {shunt.bus: shunt for shunt in network.shunts}
    at = Counter(record.place for record in raw.shunts)
    for record in (record for record in raw.shunts if at[record.place] == 1):
        bus, seen = (bus_of(raw.tables.labels[x]) for x in (record.place, record.bus))
        if not {bus, seen} <= buses:
            continue
        shunt = shunts.get(bus) or _empty(bus)
        total = [shunt.b_mvar - record.initial + x for x in record.positions]
        reach = max(total, key=abs)
        is_negative = (shunt.b_mvar or reach) < 0
        shunt = replace(shunt, b_mvar=shunt.b_mvar or (-_OFF_MVAR if is_negative else _OFF_MVAR))
        positions = _of_one_sign(total, is_negative=is_negative)
        if len(positions) > 1:
            shunts[bus] = shunt
            controls.append(
                Control(
                    shunt.name, SUSCEPTANCE, seen, record.least, record.most, positions, raises=True
                )
            )
    moving = replace(network, lines=(*lines.values(),), shunts=(*shunts.values(),))
    return MovingNetwork(moving, tuple(controls), taps, len(controls) - taps)


def _empty(bus: str) -> Shunt:
    return Shunt(f"shunt_{bus.removeprefix('bus_')}", bus)


def _of_one_sign(values: Sequence[float], *, is_negative: bool) -> tuple[float, ...]:
    """Return the values of a sign, rising; a capacitor of the grid's FMU does not become an inductor."""
    sign = -1.0 if is_negative else 1.0
    sizes = {max(_OFF_MVAR, sign * x) for x in values if sign * x > -_OFF_MVAR}
    return tuple(sorted(sign * size for size in sizes))


def solve_with_controls(
    find: Callable[[], PowerFlow], grid: ComponentPlan, controls: Sequence[Control]
) -> PowerFlow:
    """Solve, and move what is out of its band by one position, until nothing is left to move.

    All controls move at once, and none turns back: one whose voltage passes its band in one step stays behind it.

    ``find``: solves the power flow with the values that the grid has; ``grid``: gets the positions as parameters."""
    flow, went = find(), dict[str, int]()
    while True:
        steps = {}
        for control in controls:
            wanted = control.direction(abs(flow.voltages[control.bus]))
            if not wanted or went.setdefault(control.variable, wanted) != wanted:
                continue
            position = control.beside(grid.number(control.variable), wanted)
            if position is not None:
                steps[control.variable] = position
        if not steps:
            return flow
        grid.parameters.update(steps)
        flow = find()


def moves_in_words(
    controls: Sequence[str], before: ComponentPlan, now: ComponentPlan
) -> Mapping[str, str]:
    """Return the moves of variables of the grid, such as ``1 to 0.975``, by name."""
    found = {name: [round(x.number(name), _SHOWN) for x in (before, now)] for name in controls}
    return {name: f"{a:.4g} to {b:.4g}" for name, (a, b) in found.items() if a != b}

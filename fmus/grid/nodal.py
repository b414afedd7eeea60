"""Solution of complex nodal equations Y·v = i with symbols, by elimination in an order that keeps them sparse; or as
data, by the kernel of the model."""

from collections.abc import Callable
from heapq import heapify, heappop, heappush

from fmus.toolchain.frames import ZERO, Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.nodes import LARGEST_REST
from fmus.toolchain.symbols import Expr, fabs, fmax

Admittances = dict[str, dict[str, Phasor]]  # rows and columns by bus; the pattern is symmetric


def add_admittance(Y: Admittances, row: str, column: str, value: Phasor) -> None:
    """Add a value to one element of the matrix."""
    Y[row][column] = Y[row].get(column, ZERO) + value


def solve(Y: Admittances, currents: dict[str, Phasor], *, checked: bool = False) -> dict[str, Phasor]:
    """Voltages of all buses.

    The bus with the fewest neighbours is eliminated first. There is no pivoting: a passive network needs none, unless
    a bus has no admittance at all, and then its voltage is not finite.

    ``Y``, ``currents``: the equations; ``checked``: whether no voltage is finite where the solution leaves more than
    `LARGEST_REST` over: for networks that are not passive, in which an element that is divided by may vanish."""
    voltages = _solve(Y, currents)
    if not checked:
        return voltages
    worst = Expr(0)
    for bus, row in Y.items():
        rest, size = -currents[bus], _size(currents[bus])
        for other, y in row.items():
            term = y * voltages[other]
            rest, size = rest + term, size + _size(term)
        worst = fmax(worst, _size(rest) - LARGEST_REST * size)
    holds = worst <= 0
    return {bus: Phasor(v.re / holds, v.im / holds) for bus, v in voltages.items()}


def _size(value: Phasor) -> Expr:
    return fabs(value.re) + fabs(value.im)


def _solve(Y: Admittances, currents: dict[str, Phasor]) -> dict[str, Phasor]:
    rows = {bus: dict(entries) for bus, entries in Y.items()}
    right, place, order = dict(currents), {bus: k for k, bus in enumerate(Y)}, list[str]()
    queue = [(len(row), place[bus], bus) for bus, row in rows.items()]
    heapify(queue)
    waiting = set(Y)
    while waiting:
        entries, _, bus = heappop(queue)
        if bus not in waiting or entries != len(rows[bus]):
            continue  # it has gone, or has another number of neighbours by now and stands elsewhere in the queue too
        waiting.remove(bus)
        order.append(bus)
        for other in sorted((column for column in rows[bus] if column in waiting), key=place.__getitem__):
            factor = rows[other].pop(bus) / rows[bus][bus]
            for column, value in rows[bus].items():
                if column != bus:
                    rows[other][column] = rows[other].get(column, ZERO) - factor * value
            right[other] -= factor * right[bus]
            heappush(queue, (len(rows[other]), place[other], other))
    voltages: dict[str, Phasor] = {}
    for bus in reversed(order):
        known = right[bus]
        for column, value in rows[bus].items():
            if column != bus:
                known -= value * voltages[column]
        voltages[bus] = known / rows[bus][bus]
    return voltages


def solved_as_data(
    m: ModelBuilder, Y: Admittances, currents: dict[str, Phasor], written_out: Callable[[], Model]
) -> dict[str, Phasor]:
    """Voltages of all buses, which the model's kernel solves for.

    ``written_out``: makes the same model by `solve`."""
    place = {bus: k for k, bus in enumerate(Y)}
    elements = {
        (place[bus], place[other]): (y.re, y.im) for bus, row in Y.items() for other, y in row.items()
    }  # fmt: skip
    found = m.nodes(elements, [(currents[bus].re, currents[bus].im) for bus in Y], written_out)
    return {bus: Phasor(re, im) for bus, (re, im) in zip(Y, found, strict=True)}

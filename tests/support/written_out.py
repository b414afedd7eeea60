"""A network that a kernel solves as data, written out: Y·v = i solved with symbols, by elimination."""

from dataclasses import replace
from heapq import heapify, heappop, heappush

from fmus.toolchain.frames import ZERO, Phasor
from fmus.toolchain.nodal_equations import LARGEST_REST
from fmus.toolchain.symbols import Expr, Function, fabs, fmax


def written_out(model, *, checked=False):
    """The same model as functions of (x, u, p, c) alone; with ``checked`` no voltage is finite where the solution
    leaves too much over, as kernels have it."""
    if model.nodal is None:
        return model
    x, u, p, c, _ = model.derivatives.inputs
    (elements,), (currents,) = model.nodal.values.of(u, p, c), model.nodal.currents.of(x, u, p, c)
    places, n = model.nodal.plan.entries, len(model.nodal.plan.order)
    Y = {bus: {} for bus in range(n)}
    for (row, column), re, im in zip(places, elements, elements[len(places) :], strict=False):
        Y[row][column] = Phasor(re, im)
    right = {bus: Phasor(currents[bus], currents[n + bus]) for bus in range(n)}
    found = _solve(Y, right)
    voltages = _checked(Y, right, found) if checked else found
    v = [voltages[bus].re for bus in range(n)] + [voltages[bus].im for bus in range(n)]

    def alone(function):
        return function and Function(function.name, [x, u, p, c], function.of(x, u, p, c, v))

    functions = {
        name: alone(getattr(model, name))
        for name in ("derivatives", "outputs_function", "implicit")
    }
    return replace(model, nodal=None, **functions)


def _checked(Y, currents, voltages):
    worst = Expr(0)
    for bus, row in Y.items():
        rest, size = -currents[bus], _size(currents[bus])
        for other, y in row.items():
            term = y * voltages[other]
            rest, size = rest + term, size + _size(term)
        worst = fmax(worst, _size(rest) - LARGEST_REST * size)
    holds = worst <= 0
    return {bus: Phasor(v.re / holds, v.im / holds) for bus, v in voltages.items()}


def _size(value):
    return fabs(value.re) + fabs(value.im)


def _solve(Y, currents):
    """The bus with the fewest neighbours is eliminated first. There is no pivoting: a passive network needs none."""
    rows = {bus: dict(entries) for bus, entries in Y.items()}
    right, place, order = dict(currents), {bus: k for k, bus in enumerate(Y)}, []
    queue = [(len(row), place[bus], bus) for bus, row in rows.items()]
    heapify(queue)
    waiting = set(Y)
    while waiting:
        entries, _, bus = heappop(queue)
        if bus not in waiting or entries != len(rows[bus]):
            # it has gone, or has another number of neighbours by now and stands elsewhere in the
            # queue too
            continue
        waiting.remove(bus)
        order.append(bus)
        for other in sorted(
            (column for column in rows[bus] if column in waiting), key=place.__getitem__
        ):
            factor = rows[other].pop(bus) / rows[bus][bus]
            for column, value in rows[bus].items():
                if column != bus:
                    rows[other][column] = rows[other].get(column, ZERO) - factor * value
            right[other] -= factor * right[bus]
            heappush(queue, (len(rows[other]), place[other], other))
    voltages = {}
    for bus in reversed(order):
        known = right[bus]
        for column, value in rows[bus].items():
            if column != bus:
                known -= value * voltages[column]
        voltages[bus] = known / rows[bus][bus]
    return voltages

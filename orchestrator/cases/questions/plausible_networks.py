"""Most unusual data of a network's lines, series capacitors, three-winding transformers and stray capacitance."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from statistics import median

from fmus.grid.network import Line, Network, ThreeWinding
from orchestrator.cases.draft import Draft
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.cases.questions.plausible_ranges import (
    COMPENSATION,
    LINE_B,
    LINE_RATIO,
    LINE_X,
    MOST_R_OVER_X,
    STRAY_B,
)
from orchestrator.cases.questions.plausible_values import outside, place_of_source, value_of
from orchestrator.core.errors import few
from orchestrator.systems.coupling.system import ComponentPlan

_SHOWN = 3  # equivalents that are named; lines beyond which one is compared with the others
_UNLIKE = 8.0  # times from which on a line is unlike the others
_TWINS = 4.0  # and from which on one of two parallel circuits is unlike the other


def network_doubts(draft: Draft) -> Iterator[UnusualValue]:
    grid = draft.system.components.get(draft.grid or "")
    if grid is None or draft.network is None or draft.grid is None:
        return
    yield from _equivalents(draft, draft.grid, draft.network)
    yield from _unlike_others(draft, draft.grid, grid, draft.network)
    yield from _unlike_twins(draft, draft.grid, grid, draft.network)
    for line in draft.network.lines:
        yield from _line(draft, draft.grid, grid, line)
    for transformer in draft.network.transformers:
        yield from _transformer(draft, draft.grid, grid, transformer)
    stray = value_of(grid, "stray_B")
    if stray is not None:
        yield from outside(
            draft, draft.grid, "stray_B", stray, STRAY_B, draft.given.place("network", "stray_B")
        )


def _equivalents(draft: Draft, name: str, network: Network) -> Iterator[UnusualValue]:
    """Name the branches of a network of phasors that only a reduction can have made."""
    for quantity, what in (("R", "resistance"), ("X", "reactance")):
        found = [line for line in network.lines if getattr(line, quantity) < 0]
        if found:
            shown = few(
                (f"{line.name!r} ({getattr(line, quantity):g} pu)" for line in found), _SHOWN
            )
            text = (
                f"{len(found)} of {len(network.lines)} branches have a negative {what}: {shown}; as equivalents "
                "of a reduced network they are taken as admittances, which hold at rated frequency alone"
            )
            variable, place = found[0].variable(quantity), draft.given.place("network")
            yield UnusualValue(f"{name}.{variable}", place, text, f"a negative {what}")


def _unlike_others(
    draft: Draft, name: str, grid: ComponentPlan, network: Network
) -> Iterator[UnusualValue]:
    """Lines whose X/R and X/B both are far from those of the middle line, by about the same: of a higher voltage the
    first is larger and the second smaller, of a cable the second is smaller by far."""
    found = {}
    for line in network.lines:
        R, X, B = (value_of(grid, line.variable(q)) for q in "RXB")
        if R and X and B and min(R, X, B) > 0:
            found[line] = X, X / R, X / B
    middle = [median(x) for x in zip(*found.values(), strict=True)]
    for line, (X, *ratios) in found.items() if len(found) > _SHOWN else ():
        times = [ratio / usual for ratio, usual in zip(ratios, middle[1:], strict=True)]
        if max(times) < 2 * min(times) and (min(times) > _UNLIKE or max(times) < 1 / _UNLIKE):
            variable = line.variable("X")
            text = (
                f"{variable} = {X:g} pu: its X/R is {times[0]:.3g} times and its X/B {times[1]:.3g} times that of the "
                f"middle line; has X a digit too {'many' if times[0] > 1 else 'few'}?"
            )
            place = _place(draft, "lines", line.name, "X", variable)
            kind = "a reactance unlike those of other lines"
            yield UnusualValue(f"{name}.{variable}", place, text, kind)


def _unlike_twins(
    draft: Draft, name: str, grid: ComponentPlan, network: Network
) -> Iterator[UnusualValue]:
    """Parallel circuits of which one of R, X and B is far from the other's, and the two others are alike."""
    circuits: dict[frozenset[str], list[tuple[Line, dict[str, float]]]] = {}
    for line in network.lines:
        found = {q: value_of(grid, line.variable(q)) or 0.0 for q in "RXB"}
        circuits.setdefault(frozenset((line.from_bus, line.to_bus)), []).append((line, found))
    for parallel in circuits.values():
        for (one, own), (other, its) in combinations(parallel, 2):
            odd = [q for q in "RXB" if abs(own[q] - its[q]) > 0.25 * max(abs(own[q]), abs(its[q]))]
            if len(odd) != 1:
                continue
            sizes = [abs(own[odd[0]]), abs(its[odd[0]])]
            if max(sizes) > _TWINS * min(sizes):
                variable = other.variable(odd[0])
                its_twins = f"the parallel {one.name} has {own[odd[0]]:g} pu"
                text = f"{variable} = {its[odd[0]]:g} pu, and {its_twins}, with like other data"
                place = _place(draft, "lines", other.name, odd[0], variable)
                kind = f"{odd[0]} unlike the parallel circuit's"
                yield UnusualValue(f"{name}.{variable}", place, text, kind)


def _line(draft: Draft, name: str, grid: ComponentPlan, line: Line) -> Iterator[UnusualValue]:
    """Reactance, charging, ratio, shift, R/X and X_C/X."""
    variables = {q: line.variable(q) for q in ("X", "R", "B", "tap", "shift", "X_C")}
    found = {q: value_of(grid, variable) for q, variable in variables.items()}

    def place(quantity: str) -> str:  # few lines have a doubt that needs one
        return _place(draft, "lines", line.name, quantity, variables[quantity])

    for quantity, usual in {"X": LINE_X, "B": LINE_B, "tap": LINE_RATIO}.items():
        value = found[quantity]
        if value is None or usual.fits(value) or (quantity == "X" and line.X < 0):
            continue
        yield from outside(draft, name, variables[quantity], value, usual, place(quantity))
    for doubt in _shift(name, variables["shift"], found["shift"], ""):
        yield replace(doubt, place=place("shift"))
    R, X, X_C = found["R"], found["X"], found["X_C"]
    if R is not None and X is not None:
        for doubt in _swapped(name, variables["R"], variables["X"], R, X, ""):
            yield replace(doubt, place=place("R"))
    if X is not None and X_C is not None and not COMPENSATION.fits(X_C / X):
        text = (
            f"{variables['X_C']} = {X_C:g} pu is {X_C / X:.3g} of {variables['X']} = {X:g} pu, outside of "
            f"{COMPENSATION.low:g} to {COMPENSATION.high:g} ({COMPENSATION.why})"
        )
        name_of_capacitor = f"{name}.{variables['X_C']}"
        kind = "series compensation"
        compared = (variables["X"],)
        yield UnusualValue(name_of_capacitor, place("X_C"), text, kind, compared)


def _transformer(
    draft: Draft, name: str, grid: ComponentPlan, transformer: ThreeWinding
) -> Iterator[UnusualValue]:
    """Impedances between any two windings, ratios and shifts; one winding alone may have a negative reactance."""

    def value(quantity: str, winding: int) -> float:
        return grid.number(f"{transformer.name}.{quantity}_{winding}")

    def place(quantity: str, *windings: int) -> str:
        key = f"{quantity}_{windings[0]}{windings[1]}" if len(windings) == 2 else quantity
        changed = [f"{transformer.name}.{quantity}_{k}" for k in windings]
        return _place(draft, "three_winding_transformers", transformer.name, key, *changed)

    for a, b in combinations((1, 2, 3), 2):
        X, R = value("X", a) + value("X", b), value("R", a) + value("R", b)
        names = [f"{transformer.name}.{q}_{a} + {q}_{b}" for q in "XR"]
        windings = tuple(f"{transformer.name}.{q}_{k}" for q in "XR" for k in (a, b))
        for doubt in outside(draft, name, names[0], X, LINE_X, place("X", a, b)):
            yield replace(doubt, name=f"{name}.{windings[0]}", compared=windings[1:2])
        for doubt in _swapped(name, names[1], names[0], R, X, place("R", a, b)):
            yield replace(doubt, name=f"{name}.{windings[2]}", compared=windings)
    for k in (1, 2, 3):
        if transformer.has_ratio(k - 1):
            tap, shift = f"{transformer.name}.tap_{k}", f"{transformer.name}.shift_{k}"
            yield from outside(draft, name, tap, value("tap", k), LINE_RATIO, place("tap", k))
            yield from _shift(name, shift, value("shift", k), place("shift", k))


def _shift(
    component: str, variable: str, shift: float | None, place: str
) -> Iterator[UnusualValue]:
    if shift is not None and abs(shift) > math.pi:
        text = f"{variable} = {shift:g} rad is more than half a turn; if it is in degrees, write '{shift:g} deg'"
        yield UnusualValue(f"{component}.{variable}", place, text, "a shift in degrees")


def _swapped(
    component: str, resistance: str, reactance: str, R: float, X: float, place: str
) -> Iterator[UnusualValue]:
    if R > MOST_R_OVER_X * X > 0:
        text = f"{resistance} = {R:g} pu is {R / X:.3g} times {reactance} = {X:g} pu; are the two swapped?"
        kind = "a resistance above the reactance"
        yield UnusualValue(f"{component}.{resistance}", place, text, kind, (reactance,))


def _place(draft: Draft, kind: str, element: str, key: str, *variables: str) -> str:
    table = draft.given.case.network
    for variable in variables:
        set_at = draft.places.get(f"{draft.grid}.{variable}")
        if set_at:
            return set_at
    if table is not None and element in getattr(table, kind):
        return draft.given.place("network", kind, element, key)
    in_file = draft.data.places.get(element) if draft.data else None
    return (
        in_file
        or f"{place_of_source(draft)}, {'line' if kind == 'lines' else 'transformer'} {element!r}"
    )

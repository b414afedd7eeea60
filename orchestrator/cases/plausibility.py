"""Impossible data are refused, and most unusual data are questioned; both with their place in the file.

A question is a warning: the case runs. It is answered by the key ``meant`` of the case, a list of names
``component.variable`` (patterns such as ``sg*.machine.H`` fit several).
"""

import fnmatch
import math
from collections.abc import Iterator
from dataclasses import dataclass

from fmus.grid.names import line_variable
from orchestrator.cases.data_rules import RESISTANCES, RULES, Rule
from orchestrator.cases.draft import Draft
from orchestrator.cases.names import close_names
from orchestrator.cases.plausible_ranges import (
    LINE_B,
    LINE_RATIO,
    LINE_X,
    MOST_R_OVER_X,
    RANGES,
    SMALLEST_SHARE,
    STRAY_B,
    Plausible,
)
from orchestrator.coupling.system import ComponentPlan
from orchestrator.errors import Problem
from orchestrator.fmi.port import BoundDescription

_FAR = 3
"""A value that is outside of its range by less than this factor may be a mistake, but not one of a factor of 1000."""

_FULL = 1.05
"""Apparent power [pu of the rating] above which a converter's operating point is questioned."""

_SHOWN = 3
"""Largest number of components that a question names; the others are counted."""


def check_plausibility(draft: Draft) -> None:
    """Note impossible data, and collect the draft's questions."""
    for name, plan in draft.system.components.items():
        for rule in RULES:
            _check_rule(draft, name, plan, rule)
    _check_frequencies(draft)
    _check_meant(draft)
    draft.questions += _merged([d for d in _doubts(draft) if not _is_meant(draft, d.name)])


def _check_meant(draft: Draft) -> None:
    """Check the entries of ``meant``. A component may exist in another scenario, where its variable is checked."""
    for pattern in draft.case.meant:
        component, _, variable = pattern.partition(".")
        if draft.whole and not fnmatch.filter(draft.known, component):
            hint = close_names(component, sorted(draft.known), "name it as [components] does")
            draft.note(draft.place("meant"), f"{pattern!r}: there is no component {component!r}; {hint}")
        plans = [p for name, p in draft.system.components.items() if fnmatch.fnmatchcase(name, component)]
        if plans and not any(fnmatch.fnmatchcase(v, variable) for p in plans for v in p.description.variables):
            draft.note(
                draft.place("meant"), f"{pattern!r}: {component} has no variable {variable!r}; `gfor info` lists them"
            )


@dataclass(frozen=True, slots=True)
class _Doubt:
    """A most unusual value: its ``component.variable``, its place, and the question's text."""

    name: str
    place: str
    text: str


def _doubts(draft: Draft) -> Iterator[_Doubt]:
    for name, plan in draft.system.components.items():
        for variable in plan.description.parameters:
            wanted, value = RANGES.get(variable), _value(plan, variable)
            if wanted is not None and value is not None and _unit(plan, variable) == wanted.unit:
                yield from _outside(draft, name, variable, value, wanted, scale=_to_rating(plan, variable))
        for resistance, reactance in RESISTANCES:
            R, X = _value(plan, resistance), _value(plan, reactance)
            if R is not None and X is not None and R > X > 0:
                text = f"{resistance} = {R:g} pu exceeds {reactance} = {X:g} pu; are the two swapped?"
                yield _Doubt(f"{name}.{resistance}", _place(draft, name, resistance, reactance), text)
    yield from _small_units(draft)
    yield from _lines(draft)


def question_loading(draft: Draft) -> None:
    """Ask about converters whose operating point exceeds their rating. The operating point is the power flow's if there
    is one.
    """
    asked = {question.place for question in draft.questions}  # one question about a rating is enough
    draft.questions += _merged([d for d in _overloaded(draft) if not _is_meant(draft, d.name) and d.place not in asked])


def _overloaded(draft: Draft) -> Iterator[_Doubt]:
    for name, plan in draft.system.components.items():
        P, Q, S_n = (_value(plan, v) for v in ("P_0", "Q_0", "S_n"))
        machine = any(variable.startswith("machine.") for variable in plan.description.variables)
        if machine or P is None or Q is None or S_n is None or any(_unit(plan, v) != "pu" for v in ("P_0", "Q_0")):
            continue
        apparent = math.hypot(P, Q)
        if apparent > _FULL:
            text = (
                f"the operating point, P_0 = {P:.4g} pu and Q_0 = {Q:.4g} pu, asks for {apparent:.3g} pu of "
                f"S_n = {S_n:g} MVA, more than the rating of the converter"
            )
            yield _Doubt(f"{name}.S_n", _place(draft, name, "S_n"), text)


# -- one value ---------------------------------------------------------------------------------------


def _to_rating(plan: ComponentPlan, variable: str) -> float:
    """What carries a machine's value from the base of its data, ``machine.S_data``, to the rating; otherwise 1."""
    S_data, S_n = _value(plan, "machine.S_data"), _value(plan, "S_n")
    if not S_data or not S_n:
        return 1.0
    if variable == "machine.H":
        return S_data / S_n
    return S_n / S_data if variable == "machine.R_s" or variable.startswith("machine.X_") else 1.0


def _outside(
    draft: Draft,
    component: str,
    variable: str,
    value: float,
    wanted: Plausible,
    where: str | None = None,
    scale: float = 1.0,
) -> Iterator[_Doubt]:
    given, value = value, value * scale
    if wanted.fits(value):
        return
    unit = f" {wanted.unit}" if wanted.unit != "1" else ""
    slip = ""
    for factor, text, far in (
        (1e-3, f"{value / wanted.high:.3g} times too large", value > _FAR * wanted.high),
        (1e3, f"{wanted.low / value if value else 0:.3g} times too small", value < wanted.low / _FAR),
    ):
        if far and wanted.low <= value * factor <= wanted.high:
            slip = f"; it is {text}, and usual by a factor of 1000: check its unit and base"
    shown = f"{given:g}{unit}" if scale == 1 else f"{given:g}{unit} on machine.S_data, {value:.4g}{unit} on S_n,"
    text = f"{variable} = {shown} is outside of {wanted.low:g} to {wanted.high:g}{unit} ({wanted.why}){slip}"
    yield _Doubt(f"{component}.{variable}", where or _place(draft, component, variable), text)


def _check_rule(draft: Draft, name: str, plan: ComponentPlan, rule: Rule) -> None:
    larger, smaller = _value(plan, rule.larger), _value(plan, rule.smaller)
    if larger is None or smaller is None or rule.holds(larger, smaller):
        return
    texts = [
        f"{v} = {x:g} {_unit(plan, v)}{'' if v in plan.parameters else ' (the default)'}"
        for v, x in ((rule.larger, larger), (rule.smaller, smaller))
    ]
    draft.note(_place(draft, name, rule.smaller, rule.larger), rule.text(*texts))


# -- several components ------------------------------------------------------------------------------


def _check_frequencies(draft: Draft) -> None:
    """Check that coupled components have one rated frequency: frames of two frequencies turn against each other."""
    rated = {name: f for name, plan in draft.system.components.items() if (f := _frequency(plan)) is not None}
    for group in _coupled(draft):
        known = {name: f for name, f in rated.items() if name in group}
        if len(set(known.values())) < 2:
            continue
        grid = draft.grid if draft.grid in known else None
        common = known[grid] if grid else max(set(known.values()), key=list(known.values()).count)
        reference = grid or next(name for name, f in known.items() if f == common)
        for name, f in known.items():
            if f != common and not any(p.place == _frequency_place(draft, name) for p in draft.problems):
                draft.note(
                    _frequency_place(draft, name),
                    f"{name} is rated at {f:g} Hz and {reference} at {common:g} Hz; what is coupled has one rated "
                    f"frequency, because voltages and currents are exchanged in one frame: give both the same f_n "
                    f"(a whole [network] has a key 'frequency', a binding has rating.f_n)",
                )


def _frequency(plan: ComponentPlan) -> float | None:
    """Rated frequency of a component. For a bound FMU the binding defines it, whatever parameters the FMU has."""
    return plan.description.port.f_n if isinstance(plan.description, BoundDescription) else _value(plan, "f_n")


def _frequency_place(draft: Draft, name: str) -> str:
    if isinstance(draft.system.components[name].description, BoundDescription):
        return draft.place("components", name, "binding")
    return _place(draft, name, "f_n")


def _coupled(draft: Draft) -> list[set[str]]:
    """Components that are connected, directly or through others."""
    groups = [{name} for name in draft.system.components]
    for connection in draft.system.connections:
        ends = {connection.source.component, connection.target.component}
        touched = [group for group in groups if group & ends]
        groups = [group for group in groups if not group & ends] + [set().union(*touched)]
    return groups


def _small_units(draft: Draft) -> Iterator[_Doubt]:
    """Ask about units in the power flow with a rating too small to affect the network."""
    ports = {p.name: p.bus for p in draft.network.ports} if draft.network else {}
    plans = {name: plan for name, plan in draft.system.components.items() if name in ports}
    ratings = {name: S_n for name, plan in plans.items() if (S_n := _value(plan, "S_n")) is not None}
    if not ratings:
        return
    largest = max(ratings, key=lambda name: ratings[name])
    for name, S_n in ratings.items():
        shared = [n for n in draft.origins if n in ratings and ports[n] == ports[name]] if name in draft.origins else []
        whole = sum(ratings[n] for n in shared) if shared else S_n  # the share of a unit may be arbitrarily small
        if whole < SMALLEST_SHARE * ratings[largest]:
            text = f"S_n = {S_n:g} MVA beside {largest}'s {ratings[largest]:g} MVA; is it in MVA?"
            yield _Doubt(f"{name}.S_n", _place(draft, name, "S_n"), text)


def _lines(draft: Draft) -> Iterator[_Doubt]:
    """Ask about reactance, charging, ratio, shift and R/X of the network's lines, with the values that are set."""
    grid = draft.system.components.get(draft.grid or "")
    if grid is None or draft.network is None or draft.grid is None:
        return
    wanted = {"X": LINE_X, "B": LINE_B, "tap": LINE_RATIO}
    for line in draft.network.lines:
        found = {q: _value(grid, line.variable(q)) for q in ("X", "R", "B", "tap", "shift")}
        for quantity, usual in wanted.items():
            value = found[quantity]
            if value is not None:
                where = _line_place(draft, line.name, quantity)
                yield from _outside(draft, draft.grid, line.variable(quantity), value, usual, where)
        shift = found["shift"]
        if shift is not None and abs(shift) > math.pi:
            name = line.variable("shift")
            text = f"{name} = {shift:g} rad is more than half a turn; if it is in degrees, write '{shift:g} deg'"
            yield _Doubt(f"{draft.grid}.{name}", _line_place(draft, line.name, "shift"), text)
        R, X = found["R"], found["X"]
        if R is not None and X is not None and R > MOST_R_OVER_X * X:
            names = line.variable("R"), line.variable("X")
            text = f"{names[0]} = {R:g} pu is {R / X:.3g} times {names[1]} = {X:g} pu; are the two swapped?"
            yield _Doubt(f"{draft.grid}.{names[0]}", _line_place(draft, line.name, "R"), text)
    if (stray := _value(grid, "stray_B")) is not None:
        yield from _outside(draft, draft.grid, "stray_B", stray, STRAY_B, draft.place("network", "stray_B"))


def _line_place(draft: Draft, line: str, quantity: str) -> str:
    """Place where a line's value was set, or otherwise the place of the line."""
    table = draft.case.network
    if set_at := draft.places.get(f"{draft.grid}.{line_variable(line, quantity)}"):
        return set_at
    if table is not None and line in table.lines:
        return draft.place("network", "lines", line, quantity)
    in_file = draft.data.places.get(line) if draft.data else None
    source = next((key for key in ("pandapower", "matpower") if table is not None and getattr(table, key)), None)
    return in_file or f"{draft.place('network', source) if source else draft.place('network')}, line {line!r}"


# -- places and values -------------------------------------------------------------------------------


def _place(draft: Draft, name: str, *variables: str) -> str:
    """Place of the first of some variables of a component that was set, or otherwise the place of the component."""
    found = (draft.places.get(f"{name}.{variable}") for variable in variables)
    return next((place for place in found if place), f"{draft.place('components', name)}, {variables[0]} (its default)")


def _value(plan: ComponentPlan, variable: str) -> float | None:
    """The effective number: the set value, or otherwise the FMU's default; None without both."""
    value = plan.value(variable) if variable in plan.description.variables else None
    return None if value is None or isinstance(value, bool | str) else float(value)


def _unit(plan: ComponentPlan, variable: str) -> str:
    return plan.description.variables[variable].unit


def _is_meant(draft: Draft, name: str) -> bool:
    return any(fnmatch.fnmatchcase(name, pattern) for pattern in draft.case.meant)


def _merged(doubts: list[_Doubt]) -> list[Problem]:
    """Merge equal questions about several components into one, and add how to answer it."""
    groups: dict[tuple[str, str], list[str]] = {}
    for doubt in doubts:
        groups.setdefault((doubt.place, doubt.text), []).append(doubt.name)
    return [Problem(place, _question(text, names)) for (place, text), names in groups.items()]


def _question(text: str, names: list[str]) -> str:
    components = [name.partition(".")[0] for name in names]
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    variable = names[0].partition(".")[2]
    answers = names if len(names) <= _SHOWN else [f"*.{variable}"]
    quoted = ", ".join(f'"{name}"' for name in answers)
    return (
        f"{', '.join(components[:_SHOWN])}{more}: {text}; if it is meant, say so at the top of the case: "
        f"meant = [{quoted}]"
    )

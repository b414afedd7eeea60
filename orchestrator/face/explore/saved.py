"""A page that needs neither server nor Python: its sliders move on a grid that was computed before."""

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from orchestrator.cases.form.build_choices import ALPHA
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.bisection import halve_towards
from orchestrator.core.errors import CosimError, InputError
from orchestrator.core.safe_files import check_page, write_text
from orchestrator.face.api.case import Case
from orchestrator.face.explore.asked_before import answered_questions
from orchestrator.face.explore.files import whole_page
from orchestrator.face.explore.interpolation import cells_of, corners_of, judged_cell
from orchestrator.face.explore.movers import grid_of
from orchestrator.face.explore.smaller import rounded, smaller_answer, smaller_parameters
from orchestrator.face.explore.worker import Desk
from orchestrator.output.report.short_texts import first_sentence, short
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.points import CountReport
from orchestrator.studies.sweep.axes import Axis, Vary, resolve

_MOST = 400  # of the grid's points: the page holds all their modes
_STEPS = 12  # values of a slider of the first screen, beside the case's own
_HALVES = 5  # of the way to a slider's end that has no answer: its last value is within 3 % of it
_LONGEST_REASON = 120  # characters of why a slider goes no further
_BYTES = 2_500_000  # that the answers of such a page take, about


def save_page(
    path: Path,
    case: Case,
    desk: Desk,
    beginning: Mapping[str, Any],
    varied: Sequence[Vary],
    report: CountReport,
    *,
    further: Sequence[str] = (),
) -> None:
    """Compute the modes over the grid, and write the page; a scenario's other values are those it begins with.

    Without ``varied`` it has the sliders of the first screen, each of which moves alone from the case's values. Between
    neighbours a value in the middle is computed as well: it tells how far a straight line is off there. ``further``
    scenarios stand beside that of the beginning, with the same sliders."""
    check_page(path)
    if further and not varied:
        raise InputError(
            "several scenarios of a saved page have the same sliders; name them by --vary, or give one --scenario"
        )
    names = [str(beginning["scenario"]), *further]
    begun = [{**beginning, "scenario": name} for name in names]
    plans = [_plan_of(case, desk, one, varied, len(names)) for one in begun]
    if sum(len(plan.points) for plan in plans) > _MOST:
        count = len(plans[0].points)
        of_each = f" for each of {len(plans)} scenarios" if further else ""
        raise InputError(
            f"--vary: the grid has {count} points{of_each}, and a saved page at most {_MOST}; give fewer values"
        )
    held = _Held(report, sum(len(plan.points) + len(plan.cells) for plan in plans))
    for plan in plans:
        held.compute(plan)
    opened = desk.answer({"ask": "open"}, _nobody)
    asked_before = answers_to_questions(desk, beginning, opened)
    shown = [_shown_of(plan, held.answers) for plan in plans]
    content = {
        "beginning": beginning,
        "open": {**opened, "scenarios": {name: opened["scenarios"][name] for name in names}},
        "parameters": {plan.name: plan.parameters for plan in plans},
        "flows": held.flows,
        "answers": held.answers,
        "cells": held.cells,
        "asked": asked_before,
        **shown[0],
    }
    if further:
        content["others"] = dict(zip(further, shown[1:], strict=True))
    write_text(path, whole_page(content))


def answers_to_questions(
    desk: Desk, beginning: Mapping[str, Any], opened: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return the questions of the live page that a saved page answers as well, with their answers."""
    asked = {"range": beginning["range"]}

    def computed(scenario: str, values: Mapping[str, Any]) -> dict[str, Any]:
        of = {**asked, "ask": "modes", "scenario": scenario, "values": dict(values)}
        return desk.answer(of, _nobody)

    of_scenario = {"ask": "parameters", "scenario": beginning["scenario"], **asked}
    shown = desk.answer(of_scenario, _nobody)
    return answered_questions(beginning, shown, opened, computed)


@dataclass(frozen=True)
class _Plan:
    """The part of a page that is of one scenario, and what is to be computed for it."""

    name: str
    parameters: Mapping[str, Any]  # as the page has them
    grid: Mapping[str, Sequence[float]]  # values of each slider
    own: Mapping[str, float]  # the case's value of each
    first: Mapping[str, Any]  # what the first screen has beside the modes
    ends: Mapping[str, Mapping[str, str]]  # why a slider goes no further ``below`` or ``above``
    points: Sequence[Mapping[str, float]]
    cells: Sequence[Mapping[str, tuple[float, float]]]
    alone: bool  # each slider moves alone, from the case's values
    computed: Callable[[Mapping[str, float]], dict[str, Any]]


def _plan_of(
    case: Case, desk: Desk, beginning: Mapping[str, Any], varied: Sequence[Vary], scenarios: int
) -> _Plan:
    name, values = str(beginning["scenario"]), dict(beginning["values"])
    prepared = case.scenario(name, values).prepared
    axes = [resolve(vary, [prepared]) for vary in varied]
    for vary, axis in zip(varied, axes, strict=True):
        if not axis.values or axis.scale is not None:
            raise InputError(
                f"--vary {vary.key}: a saved page has sliders on values that are set; name one, with a COUNT"
            )
    asked = {"scenario": name, "range": beginning["range"]}
    parameters = desk.answer({**asked, "ask": "parameters"}, _nobody)
    known = {one["parameter"]: one["value"] for one in parameters.get("parameters", ())} | values
    if any(axis.key == ALPHA for axis in axes):
        known.setdefault(ALPHA, _share_of(prepared))
    own = _own_values(axes, known)
    grid = {axis.key: _with_own(axis.values, own.get(axis.key)) for axis in axes}
    points = [dict(zip(grid, chosen, strict=True)) for chosen in itertools.product(*grid.values())]
    setters = {axis.key: axis.sets for axis in axes}

    def computed(point: Mapping[str, float]) -> dict[str, Any]:
        given = dict(values)
        for key, x in point.items():
            given |= setters[key](x) if key in setters else {key: x}
        return desk.answer({**asked, "ask": "modes", "values": given}, _nobody)

    first: dict[str, Any] = {}
    ends: dict[str, dict[str, str]] = {}
    if varied:
        first["first"] = _answered(desk, {**asked, "values": values, "ask": "first"})
    else:
        first, steps = _first_screen(desk, {**asked, "values": values})
        movers = first["movers"]["movers"]
        own = {one["parameter"]: one["value"] for one in movers}
        reached = {one["parameter"]: _reached_values(one, steps, computed) for one in movers}
        grid = {key: values for key, (values, _) in reached.items()}
        ends = {key: why for key, (_, why) in reached.items() if why}
        points += [{key: x} for key, axis in grid.items() for x in axis if x != own[key]]
    listed = {one["parameter"] for one in parameters.get("parameters", ())}
    added = [_as_parameter(axis, grid[axis.key], own) for axis in axes if axis.key not in listed]
    kept = smaller_parameters(parameters, [*grid], scenarios)
    kept["parameters"] = [*kept.get("parameters", ()), *added]
    alone = [one for key in grid for one in cells_of({key: grid[key]})]
    cells = cells_of(grid) if varied else alone
    return _Plan(
        name=name,
        parameters=kept,
        grid=grid,
        own=own,
        first=first,
        ends=ends,
        points=points,
        cells=cells,
        alone=not varied,
        computed=computed,
    )


def _shown_of(plan: _Plan, answers: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what the page has for each scenario: its sliders' values, the case's own, and the first screen."""
    own = [one for one in answers if one["scenario"] == plan.name]
    grid = _values_with_answers(plan.grid, plan.own, own) if plan.alone else plan.grid
    ends = {"ends": plan.ends} if plan.ends else {}
    return {"grid": grid, "own": plan.own, **ends, **rounded(plan.first)}


class _Held:
    """The answers and cells that a page holds, as they are computed."""

    def __init__(self, report: CountReport, count: int) -> None:
        self.answers: list[dict[str, Any]] = []
        self.flows: list[Any] = []
        self.cells: list[dict[str, Any]] = []
        self._report = report
        self._done, self._count = 0, count

    def compute(self, plan: _Plan) -> None:
        """Add the answers of a scenario, and the cells whose corners have answers.

        A point of a slider that moves alone is left out where the case has no answer."""
        for point in plan.points:
            self._tell()
            try:
                answer = smaller_answer(plan.computed(point), self.flows)
            except CosimError:
                if not plan.alone or not point:
                    raise
                continue
            self.answers.append({"scenario": plan.name, "values": point, "answer": answer})
        for cell in plan.cells:
            self._judge(plan, cell)

    def _judge(self, plan: _Plan, cell: Mapping[str, tuple[float, float]]) -> None:
        self._tell()
        own = plan.own if plan.alone else {}  # the values of which an answer names none
        points = [(one["scenario"], one["values"]) for one in self.answers]
        corners = [
            (plan.name, {key: x for key, x in corner.items() if own.get(key) != x})
            for corner in corners_of(cell)
        ]
        if all(corner in points for corner in corners):
            places = [points.index(corner) for corner in corners]
            answers = [one["answer"] for one in self.answers]
            judged = judged_cell(cell, places, answers, plan.computed)
            self.cells += [] if judged is None else [{**judged, "scenario": plan.name}]

    def _tell(self) -> None:
        self._done += 1
        self._report(self._done, self._count)


def _share_of(prepared: PreparedScenario) -> Any:
    """The converters' share of the units, as the scenario has it."""
    units, table = prepared.case.table.units, prepared.case.scenarios[prepared.name]
    return table.set.get(ALPHA, units.alpha if units else None)


def _own_values(axes: Sequence[Axis], known: Mapping[str, Any]) -> dict[str, float]:
    """The case's value of each axis that has one: of several that are set together, the one that all have."""
    found: dict[str, float] = {}
    for axis in axes:
        keys = axis.sets(axis.values[0])
        before = [x for name, x in known.items() if any(fnmatchcase(name, key) for key in keys)]
        if before and before[0] is not None and before.count(before[0]) == len(before):
            found[axis.key] = float(before[0])
    return found


def _as_parameter(axis: Axis, values: Sequence[float], own: Mapping[str, float]) -> dict[str, Any]:
    """A slider's value that is no parameter of an FMU, in the form of those that are."""
    return {
        "parameter": axis.key,
        "value": own.get(axis.key, values[0]),
        "unit": axis.unit,
        "type": "Real",
        "variability": "tunable",
        "description": axis.title if axis.title != axis.key else "All of these together",
        "minimum": values[0],
        "maximum": values[-1],
        "switches": [],
    }


def _first_screen(desk: Desk, asked: Mapping[str, Any]) -> tuple[dict[str, Any], int]:
    """``movers`` and ``first``, the response, as the page shows them at once, or the ``reason`` why there is none; and
    how many values a slider may have so that the page stays small."""
    answer = desk.answer({**asked, "ask": "modes"}, _nobody)
    modes = answer["modes"]["scenarios"][0]["modes"]
    nothing: dict[str, Any] = {"components": {}}
    least = min(modes, key=lambda mode: mode["damping_percent"], default=nothing)
    questions = {
        "movers": {**asked, "ask": "movers", "components": least["components"]},
        "first": {**asked, "ask": "first"},
    }
    first = {kind: _answered(desk, question) for kind, question in questions.items()}
    size = len(json.dumps(smaller_answer(answer, [])))
    fitting = int(_BYTES / size / max(1, len(first["movers"]["movers"])))
    return first, max(2, min(_STEPS, fitting))


def _answered(desk: Desk, question: Mapping[str, Any]) -> dict[str, Any]:
    try:
        return desk.answer(question, _nobody)
    except CosimError as error:
        return {"movers": [], "curves": {}, "reason": str(error)}


def _reached_values(
    mover: Mapping[str, Any], steps: int, computed: Callable[[Mapping[str, float]], dict[str, Any]]
) -> tuple[list[float], dict[str, str]]:
    """A slider's values, all of them in the range where the case has an answer: few beside it would hide a mode.

    Beside them, why it goes no further ``below`` or ``above``, where that is a declared bound or has no answer."""
    key, value = str(mover["parameter"]), float(mover["value"])
    why: dict[str, str] = {}

    def answered(x: float) -> bool:
        try:
            computed({key: x})
        except CosimError as error:
            failure = Failure.of(error)
            said = first_sentence(str(failure.cause or failure.text))
            why["below" if x < value else "above"] = short(said.rstrip("."), _LONGEST_REASON)
            return False
        return True

    def farthest(end: float) -> float:
        if end == value or answered(end):
            return end
        return halve_towards(value, end, answered, most=_HALVES, rounded=_in_four_digits)[0]

    axis = grid_of(mover, steps)
    low, high = farthest(axis[0]), farthest(axis[-1])
    for side, end, bound in (("below", low, "minimum"), ("above", high, "maximum")):
        if end == mover[bound]:
            why[side] = "the declared bound"
    return grid_of({**mover, "minimum": low, "maximum": high}, steps), why


def _in_four_digits(x: float) -> float:
    return float(f"{x:.4g}")


def _with_own(axis: Sequence[float], own: float | None) -> list[float]:
    """A slider's values with the case's own among them, at which the page begins."""
    others = [x for x in axis if own is None or not math.isclose(x, own, rel_tol=1e-9)]
    return sorted(others if own is None else [*others, own])


def _values_with_answers(
    grid: Mapping[str, Sequence[float]],
    own: Mapping[str, float],
    answers: Sequence[Mapping[str, Any]],
) -> dict[str, list[float]]:
    """The values of each slider that have an answer; its ``own`` is the case's."""
    known = [one["values"] for one in answers]
    return {
        key: [value for value in axis if value == own[key] or {key: value} in known]
        for key, axis in grid.items()
    }


def _nobody(part: dict[str, Any]) -> None:
    """Tell nobody of the progress."""

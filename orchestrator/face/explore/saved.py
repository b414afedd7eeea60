"""A page that needs neither server nor Python: its sliders move on a grid that was computed before."""

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from orchestrator.cases.form.build_choices import ALPHA
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import CosimError, InputError
from orchestrator.core.safe_files import check_page, write_text
from orchestrator.face.api.case import Case
from orchestrator.face.explore.between import cells_of, corners_of, judged_cell
from orchestrator.face.explore.files import whole_page
from orchestrator.face.explore.movers import grid_of
from orchestrator.face.explore.smaller import rounded, smaller_answer, smaller_parameters
from orchestrator.face.explore.worker import Desk
from orchestrator.studies.points.points import CountReport
from orchestrator.studies.sweep.axes import Axis, Vary, resolve

_MOST = 400  # of the grid's points: the page holds all their modes
_STEPS = 12  # values of a slider of the first screen, beside the case's own
_BYTES = 2_500_000  # that the answers of such a page take, about


def save_page(
    path: Path,
    case: Case,
    desk: Desk,
    beginning: Mapping[str, Any],
    varied: Sequence[Vary],
    report: CountReport,
) -> None:
    """Compute the modes over the grid, and write the page; a scenario's other values are those it begins with.

    Without ``varied`` it has the sliders of the first screen, each of which moves alone from the case's values. Between
    neighbours a value in the middle is computed as well: it tells how far a straight line is off there."""
    check_page(path)
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
    if len(points) > _MOST:
        raise InputError(
            f"--vary: the grid has {len(points)} points, and a saved page at most {_MOST}; give fewer values"
        )
    first: dict[str, Any] = {}
    if varied:
        first["first"] = _answered(desk, {**asked, "values": values, "ask": "first"})
    else:
        first, steps = _first_screen(desk, {**asked, "values": values})
        own = {one["parameter"]: one["value"] for one in first["movers"]["movers"]}
        grid = {one["parameter"]: grid_of(one, steps) for one in first["movers"]["movers"]}
        points += [{key: x} for key, axis in grid.items() for x in axis if x != own[key]]
    setters = {axis.key: axis.sets for axis in axes}

    def computed(point: Mapping[str, float]) -> dict[str, Any]:
        given = dict(values)
        for key, x in point.items():
            given |= setters[key](x) if key in setters else {key: x}
        return desk.answer({**asked, "ask": "modes", "values": given}, _nobody)

    cells = (
        cells_of(grid) if varied else [one for key in grid for one in cells_of({key: grid[key]})]
    )
    held = _Held(name, computed, report, len(points) + len(cells))
    for point in points:
        held.compute(point, may_fail=not varied and bool(point))
    for cell in cells:
        held.judge(cell, {} if varied else own)
    opened = desk.answer({"ask": "open"}, _nobody)
    listed = {one["parameter"] for one in parameters.get("parameters", ())}
    added = [_as_parameter(axis, grid[axis.key], own) for axis in axes if axis.key not in listed]
    kept = smaller_parameters(parameters, [*grid])
    kept["parameters"] = [*kept.get("parameters", ()), *added]
    content = {
        "beginning": beginning,
        "open": {**opened, "scenarios": {name: opened["scenarios"][name]}},
        "parameters": {name: kept},
        "grid": grid if varied else _values_with_answers(grid, own, held.answers),
        "own": own,
        "flows": held.flows,
        "answers": held.answers,
        "cells": held.cells,
        **rounded(first),
    }
    write_text(path, whole_page(content))


class _Held:
    """The answers and cells that a page holds, as they are computed."""

    def __init__(
        self,
        scenario: str,
        computed: Callable[[Mapping[str, float]], dict[str, Any]],
        report: CountReport,
        count: int,
    ) -> None:
        self.answers: list[dict[str, Any]] = []
        self.flows: list[Any] = []
        self.cells: list[dict[str, Any]] = []
        self._scenario, self._computed, self._report = scenario, computed, report
        self._done, self._count = 0, count

    def compute(self, point: Mapping[str, float], *, may_fail: bool) -> None:
        """Add the answer at a point; one that ``may_fail`` is left out where the case has none."""
        self._tell()
        try:
            answer = smaller_answer(self._computed(point), self.flows)
        except CosimError:
            if not may_fail:
                raise
            return
        self.answers.append({"scenario": self._scenario, "values": point, "answer": answer})

    def judge(self, cell: Mapping[str, tuple[float, float]], own: Mapping[str, float]) -> None:
        """Add a cell whose corners have answers; ``own``: the values of which an answer names none."""
        self._tell()
        points = [one["values"] for one in self.answers]
        corners = [
            {key: x for key, x in corner.items() if own.get(key) != x}
            for corner in corners_of(cell)
        ]
        if all(corner in points for corner in corners):
            places = [points.index(corner) for corner in corners]
            answers = [one["answer"] for one in self.answers]
            judged = judged_cell(cell, places, answers, self._computed)
            self.cells += [] if judged is None else [judged]

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

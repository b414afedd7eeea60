"""A page that needs neither server nor Python: its sliders move on a grid that was computed before."""

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from orchestrator.core.errors import CosimError, InputError
from orchestrator.core.safe_files import check_page, write_text
from orchestrator.face.api.case import Case
from orchestrator.face.explore.files import whole_page
from orchestrator.face.explore.movers import grid_of
from orchestrator.face.explore.worker import Desk
from orchestrator.studies.points.points import CountReport
from orchestrator.studies.sweep.axes import Vary, resolve

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

    Without ``varied`` it has the sliders of the first screen, each of which moves alone from the case's values."""
    check_page(path)
    name, values = str(beginning["scenario"]), dict(beginning["values"])
    prepared = [case.scenario(name, values).prepared]
    axes = [resolve(vary, prepared) for vary in varied]
    for vary, axis in zip(varied, axes, strict=True):
        if axis.members or not axis.values:
            raise InputError(
                f"--vary {vary.key}: a saved page has sliders on single parameters; name one, with a COUNT"
            )
    asked = {"scenario": name, "range": beginning["range"]}
    parameters = desk.answer({**asked, "ask": "parameters"}, _nobody)
    known = {one["parameter"]: one["value"] for one in parameters.get("parameters", ())} | values
    own = {axis.key: float(known[axis.key]) for axis in axes if axis.key in known}
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
    answers: list[dict[str, Any]] = []
    for done, point in enumerate(points):
        report(done + 1, len(points))
        question = {**asked, "ask": "modes", "values": {**values, **point}}
        try:
            found = desk.answer(question, _nobody)
        except CosimError:
            if varied or not point:
                raise
            continue  # the slider leaves out a value at which the case has no answer
        answers.append({"scenario": name, "values": point, "answer": found})
    opened = desk.answer({"ask": "open"}, _nobody)
    content = {
        "beginning": beginning,
        "open": {**opened, "scenarios": {name: opened["scenarios"][name]}},
        "parameters": {name: parameters},
        "grid": grid if varied else _values_with_answers(grid, own, answers),
        "own": own,
        "answers": answers,
        **first,
    }
    write_text(path, whole_page(content))


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
    fitting = int(_BYTES / len(json.dumps(answer)) / max(1, len(first["movers"]["movers"])))
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

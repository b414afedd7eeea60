"""A page that needs neither server nor Python: its sliders move on a grid that was computed before."""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import check_page, write_text
from orchestrator.face.api.case import Case
from orchestrator.face.explore.files import whole_page
from orchestrator.face.explore.worker import Desk
from orchestrator.studies.points.points import CountReport
from orchestrator.studies.sweep.axes import Vary, resolve

_MOST = 400  # of the grid's points: the page holds all their modes


def save_page(
    path: Path,
    case: Case,
    desk: Desk,
    beginning: Mapping[str, Any],
    varied: Sequence[Vary],
    report: CountReport,
) -> None:
    """Compute the modes over the grid, and write the page; a scenario's other values are those it begins with."""
    check_page(path)
    name, values = str(beginning["scenario"]), dict(beginning["values"])
    prepared = [case.scenario(name, values).prepared]
    axes = [resolve(vary, prepared) for vary in varied]
    for vary, axis in zip(varied, axes, strict=True):
        if axis.members or not axis.values:
            raise InputError(
                f"--vary {vary.key}: a saved page has sliders on single parameters; name one, with a COUNT"
            )
    grid = {axis.key: list(axis.values) for axis in axes}
    points = [dict(zip(grid, chosen, strict=True)) for chosen in itertools.product(*grid.values())]
    if len(points) > _MOST:
        raise InputError(
            f"--vary: the grid has {len(points)} points, and a saved page at most {_MOST}; give fewer values"
        )
    asked = {"scenario": name, "range": beginning["range"]}
    answers = []
    for done, point in enumerate(points):
        report(done + 1, len(points))
        found = desk.answer(
            {**asked, "ask": "modes", "values": {**values, **point}}, lambda part: None
        )
        answers.append({"scenario": name, "values": point, "answer": found})
    opened = desk.answer({"ask": "open"}, lambda part: None)
    parameters = desk.answer({**asked, "ask": "parameters"}, lambda part: None)
    content = {
        "beginning": beginning,
        "open": {**opened, "scenarios": {name: opened["scenarios"][name]}},
        "parameters": {name: parameters},
        "grid": grid,
        "answers": answers,
    }
    write_text(path, whole_page(content))

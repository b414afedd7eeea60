"""The operating points and outages of a study, each point with each outage."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from orchestrator.cases.case import Case
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import Value
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.settings.layers import OptionValues
from orchestrator.core.asked import Names
from orchestrator.core.errors import InputError
from orchestrator.studies.operating_points.item import Item
from orchestrator.studies.operating_points.line_ends import lines_with_ends
from orchestrator.studies.operating_points.outages import Outage, read_outages
from orchestrator.studies.operating_points.point_columns import Elements
from orchestrator.studies.operating_points.points_file import (
    OperatingCase,
    questions_about,
    read_points,
)
from orchestrator.studies.points.request import OfCase

_MOST = 1_000_000


@dataclass(frozen=True)
class OperatingPoints:
    # case, prepared: the case, and its scenario as it is without the values of any point
    case: Case
    prepared: PreparedScenario
    # parameter files, and after them the values of the command line; weakest first
    layers: tuple[ParameterFile, ...]
    # points, outages: operating points, and outages; the first outage is the intact network
    points: tuple[OperatingCase, ...]
    outages: tuple[Outage, ...]
    items: tuple[Item, ...]  # each point with each outage that takes anything from it

    def of(self, item: Item) -> tuple[OperatingCase, Outage]:
        return self.points[item.point], self.outages[item.outage]


def read_operating_points(
    case: Case,
    request: OfCase,
    points: str | Path | None,
    outages: Names | None,
    scenario: str | None,
    off: Mapping[str, Value] | None = None,
) -> OperatingPoints:
    """Prepare the scenario, which builds the FMUs that it needs, and read its points and outages."""
    name = scenario or next(iter(case.scenarios))
    overrides = {
        key: value for key, value in request.overrides.items() if key not in (off or {})
    } | dict(off or {})

    def prepare(case: Case) -> PreparedScenario:
        return case.prepare([name], overrides, request.step_size, None, request.files)[0]

    prepared = prepare(case)
    layers = (*request.files, *([OptionValues.of(overrides)] if overrides else []))
    elements = Elements.of(prepared)
    own = OperatingCase("case", 1.0, {}, (), str(case.path))
    rows = [own] if points is None else read_points(Path(points), prepared, elements)
    asked = () if points is None else tuple(questions_about(Path(points), rows, prepared, elements))
    lost = read_outages(cast("str | None", outages), elements)
    opening = lines_with_ends(element for outage in lost for element in outage.elements)
    if opening:
        case = replace(case, line_ends=opening)
        prepared = prepare(case)
    if len(rows) * len(lost) > _MOST:
        raise InputError(
            f"{points}: {len(rows)} operating points with {len(lost)} outages are {len(rows) * len(lost)}; at most "
            f"{_MOST} are computed: split the file"
        )
    items = tuple(
        Item(
            p,
            o,
            point.values,
            tuple(dict.fromkeys((*point.out, *outage.elements))),
            tuple(name for name in outage.elements if name not in point.out),
        )
        for p, point in enumerate(rows)
        for o, outage in enumerate(lost)
        if o == 0 or set(outage.elements) - set(point.out)
    )
    prepared = replace(prepared, questions=prepared.questions + asked)
    return OperatingPoints(case, prepared, layers, tuple(rows), tuple(lost), items)

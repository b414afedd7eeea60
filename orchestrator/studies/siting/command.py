"""Places of a device: what users may ask, what they get, and what ``gfor site`` prints."""

from collections.abc import Callable, Iterator
from typing import Any

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.cases.case import Case
from orchestrator.core.errors import NOT_MET
from orchestrator.studies.points.study import StudyAtOnce
from orchestrator.studies.siting.machine_view import MachineSiting
from orchestrator.studies.siting.machines import find_machines
from orchestrator.studies.siting.place_ranking import PlaceRanking
from orchestrator.studies.siting.study import REGULATOR, SiteRequest, find_sites
from orchestrator.studies.siting.view import Siting

Found = PlaceRanking[Any]
"""Buses or machines."""


def _computed(case: Case, request: SiteRequest, report: Callable[[int, int], None]) -> Found:
    """Compute a device's places: buses, or machines."""
    if request.device == REGULATOR:
        return MachineSiting(find_machines(case, request, report))
    return Siting(find_sites(case, request, report))


def _parts(found: Found) -> Iterator[RenderableType]:
    first, *behind = found.answer_lines
    yield f"[bold]{escape(first)}[/]"
    yield from map(escape, (*behind, *found.remarks))
    yield ""
    yield found.best_table()
    yield ""


def _warnings(found: Found) -> list[str]:
    name = found.result.prepared.name
    return [f"scenario {name!r}: {text}" for text in found.without_device.unasked]


def _code(found: Found, _fail_unstable: bool) -> int:
    """Return 0 if the coupled FMUs confirm every place that was tried, and none makes the system unstable."""
    return 0 if found.agrees and not found.result.breaking else NOT_MET


STUDY = StudyAtOnce(
    request=SiteRequest,
    compute=_computed,
    prepared=lambda found: [found.result.prepared],
    parts=_parts,
    code=_code,
    counted="steps",
    files="site.json, buses.csv and site.html with a map; for --device regulator machines.json, .csv and .html",
    warnings=_warnings,
)

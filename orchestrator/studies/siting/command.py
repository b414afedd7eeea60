"""Places of a device: what users may ask, what they get, and what ``gfor site`` prints."""

from collections.abc import Iterator

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.core.errors import NOT_MET
from orchestrator.studies.points.study import StudyAtOnce
from orchestrator.studies.siting.study import SiteRequest, find_sites
from orchestrator.studies.siting.view import Siting, ranking_table


def _parts(found: Siting) -> Iterator[RenderableType]:
    yield from map(escape, (found.answer, *found.remarks))
    yield from ("", ranking_table(found.result), "")


STUDY = StudyAtOnce(
    request=SiteRequest,
    compute=lambda case, request, report: Siting(find_sites(case, request, report)),
    prepared=lambda found: [found.result.prepared],
    parts=_parts,
    code=lambda found, _: 0 if found.agrees and not found.result.breaking else NOT_MET,
    counted="places",
    files="site.json, buses.csv and site.html with a map",
    warnings=lambda found: [
        f"scenario {found.result.prepared.name!r}: {text}"
        for text in found.result.intact.found.unasked
    ],
)

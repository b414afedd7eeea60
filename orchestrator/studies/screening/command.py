"""The screening: what users may ask, what they get, and what ``gfor screen`` prints."""

from collections.abc import Iterator

from rich.console import RenderableType

from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.points.study import PointStudy
from orchestrator.studies.screening.limits import limits_table
from orchestrator.studies.screening.point import StretchTask
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import plan_screening, run_screening
from orchestrator.studies.screening.trips import runs_table
from orchestrator.studies.screening.view import (
    Screening,
    modes_table,
    no_modes,
    overview,
    remarks,
    verdict,
)


def _parts(found: Screening) -> Iterator[RenderableType]:
    plan = found.result.plan
    yield verdict(found.summary)
    if len(plan.outages) + len(plan.points) > 2:
        yield from ("", overview(found.summary))
    beyond = limits_table(found.summary)
    if beyond is not None:
        yield from ("", beyond)
    ran = runs_table(found.summary)
    if ran is not None:
        yield from ("", ran)
    yield from ("", no_modes(found.summary) or modes_table(found.summary), "")


def _code(found: Screening, fail_unstable: bool) -> int:
    """1 if nothing has modes, after an internal error, and where instability fails it; of a part likewise.

    A part without a stretch has nothing that could fail."""
    counts, items = found.summary.counts, found.result.items
    stable = found.stable if found.result.complete else found.summary.stable_here
    failed = bool(items) and not counts[Status.COMPUTED]
    return int(failed or bool(counts[Status.INTERNAL]) or (fail_unstable and not stable))


STUDY = PointStudy(
    request=ScreeningRequest,
    plan=plan_screening,
    run=run_screening,
    shown=Screening,
    task=StretchTask,
    counted="items",
    parts=_parts,
    code=_code,
    remarks=lambda found: remarks(found.summary),
)

"""A design over points: what users may ask, what they get, and what ``gfor design --points`` prints."""

from collections.abc import Iterator

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.core.errors import NOT_MET
from orchestrator.studies.coordinated_design import view, words
from orchestrator.studies.coordinated_design.point import PointsTask
from orchestrator.studies.coordinated_design.study import (
    PointsDesignRequest,
    design_over_points,
    plan_points_design,
)
from orchestrator.studies.coordinated_design.view import CoordinatedDesign
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.points.study import PointStudy


def _parts(found: CoordinatedDesign) -> Iterator[RenderableType]:
    design = found.result
    yield words.verdict_of(design.verdict).markup()
    yield from ("", view.least_damped_table(design.verdict), "", view.settings_table(design))
    if design.plan.request.ranked:
        yield from ("", view.ranking_table(design))
    yield from ("", escape(words.what_it_rests_on(design)))


def _code(found: CoordinatedDesign, fail_unstable: bool) -> int:
    """1 where no point has modes, gfor-cosim itself failed somewhere, or instability fails it; `NOT_MET` where a
    damping that was asked for is not reached everywhere, or that is not known."""
    verdict = found.result.verdict
    internal = any(
        Status.INTERNAL in (point.before.status, point.after.status) for point in verdict.points
    )
    if internal or not verdict.known or (fail_unstable and not verdict.stable):
        return 1
    return NOT_MET if verdict.wanted is not None and not verdict.met else 0


STUDY = PointStudy(
    request=PointsDesignRequest,
    plan=plan_points_design,
    run=design_over_points,
    shown=CoordinatedDesign,
    task=PointsTask,
    parts=_parts,
    code=_code,
    remarks=lambda found: [
        *words.about_settings(found.result),
        *words.remarks(found.result.verdict),
    ],
)

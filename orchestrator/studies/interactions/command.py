"""Interactions: what users may ask, what they get, and what ``gfor interactions`` prints."""

from collections.abc import Iterator

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.studies.interactions.point import SystemTask
from orchestrator.studies.interactions.request import InteractionsRequest
from orchestrator.studies.interactions.study import plan_interactions, run_interactions
from orchestrator.studies.interactions.view import (
    Interactions,
    assignments_table,
    modes_table,
    pairs_table,
    systems_table,
)
from orchestrator.studies.interactions.words import verdict_of
from orchestrator.studies.points.study import PointStudy


def _parts(found: Interactions) -> Iterator[RenderableType]:
    judgement = found.judgement
    yield verdict_of(judgement).markup()
    yield from map(escape, found.sentences[1:])
    yield from ("", modes_table(judgement), "")
    if judgement.pairs:
        yield from (pairs_table(judgement), "")
    yield from (systems_table(judgement), "")
    if found.result.plan.swapped:
        yield from (assignments_table(judgement), "")


def _code(found: Interactions, fail_unstable: bool) -> int:
    """1 if the system as it is has no modes."""
    failed = found.judgement.whole.record.error is not None
    return int(failed or (fail_unstable and not found.judgement.stable))


STUDY = PointStudy(
    request=InteractionsRequest,
    plan=plan_interactions,
    run=run_interactions,
    shown=Interactions,
    task=SystemTask,
    counted="systems",
    parts=_parts,
    code=_code,
    warnings=lambda found: found.warnings,
)

"""The sweep: what users may ask, what they get, and what ``gfor sweep`` prints."""

from collections.abc import Iterator

from rich.console import RenderableType

from orchestrator.studies.points.study import PointStudy
from orchestrator.studies.sweep.limit import Ending
from orchestrator.studies.sweep.point import SweepPointTask
from orchestrator.studies.sweep.request import SweepRequest
from orchestrator.studies.sweep.sweep import plan_sweep, run_sweep
from orchestrator.studies.sweep.view import ParameterSweep


def _parts(sweep: ParameterSweep) -> Iterator[RenderableType]:
    from orchestrator.studies.sweep import tables  # noqa: PLC0415 - imports Matplotlib, a second

    yield from tables.limits(sweep.samples) or tables.stability(sweep.samples)
    yield from ("", tables.trajectories(sweep.samples), "")


def _code(sweep: ParameterSweep, fail_unstable: bool) -> int:
    """1 if no point has modes."""
    scenarios = sweep.result.scenarios
    if not any(s.trajectories for s in scenarios):
        return 1
    held_up = all(x.kind is Ending.HOLDS for x in sweep.limits) and all(s.stable for s in scenarios)
    return int(fail_unstable and not held_up)


STUDY = PointStudy(
    request=SweepRequest,
    plan=plan_sweep,
    run=run_sweep,
    shown=ParameterSweep,
    task=SweepPointTask,
    prepared=lambda plan: plan.scenarios,
    parts=_parts,
    code=_code,
    remarks=lambda sweep: sweep.remarks,
)

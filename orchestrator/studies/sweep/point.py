"""One point of a sweep: its task and its result."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import cache
from multiprocessing.util import Finalize
from typing import Any

from orchestrator.cases.case import Case
from orchestrator.cases.form.schema import Value
from orchestrator.cases.questions.plausibility import overloads
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.service import in_service
from orchestrator.core.errors import StartError
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.studies.black_box.coupled_modes import coupled_with_boxes
from orchestrator.studies.modes.modes import ModesResult, compute_modes, modes_of
from orchestrator.studies.operating_points.bench import PointBench
from orchestrator.studies.operating_points.widening import widenings_of
from orchestrator.studies.points.executor import Executor, Serial
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.processes import in_own_worker
from orchestrator.studies.points.task import Kept, Task, computed

_EARLY = 10
"""Priority at the end of a worker: before multiprocessing's own, and before folders are removed."""


@dataclass(frozen=True)
class PointRecord(Kept):
    modes: ModeSet | None = None  # least damped first
    # names that the case gives to some of these modes, by index
    named: dict[str, int] = field(default_factory=dict)
    failure: Failure | None = None  # why there are none; None for a point with modes
    residual: float = float("nan")  # of the steady state, as in `OperatingPoint`
    warnings: tuple[str, ...] = ()
    # how the linear model of every component was found
    linearised: dict[str, str] = field(default_factory=dict)
    # stability, because: the verdict over the whole spectrum, as `Stability.as_json` gives it, and its figures in
    # words; empty where the point failed
    stability: dict[str, Any] = field(default_factory=dict)
    because: str = ""
    # units beyond their rating [pu of it]
    overloads: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SweepPointTask(Task):
    record = PointRecord
    # the varied values by ``component.variable``, which override all layers
    overrides: dict[str, Value]
    frequency_range: tuple[float, float]  # of the modes [Hz]
    black_box: bool = False  # identify the components that hide their states


def compute_point(task: SweepPointTask) -> PointRecord:
    return computed(task, _modes)


def _modes(task: SweepPointTask, case: Case) -> PointRecord:
    """The modes, with wider limits of exciters and governors where these alone keep the point from starting; a limit
    that is varied is what somebody asks about, and stays."""
    prepared = task.study.prepare(case, task.overrides)
    try:
        return _at(prepared, task)
    except StartError as error:
        wider = error.wider
        if not wider or wider.keys() & task.overrides.keys():
            raise
    record = _at(task.study.prepare(case, {**task.overrides, **wider}), task)
    told = map(str, widenings_of(prepared, wider))
    return replace(record, warnings=(*record.warnings, *told))


def _at(prepared: PreparedScenario, task: SweepPointTask) -> PointRecord:
    asked = tuple(
        question for question in prepared.questions if question not in prepared.idle.values()
    )
    # A sweep follows modes from point to point itself, and asks of all scenarios together.
    find = coupled_with_boxes if task.black_box else _on_open_fmus
    return _record(find(replace(prepared, beside=None, questions=asked), task.frequency_range))


def _on_open_fmus(prepared: PreparedScenario, frequency_range: tuple[float, float]) -> ModesResult:
    """`compute_modes` to the last bit, on the FMUs of the point before where they stay open and can serve this one."""
    bench = _bench_of_worker() if in_own_worker() else _bench_here.get()
    if bench is None:
        return compute_modes(prepared, frequency_range)
    with bench.serving(in_service(prepared)) as master:
        return modes_of(prepared, master, frequency_range)


@contextmanager
def fmus_kept_open(executor: Executor) -> Iterator[None]:
    """Inside, the points that this process computes one after another stand on the same FMUs."""
    if not isinstance(executor, Serial):
        yield
        return
    with PointBench(remember=True) as bench:
        before = _bench_here.set(bench)
        try:
            yield
        finally:
            _bench_here.reset(before)


_bench_here: ContextVar[PointBench | None] = ContextVar("bench of this process", default=None)


@cache
def _bench_of_worker() -> PointBench:
    bench = PointBench(remember=True)
    Finalize(None, bench.close, exitpriority=_EARLY)  # a worker runs none of `atexit`
    return bench


def _record(result: ModesResult) -> PointRecord:
    modes = result.modes
    return PointRecord(
        ModeSet.of(modes, result.model.names),
        {
            name: next(i for i, m in enumerate(modes) if m is mode)
            for name, mode in result.named.items()
        },
        residual=result.operating_point.residual,
        warnings=result.warnings,
        linearised=result.linearised,
        stability=result.stability.as_json(),
        because=result.stability.because(),
        overloads=overloads(
            result.prepared.system.components,
            result.prepared.case.table.meant,
            result.prepared.base_ratings,
        ),
    )

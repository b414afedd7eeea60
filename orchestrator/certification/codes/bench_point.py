"""One row of a code, run on the test bench. It can run in another process."""

import os
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from orchestrator.analysis.device_start import misfits_of
from orchestrator.arrays import Numbers
from orchestrator.cases.case import Case
from orchestrator.cases.schema import Value
from orchestrator.certification.codes.bench_case import BENCH
from orchestrator.errors import ComponentError, CosimError, ErrorKind
from orchestrator.points.failure import Failure, failure_kept
from orchestrator.points.task import Kept, Task, computed
from orchestrator.study.modes import running
from orchestrator.watch.watch import Watch


@dataclass
class BenchResult(Kept):
    row: str
    times: Numbers = field(default_factory=lambda: np.empty(0))
    signals: dict[str, Numbers] = field(default_factory=dict)  # by the bench's names, each of the shape of ``times``
    findings: list[dict[str, Any]] = field(default_factory=list)  # of the watch, in the form of `Finding.as_json`
    seconds: float = 0.0  # processor time of the run, that of FMUs in processes of their own included [s]
    failure: Failure | None = None

    keeps_failures = False


@dataclass(frozen=True)
class BenchTask(Task):
    record: ClassVar[Any] = BenchResult
    row: str
    changes: tuple[tuple[str, Value], ...] = ()  # values by ``component.variable`` that are others than the case file's

    def failed(self, failure: Failure) -> Any:
        return BenchResult(self.row, failure=failure)


def compute_row(task: BenchTask) -> BenchResult:
    return computed(task, row_result)


def row_result(task: BenchTask, case: Case) -> BenchResult:
    result, begin = BenchResult(task.row), _processor_time()
    with failure_kept(result):
        prepared = task.study.prepare(case, dict(task.changes))
        watch = Watch(prepared)
        ended: CosimError | None = None
        with running(prepared) as master:
            misfits = misfits_of(master)
            try:
                master.run(prepared.stop_time, prepared.events, watch.observers)
            except ComponentError as error:
                if error.kind is ErrorKind.HANG:
                    raise  # a machine that is too busy looks the same: no verdict, and nothing is kept
                ended = error  # the converter gave up, or its values were no numbers: the row is not met
        _keep(result, watch)
        result.findings = [finding.as_json() for finding in watch.findings(ended, misfits=misfits)]
        result.seconds = _processor_time() - begin
    return result


def _processor_time() -> float:
    """Of this process and of those that it has started and that have ended [s]."""
    return sum(os.times()[:4])


def _keep(result: BenchResult, watch: Watch) -> None:
    recorder = watch.recorder
    result.times = recorder.times.copy()
    named = zip(recorder.names, recorder.values.T.copy(), strict=True)
    result.signals = {name.removeprefix(f"{BENCH}."): values for name, values in named}

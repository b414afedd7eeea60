"""A row with one value of the converter changed, judged where it is computed. It can run in another process."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.cases.case import Case
from orchestrator.simulation.watch.finding import UNSTABLE
from orchestrator.studies.certification.codes.bench_point import BenchResult, BenchTask, row_result
from orchestrator.studies.certification.codes.known import KNOWN, code_for
from orchestrator.studies.certification.codes.row_verdict import RowVerdict, judge_row
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.task import Kept, computed

ENDED = "runs"  # criterion of a run that ends early; its value is the time of the end
_TIMED = ("stable", ENDED)  # criteria without a figure: the further off the earlier they go wrong


@dataclass(frozen=True)
class ChangedCriterion:
    criterion: str
    margin: float | None  # in parts of the limit; None where there is no figure
    accepted: bool
    text: str
    # whether it is a criterion without a figure of its own, and the margin is the time until the first fault in parts
    # of the run, less one.
    timed: bool = False


@dataclass
class ChangeResult(Kept):
    criteria: tuple[ChangedCriterion, ...] = ()
    mark: str = ""  # hash of the response: two responses with one mark agree to the last bit
    failure: Failure | None = None

    keeps_failures = False


@dataclass(frozen=True)
class ChangeTask(BenchTask):
    record = ChangeResult
    code: str = ""
    f_n: float = 0.0
    declared: tuple[tuple[str, float], ...] = ()

    def modules(self) -> tuple[str, ...]:
        """The code's table judges the point, and a plug-in may hold it."""
        return (*super().modules(), KNOWN.module_of(self.code))

    def failed(self, failure: Failure) -> Any:
        return ChangeResult(failure=failure)


def compute_change(task: ChangeTask) -> ChangeResult:
    return computed(task, _judge_change)


def _judge_change(task: ChangeTask, case: Case) -> ChangeResult:
    result = row_result(task, case)
    if result.failure is not None:
        return ChangeResult(failure=result.failure)
    row = next(row for row in code_for(task.code, dict(task.declared)).rows if row.name == task.row)
    verdict = judge_row(row, result, task.f_n)
    return ChangeResult(margins_with_time(verdict, result.findings, task.f_n), mark_of(result))


def margins_with_time(
    verdict: RowVerdict, findings: Sequence[Mapping[str, Any]], f_n: float
) -> tuple[ChangedCriterion, ...]:
    """The criteria of a row; one that has no figure, as a loss of synchronism, takes the time until the first fault."""
    stop = verdict.row.programme(f_n).stop
    faults = [float(f["time"]) for f in findings if f["kind"] in UNSTABLE]
    found = []
    for f in verdict.findings:
        if f.accepted is None:
            continue
        margin, timed = f.margin, f.margin is None and f.criterion in _TIMED
        times = [*faults, f.value or 0.0] if f.criterion == ENDED else faults
        if timed and not f.accepted and times:
            margin = min(times) / stop - 1
        found.append(ChangedCriterion(f.criterion, margin, f.accepted, f.text, timed))
    return tuple(found)


def mark_of(result: BenchResult) -> str:
    hasher = hashlib.sha256(np.ascontiguousarray(result.times).tobytes())
    for name in sorted(result.signals):
        hasher.update(name.encode() + b"\0" + np.ascontiguousarray(result.signals[name]).tobytes())
    return hasher.hexdigest()

"""A study of many points: what computes them, and what users get."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Concatenate, Generic, TypeVar

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport
from orchestrator.points.store import POINTS, PointStore

Plan = TypeVar("Plan")
Result = TypeVar("Result")
Shown = TypeVar("Shown")


@dataclass(frozen=True)
class PointStudy(Generic[Plan, Result, Shown]):
    """A study of many points, from its plan to what users get.

    Attributes
    ----------
    run
        Computes all points of a plan.
    shown
        What users get of its result.
    worker
        Module that a process of the study imports once, before its first point.
    prepared
        The scenarios of a plan.
    """

    run: Callable[Concatenate[Plan, Executor, PointStore, CountReport, ...], Result]
    shown: Callable[[Result], Shown]
    worker: str
    prepared: Callable[[Any], Sequence[PreparedScenario]] = lambda plan: [plan.prepared]

    def compute(
        self, planned: Plan, executor: Executor, folder: str | Path | None, report: CountReport, *more: Any
    ) -> Shown:
        """Compute a plan, and close the executor.

        Parameters
        ----------
        planned, executor
            What is computed, and where.
        folder
            Its subfolder ``points`` keeps the points; without a folder they are forgotten.
        report
            Called with how many points are done, of how many.
        more
            Further arguments of the study.
        """
        with TemporaryDirectory() as passing, closing(executor):
            return self.shown(self.run(planned, executor, PointStore(Path(folder or passing) / POINTS), report, *more))

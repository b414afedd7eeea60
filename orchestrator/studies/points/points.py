"""Many points of a study: those that are kept are read, the others computed, and kept as soon as they are there."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, TypeVar

from orchestrator.studies.points.executor import Executor
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.lost_workers import WorkerLostError
from orchestrator.studies.points.store import POINTS, PointStore
from orchestrator.studies.points.task import Task

CountReport = Callable[[int, int], None]  # callback: how many points are done, of how many

AnyTask = TypeVar("AnyTask", bound=Task)
Point = TypeVar("Point")


def nobody(done: int, total: int) -> None:
    """For a count that nobody wants."""


@dataclass
class Work:
    """Where the points of a study are computed, what keeps them, and whom it tells how far it is."""

    executor: Executor
    store: PointStore | None = None  # None keeps nothing
    report: CountReport = nobody
    # computed, stored: how many were computed now, and how many were read from an earlier start
    computed: int = 0
    stored: int = 0

    @classmethod
    def into(cls, folder: Path, executor: Executor, report: CountReport = nobody) -> Self:
        """Work whose points are kept in the folder of a study's results."""
        return cls(executor, PointStore(folder / POINTS), report)

    def each(
        self,
        compute: Callable[[AnyTask], Point],
        tasks: Sequence[AnyTask],
        sizes: Sequence[int] | None = None,
    ) -> Iterator[tuple[int, Point]]:
        """Yield, in any order, the index of each task and its record."""
        counts = sizes or [1] * len(tasks)
        total, missing = self.computed + self.stored + sum(counts), list[int]()
        for index, task in enumerate(tasks):
            found = None if self.store is None else self.store.load(task.key)
            point = task.record.restored(*found) if found else None
            if point is None:
                missing.append(index)
            else:
                self.stored += counts[index]
                yield index, point
        self.report(self.computed + self.stored, total)
        for number, outcome in self.executor.run(compute, [tasks[index] for index in missing]):
            task, index = tasks[missing[number]], missing[number]
            done: Any = (
                task.failed(Failure.lost(outcome))
                if isinstance(outcome, WorkerLostError)
                else outcome
            )
            if self.store is not None and done.lasting:
                self.store.save(task.key, *done.stored())
            self.computed += counts[index]
            self.report(self.computed + self.stored, total)
            yield index, done

    def all(
        self,
        compute: Callable[[AnyTask], Point],
        tasks: Sequence[AnyTask],
        sizes: Sequence[int] | None = None,
    ) -> list[Point]:
        found = dict(self.each(compute, tasks, sizes))
        return [found[index] for index in range(len(tasks))]

"""Base of all executors, and the one that computes one task after another, in this process."""

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from orchestrator.studies.points.lost_workers import Result, Task, WorkerLostError


class Executor(Protocol):
    def run(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | WorkerLostError]]:
        """Yield the index and the result of each task as soon as the result is there, in any order.

        An exception that ``function`` raises ends the run. A worker process that dies does not: its task is
        computed again, up to `lost_workers.ATTEMPTS` times, and then yields a `WorkerLostError`."""
        ...

    def close(self) -> None:
        """End the workers. Until then they serve several calls of `run`."""
        ...


class Serial:
    def run(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | WorkerLostError]]:
        for index, task in enumerate(tasks):
            yield index, function(task)

    def close(self) -> None:
        """See `Executor.close`."""

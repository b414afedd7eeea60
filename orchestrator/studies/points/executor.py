"""Base of all executors, and the one that computes one task after another, in this process."""

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeVar

from orchestrator.core.errors import CosimError

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 3  # A task that has lost its worker this many times is given up


class WorkerLostError(CosimError):
    """The process that computed a task died every time."""


class Executor(Protocol):
    def run(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | WorkerLostError]]:
        """Yield the index and the result of each task as soon as the result is there, in any order.

        An exception that ``function`` raises ends the run. A worker process that dies does not: its task is
        computed again, up to `ATTEMPTS` times, and then yields a `WorkerLostError`."""
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

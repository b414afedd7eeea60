"""One task after another, in this process."""

from collections.abc import Callable, Iterator, Sequence

from orchestrator.points.executor import Result, Task, WorkerLostError


class Serial:
    def run(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | WorkerLostError]]:
        for index, task in enumerate(tasks):
            yield index, function(task)

    def close(self) -> None:
        """See `Executor.close`."""

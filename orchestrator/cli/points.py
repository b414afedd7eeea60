"""Studies of many points: a bar while they are computed, and after Ctrl-C a word on how to continue."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport
from orchestrator.points.store import POINTS, any_kept
from orchestrator.report.progress import progress_bar

Result = TypeVar("Result")


class Progressing:
    """A study of many points, for whoever interrupts it.

    Parameters
    ----------
    folder
        Of the results, which keeps the points.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._done, self._total = folder, 0, 0

    def compute(self, study: Callable[[CountReport], Result], executor: Executor, console: Console) -> Result:
        """Run the study, and close its executor.

        Parameters
        ----------
        study
            Computes all points; it is given a callback for how many are done, of how many.
        executor
            Where the points are computed.
        console
            Shows the progress.
        """
        with progress_bar(console) as bar:
            task = bar.add_task("Points", total=None)

            def report(done: int, total: int) -> None:
                self._done, self._total = done, total
                bar.update(task, completed=done, total=total)

            try:
                return study(report)
            finally:
                executor.close()

    def how_it_goes_on(self) -> str:
        """What an interrupt leaves; "" where that is nothing."""
        if not any_kept(self._folder / POINTS) or (self._total and not self._done):
            return ""
        counted = f"{self._done} of {self._total} points" if self._total else "points"
        return f"{counted} are in {self._folder}; the same command continues from there"

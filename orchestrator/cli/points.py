"""Studies of many points: a bar while they are computed, and after Ctrl-C a word on how to continue."""

from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import TypeVar

from rich.console import Console

from orchestrator.cli.terminal import make_errors
from orchestrator.points.executor import Executor
from orchestrator.points.points import CountReport
from orchestrator.points.store import POINTS, any_kept
from orchestrator.report.progress import progress_bar

Result = TypeVar("Result")

EVERY = 10.0  # where there is no terminal to draw a bar on, a line says how far it is after so long [s]


class _Lines:
    """Says how far ``told`` (a study, and what it counts) is, at its begin and then every `EVERY` seconds."""

    def __init__(self, told: tuple[str, str] | None) -> None:
        self._told, self._next = told, 0.0

    def say(self, done: int, total: int) -> None:
        if self._told and done < total and monotonic() >= self._next:
            make_errors().print(f"{self._told[0]}: {done} of {total} {self._told[1]}", markup=False)
            self._next = monotonic() + EVERY


class Progressing:
    """A study of many points, for whoever interrupts it."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._done, self._total = folder, 0, 0

    def compute(
        self, study: Callable[[CountReport], Result], executor: Executor, console: Console,
        told: tuple[str, str] | None = None,
    ) -> Result:  # fmt: skip
        """Run the study, and close its executor; ``told`` is for lines on standard error where there is no terminal."""
        lines = _Lines(None if console.is_terminal or console.is_jupyter else told)
        with progress_bar(console) as bar:
            task = bar.add_task("Points", total=None)

            def report(done: int, total: int) -> None:
                self._done, self._total = done, total
                bar.update(task, completed=done, total=total)
                lines.say(done, total)

            try:
                return study(report)
            finally:
                executor.close()

    def how_it_goes_on(self) -> str:
        """How to go on after an interrupt; "" where nothing is kept."""
        if not any_kept(self._folder / POINTS) or (self._total and not self._done):
            return ""
        counted = f"{self._done} of {self._total} points" if self._total else "points"
        return f"{counted} are in {self._folder}; the same command continues from there"

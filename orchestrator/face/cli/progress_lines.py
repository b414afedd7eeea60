"""How far a long command is, as lines on standard error where there is no terminal to draw a bar on."""

from collections.abc import Callable
from contextlib import ExitStack
from threading import Event, Thread
from time import monotonic
from types import TracebackType
from typing import Self

from rich.console import Console

from orchestrator.face.cli.at_work import EVERY, LOOK, end_silence, in_words, silence, tell_instead
from orchestrator.face.cli.terminal import make_errors
from orchestrator.studies.points.under_way import doing, parts_done


class ProgressLines:
    """Says every `EVERY` seconds of a command how far it is; a short one says nothing.

    ``name``: of what is computed; ``counted``: what is counted, in words."""

    def __init__(self, name: str, counted: str, *, shown: bool) -> None:
        self._name, self._counted, self._shown = name, counted, shown
        self._done = self._total = 0
        self._stored: int | None = None  # what was there already when the first count came
        self._told = -1.0  # what the line before said is done
        self._began, self._ended = monotonic(), Event()
        self._tells = ExitStack()
        self._thread = Thread(target=self._say_now_and_then, daemon=True)

    def report(self, done: int, total: int) -> None:
        """Take a count, to be told at the next line."""
        if self._stored is None:
            self._stored = done
        self._done, self._total = done, total

    def __enter__(self) -> Self:
        if self._shown:
            self._tells.enter_context(tell_instead(self))
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ended.set()
        if self._shown:
            self._thread.join()
            self._tells.close()

    def line(self) -> str:
        """Return what is said now; while nothing is done since the line before, how long it takes is not guessed."""
        passed, (doing_now, part) = monotonic() - self._began, doing()
        if not self._total:
            which = f" {doing_now}" if doing_now else ""
            return f"{self._name}: preparing{which}, {in_words(passed)}"
        stored = self._stored or 0
        # of a task that is under way, some parts may be done; all are not before its record is there
        under_way = min(stored + parts_done(), self._total - 1)
        done = max(self._done, under_way)
        reached = done + part
        still, self._told = reached == self._told, reached
        at, what = "still at " if still else "", f" ({doing_now})" if doing_now else ""
        text = (
            f"{self._name}: {at}{done} of {self._total} {self._counted}{what}, {in_words(passed)}"
        )
        if still or reached <= stored:
            return text
        left = passed * (self._total - reached) / (reached - stored)
        return f"{text}, about {in_words(left)} left"

    def _say_now_and_then(self) -> None:
        # of several stages that are shorter than `EVERY` each, a line comes in its time all the same
        wait = max(EVERY - silence(), min(EVERY, LOOK))
        while not self._ended.wait(wait):
            wait = EVERY
            end_silence()
            make_errors().print(self.line(), markup=False)


def progress_lines(console: Console, name: str, counted: str) -> ProgressLines:
    """Lines where a console draws no bar."""
    return ProgressLines(name, counted, shown=not (console.is_terminal or console.is_jupyter))


def both(one: Callable[[int, int], None], other: Callable[[int, int], None]) -> Callable[..., None]:
    """Report a count to two."""

    def report(done: int, total: int) -> None:
        one(done, total)
        other(done, total)

    return report

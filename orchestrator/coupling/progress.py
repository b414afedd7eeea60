"""Progress of a run, for whatever shows it."""

from collections.abc import Callable

from orchestrator.coupling.observers import ObservedRun


class Progress:
    """Calls ``report(done, total)`` with communication steps every so often."""

    def __init__(self, report: Callable[[int, int], None], every: int = 2000) -> None:
        self.every = every
        self._report = report
        self._total = 0

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        self._total = stop_index

    def observe(self, run: ObservedRun) -> None:
        self._report(run.index, self._total)

    def end(self, run: ObservedRun) -> None:
        self._report(run.index, self._total)

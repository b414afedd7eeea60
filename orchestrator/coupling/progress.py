"""Progress of a run, for whatever shows it."""

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestrator.coupling.master import Master


class Progress:
    """Calls ``report(done, total)`` with communication steps every so often."""

    def __init__(self, report: Callable[[int, int], None], every: int = 2000) -> None:
        self.every = every
        self._report = report
        self._total = 0

    def begin(self, master: "Master", stop_index: int) -> None:
        self._total = stop_index

    def observe(self, master: "Master") -> None:
        self._report(master.index, self._total)

    def end(self, master: "Master") -> None:
        self._report(master.index, self._total)

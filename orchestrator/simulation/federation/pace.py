"""How long a run over HELICS will take, from its first second."""

from collections.abc import Callable
from time import perf_counter

from orchestrator.systems.coupling.observers import ObservedRun

_LOOK = 1.0  # after so long the pace is told [s]


class Pace:
    """An observer that tells the expected time of a run once, unless the run is over before."""

    every = 10

    def __init__(self, announce: Callable[[str], None]) -> None:
        self._announce: Callable[[str], None] | None = announce
        self._first = self._stop = 0
        self._start = 0.0

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        self._first, self._stop, self._start = run.index, stop_index, perf_counter()

    def observe(self, run: ObservedRun) -> None:
        spent, done = perf_counter() - self._start, run.index - self._first
        if self._announce is None or spent < _LOOK or not done:
            return
        rate = done / spent
        self._announce(
            f"{self._stop - self._first} steps over HELICS at {rate:.0f} steps/s, as its first second shows: about "
            f"{in_words((self._stop - run.index) / rate)} more"
        )
        self._announce = None

    def end(self, run: ObservedRun) -> None:
        """Nothing to do."""


def in_words(seconds: float) -> str:
    """A duration with a unit that suits it.

    Examples
    --------
    >>> in_words(143.2), in_words(5400)
    ('143 s', '90 min')
    """
    return f"{seconds:.0f} s" if seconds < 600 else f"{seconds / 60:.0f} min"

"""The stretches of a run between its events. An event without visible effect does not end a stretch."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.simulation.watch.seen import Seen

# an event is noticed if it bends a signal by this part of its range since the last noticed one
NOTICED = 0.01
_KINK_LOOKS = 4  # number of looks after an event that show its immediate effect
_USUAL_LOOKS = 20  # looks before an event that show the signal's own motion
_USUAL = 2.0  # a bend counts if it exceeds that motion by this factor

_ROUNDING = 1e-12  # rounding, as a part of 1 or of the signal


@dataclass(frozen=True)
class Stretch:
    """The time from one noticed event, or the start, to the next one, or the end [s]."""

    begin: float
    end: float
    breaks: tuple[float, ...] = ()  # times of unnoticed events inside the stretch [s]
    last: bool = False

    def parts(self) -> Iterator["Stretch"]:
        edges = (self.begin, *self.breaks, self.end)
        for begin, end in pairwise(edges):
            yield Stretch(begin, end, last=self.last and end == self.end)


def stretches(seen: Seen, signals: Mapping[str, Numbers], times: Sequence[float]) -> list[Stretch]:
    """The stretch after each noticed event.

    ``times``: of the events [s]."""
    if not times:
        return []
    found, begin, breaks = [], times[0], list[float]()
    for time in times[1:]:
        if _noticed(seen.times, signals, begin, time):
            found.append(Stretch(begin, time, tuple(breaks)))
            begin, breaks = time, []
        else:
            breaks.append(time)
    return [*found, Stretch(begin, float(seen.times[-1]), tuple(breaks), last=True)]


def _row(times: Numbers, time: float) -> int:
    """Index of the last look before an event. A look at the event's time shows the state before it."""
    return int(np.searchsorted(times, time * (1 + 1e-12), side="right")) - 1


def _noticed(times: Numbers, signals: Mapping[str, Numbers], begin: float, time: float) -> bool:
    first, row = _row(times, begin) + 1, _row(times, time)
    start = max(first, row - _USUAL_LOOKS)
    for signal in signals.values():
        bends = np.abs(np.diff(signal[start : row + _KINK_LOOKS + 1], 2))
        before = row - start - 1  # bends before the event
        if len(bends) <= max(before, 0):
            continue
        kink = bends[max(before, 0) :].max()
        usual = bends[:before].max() if before > 0 else 0.0
        size = np.ptp(signal[first : row + 1]) if row > first else 0.0
        if kink > _USUAL * usual + NOTICED * size + _ROUNDING * max(1.0, abs(float(signal[row]))):
            return True
    return False

"""A ring-down with a gap: of the stretches beside it, one is looked at, as a straight line rings with nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from orchestrator.studies.validation.filled import runs_of
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.windows import Windows

_BRIDGED = 0.06
"""Longest gap [s] that a straight line bridges in a ring-down: it moved the damping of a swing of 2 Hz by 0.4 points at
most, and 0.25 s in one of 1.2 Hz made 80 % of 5 %."""
_AS_LONG = 0.8  # part of the longest stretch's length, from which on one that swings more is taken


def without_gaps(recording: Recording, windows: Windows) -> Windows:
    """The windows with the longest stretch of the ring-down without a long gap, or a near one that swings more."""
    stretches = list(_stretches(recording, windows))
    if len(stretches) < 2:
        return windows
    longest = max(end - begin for begin, end in stretches)
    near = [one for one in stretches if one[1] - one[0] >= _AS_LONG * longest]
    begin, end = max(near, key=lambda one: _swings(recording, *one))
    last = end if end < windows.until else windows.second
    return replace(windows, end=begin, second=last)


def ask_of_gaps(recording: Recording, windows: Windows) -> Iterator[Question]:
    """Say which stretch of a ring-down with a gap is looked at."""
    used = without_gaps(recording, windows)
    if used != windows:
        begin, end = (recording.begin + one for one in (used.end, used.until))
        yield Question(QuestionKind.GAP_IN_RING_DOWN, {"begin": begin, "end": end})


def _stretches(recording: Recording, windows: Windows) -> Iterator[tuple[float, float]]:
    """The times between which no gap after the event is long [s]: those of the last sample before, and the next."""
    times, begin = recording.times, windows.end
    for low, high in runs_of(windows.part("after", times) & ~recording.good):
        if (high - low) * recording.interval > _BRIDGED + 0.5 * recording.interval:
            yield begin, float(times[low])
            begin = float(times[high - 1])
    yield begin, windows.until


def _swings(recording: Recording, begin: float, end: float) -> float:
    """The squares of how far the power is off its mean between two times, added up."""
    values = recording.power[(recording.times > begin) & (recording.times < end)]
    return float(np.sum(np.abs(values - values.mean()) ** 2)) if len(values) else 0.0

"""A channel that ends at its recorder's range: it comes to its largest value at full speed, and stays there."""

from __future__ import annotations

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.studies.validation.filled import runs_of

_FEWEST = 4  # samples in a row that are the largest, or the smallest
_SPEED = 20.0  # times the smallest change in the recording, by which it moves just before
_BEFORE = 3  # changes just before the first of them
_BESIDE = 50  # changes before and after it that are looked at
_STILL = 0.05  # part of these that may be none: more is a slow or coarse recorder


def clipped_run(values: Numbers) -> tuple[int, int] | None:
    """First sample of the longest run at an end of the range, and the one after its last; None where there is none.

    A signal at rest stands still as well, and one that comes to rest slows down before."""
    changes = np.diff(values)
    moves = np.abs(changes[changes != 0])
    if not len(moves):
        return None
    fast = _SPEED * float(moves.min())
    found = [
        (low, high)
        for end in (values.max(), values.min())
        for low, high in runs_of(values == end)
        if high - low >= _FEWEST and _comes_at_speed(values, low, high, fast)
    ]
    return max(found, key=lambda run: run[1] - run[0], default=None)


def _comes_at_speed(values: Numbers, low: int, high: int, fast: float) -> bool:
    """Return whether a signal that moves from sample to sample comes fast to a run of still ones.

    One with noise is cut in several runs beside each other: at the same end of the range it need not move."""
    changes, there = np.diff(values), values == values[low]
    before = np.abs(changes[max(0, low - 1 - _BEFORE) : max(0, low - 1)])
    still = (changes == 0) & ~there[1:]
    beside = np.concatenate([still[max(0, low - 1 - _BESIDE) : low], still[high:][:_BESIDE]])
    moves = float(np.mean(beside)) <= _STILL
    return moves and len(before) == _BEFORE and float(before.mean()) > fast

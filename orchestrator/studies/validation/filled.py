"""Samples that a recorder filled with the last value: they stand still while the signal lives before and after."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers

Mask = NDArray[np.bool_]

_FEWEST = 4  # repeated samples in a row
_BESIDE = 10  # samples before and after that have to move
_MOVING = 8  # so many of these
_ROUNDING = (
    1e-11  # of the largest value: what a simulation at rest moves by, and no recorder resolves
)
_BY_CHANCE = 0.01  # runs of a length that a coarse resolution may give in the whole recording


def filled_samples(columns: Sequence[Numbers]) -> Mask:
    """Return which samples repeat the one before in all columns together, between samples that move.

    A simulation at rest, and one that comes to rest, repeat samples as well: those do not move beside them by more than
    numbers are rounded. Of a coarse resolution a run has to be longer than chance makes it."""
    still = np.all([np.diff(values) == 0 for values in columns], axis=0)
    moving = np.any([moves_in(values) for values in columns], axis=0)
    found = np.zeros(len(still) + 1, dtype=bool)
    runs = list(runs_of(still))
    long = sum(high - low for low, high in runs if high - low >= _FEWEST)
    share = (int(still.sum()) - long) / max(len(still) - long, 1)
    for low, high in runs:
        before, after = moving[max(0, low - _BESIDE) : low], moving[high : high + _BESIDE]
        moves = min(int(before.sum()), int(after.sum())) >= _MOVING
        chance = len(still) * share ** (high - low)
        if high - low >= _FEWEST and moves and chance < _BY_CHANCE:
            found[low + 1 : high + 1] = True
    return found


def moves_in(values: Numbers) -> Mask:
    """Return which samples differ from the one before by more than numbers are rounded."""
    largest = np.nanmax(np.abs(values), initial=0.0)
    return np.asarray(~(np.abs(np.diff(values)) <= _ROUNDING * largest))


def runs_of(mask: Mask) -> Iterator[tuple[int, int]]:
    """First index of each run of true values, and the one after its last."""
    edges = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    yield from zip(
        map(int, np.flatnonzero(edges == 1)), map(int, np.flatnonzero(edges == -1)), strict=True
    )

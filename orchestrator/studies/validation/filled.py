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
_STEPS = 4.0  # of a channel's resolution, by which it goes on after samples that were held
_JUMPS = 1.5  # times the largest change beside a run of still samples, by which it ends in a jump
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


def held_alone(values: Numbers) -> Mask:
    """Return which samples of one channel repeat the one before, between samples that move.

    A coarse one repeats them where it turns, and goes on by one step of its resolution. One whose range ends repeats
    them at that end, and goes on from there as the plant does; one that held them jumps."""
    found = filled_samples([values])
    if not found.any():
        return found
    known = np.unique(values[np.isfinite(values)])
    apart = np.diff(known)
    resolution = float(apart[apart > _ROUNDING * np.abs(known).max()].min())
    for low, high in runs_of(found):
        goes_on = abs(values[high] - values[low])
        at_end = values[low] in (known[0], known[-1])
        is_coarse = goes_on < _STEPS * resolution
        if is_coarse or (at_end and not _jumps_after(values, low, high)):
            found[low:high] = False
    return found


def _jumps_after(values: Numbers, low: int, high: int) -> bool:
    """Return whether a channel leaves a run of still samples faster than it moves beside it."""
    changes = np.abs(np.diff(values))
    beside = np.concatenate(
        [changes[max(0, low - 1 - _BESIDE) : low - 1], changes[high:][:_BESIDE]]
    )
    return bool(changes[high - 1] > _JUMPS * np.nanmax(beside, initial=0.0))


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

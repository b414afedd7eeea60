"""A block of samples that a recorder stored twice: the same rows come again to the last digit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers, Vector
from orchestrator.studies.validation.filled import moves_in, runs_of

_FEWEST = 5  # rows of a block
_BESIDE = 100  # rows before and after a block from which its chance is told
_MOVING = 0.8  # part of a block's rows that differ from the row before
_BY_CHANCE = 1e-3  # blocks of a length that a coarse resolution may give in the whole recording
_OF_A_PERIOD = 0.02  # part of a period by which a wave in steady state comes again


@dataclass(frozen=True)
class StoredTwice:
    """Rows ``first`` to ``first + count - 1`` come again ``later`` rows later."""

    first: int
    count: int
    later: int


def stored_twice(columns: Sequence[Numbers], period: float = 0.0) -> StoredTwice | None:
    """The longest block of rows that comes again; None where there is none.

    A simulation at rest repeats rows that do not move. ``period``: of instantaneous values [samples], which come again
    after whole periods; 0 where there are none. Of a coarse resolution a block has to be longer than chance makes it,
    if rows were drawn one by one from those beside it."""
    rows = np.column_stack(columns)
    known = np.isfinite(rows).all(axis=1)
    kinds = np.unique(rows, axis=0, return_inverse=True)[1].ravel()
    later = _rows_since_the_same(kinds)
    moving = np.concatenate([[False], np.any([moves_in(one) for one in columns], axis=0)])
    found: StoredTwice | None = None
    for value in np.unique(later[later > 1]):
        if _is_whole_period(int(value), period):
            continue
        for low, high in runs_of((later == value) & known):
            count = high - low
            if count < _FEWEST or moving[low:high].mean() < _MOVING:
                continue
            beside = kinds[max(0, low - _BESIDE) : high + _BESIDE]
            chance = len(rows) * len(beside) * _share_alike(beside) ** (count - 1)
            if chance > _BY_CHANCE:
                continue
            if found is None or count > found.count:
                found = StoredTwice(low - int(value), count, int(value))
    return found


def _share_alike(kinds: Vector) -> float:
    """How likely two rows of a stretch are the same."""
    _, counts = np.unique(kinds, return_counts=True)
    return float(np.sum((counts / len(kinds)) ** 2))


def _rows_since_the_same(kinds: Vector) -> Vector:
    """For each row how many rows ago there was the same one; 0 where there was none."""
    order = np.argsort(kinds, kind="stable")
    again = np.concatenate([[False], np.diff(kinds[order]) == 0])
    since = np.concatenate([[0], np.diff(order)])
    found = np.zeros(len(kinds), dtype=int)
    found[order] = np.where(again, since, 0)
    return found


def _is_whole_period(rows: int, period: float) -> bool:
    if period <= 0:
        return False
    turns = rows / period
    return abs(turns - round(turns)) < _OF_A_PERIOD

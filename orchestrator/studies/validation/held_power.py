"""P, Q or a magnitude that a recorder stores every so often, or where it has changed, and holds in between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.studies.validation.filled import runs_of

_SHORTEST = 0.008
"""Of a hold [s]: the channel is late by half of it, and clocks that are 4 ms apart are asked about as well."""
_FEWEST_REPEATS = 3  # samples in a row that repeat the one before
_FEWEST_HOLDS = 5  # a plant whose setpoint is stepped by hand stands still less often
_HELD = 0.5  # part of the samples, between the first change and the last, that is held
_STEPS = 4.0  # of the resolution, by which it jumps after a hold: a coarse resolution makes one
_ROUNDING = 1e-11  # of the largest value: what a simulation at rest moves by


@dataclass(frozen=True)
class PowerHolds:
    """Holds of one channel: how many, and the time that the middle one and the longest last [s]."""

    count: int
    usual: float
    longest: float


def held_power(times: Numbers, values: Numbers) -> PowerHolds | None:
    """Holds of a channel over most of the time in which it moves; None where it is not held.

    One that rests before the event or after it is not held: the count goes from the first change to the last. With a
    coarse resolution a channel stands still as well, and then moves by one step of it."""
    changes = np.diff(values)
    rounding = _ROUNDING * float(np.abs(values).max(initial=0.0))
    changes[np.abs(changes) <= rounding] = 0.0
    moved = np.flatnonzero(changes)
    if len(moved) < _FEWEST_HOLDS:
        return None
    first, last = int(moved[0]), int(moved[-1])
    holds = [
        (low, high)
        for low, high in runs_of(changes[first : last + 1] == 0)
        if high - low >= _FEWEST_REPEATS and times[first + high] - times[first + low] >= _SHORTEST
    ]
    held = sum(high - low for low, high in holds)
    if len(holds) < _FEWEST_HOLDS or held < _HELD * (last - first):
        return None
    jumps = np.abs([changes[first + high] for _, high in holds])
    apart = np.diff(np.unique(values))
    if float(np.median(jumps)) < _STEPS * float(apart[apart > rounding].min()):
        return None
    lengths = [float(times[first + high] - times[first + low]) for low, high in holds]
    return PowerHolds(len(holds), float(np.median(lengths)), max(lengths))

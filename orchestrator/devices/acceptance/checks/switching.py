"""Comparison of runs that may differ only in the moments at which something switches.

A relay that is looked at once a step switches up to a step late, and a level that it controls turns around that much
later: of a signal with two values this makes a difference of its whole range, although nothing is wrong. So runs are
compared from switching to switching: the same values in the same order, each for as long, and all else alike there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers
from orchestrator.devices.acceptance.checks.comparing import scales

_LEVELS = 4  # A signal with more values than that does not switch
# difference of all else at the moments of switching, of its range, beyond what one step moves it
_ALIKE = 0.05
_DWELL = 0.1  # relative difference of the times between two switchings
_STEPS = 2.0  # how many of the longer steps a time between two switchings may differ by
# what was read after every step, from the start on, and the step [s]
Interval = tuple[Numbers, float]


def switches_elsewhere(
    names: Sequence[str], pairs: Sequence[tuple[Interval, Interval]]
) -> list[str]:
    """Names of signals that switch at other moments in runs that are otherwise alike; empty where more differs."""
    found: dict[str, None] = {}
    for first, second in pairs:
        relays = _elsewhere(first, second)
        if relays is None:
            return []
        found |= dict.fromkeys(names[column] for column in relays)
    return list(found)


def _elsewhere(first: Interval, second: Interval) -> list[int] | None:
    """Places of the signals that switch at other moments; None where more than moments differs."""
    (a, h), (b, other_h) = first, second
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        return None
    relays = [k for k in range(a.shape[1]) if _switches(a[:, k], b[:, k])]
    others = [k for k in range(a.shape[1]) if k not in relays]
    moving = [k for k in others if np.ptp(a[:, k]) > 1e-6 * np.abs(a[:, k]).max(initial=1e-9)]
    if not relays or not moving:  # a relay alone tells nothing of how right it is
        return None
    ranges = scales(a, b)
    for relay in relays:
        moments = _moments(a[:, relay], h, b[:, relay], other_h)
        if moments is None or not all(_alike(a[:, k], b[:, k], moments, ranges[k]) for k in others):
            return None
    return relays


def _switches(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Return whether a signal has few values, the same in both runs, and changes among them."""
    values = np.unique(a)
    return 2 <= len(values) <= _LEVELS and np.array_equal(values, np.unique(b))


def _moments(
    a: NDArray[np.float64], h: float, b: NDArray[np.float64], other_h: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Steps in which both switch, one to one; None unless to the same values in the same order, each for as long."""
    first, second = (np.flatnonzero(np.diff(signal)) + 1 for signal in (a, b))
    count = min(len(first), len(second))
    if count < 2 or abs(len(first) - len(second)) > max(1.0, _DWELL * len(first)):
        return None
    first, second = first[:count], second[:count]
    if not (np.array_equal(a[first], b[second]) and a[0] == b[0]):
        return None
    lasting, other = h * np.diff(first, prepend=0), other_h * np.diff(second, prepend=0)
    alike = np.abs(lasting - other) <= np.maximum(_DWELL * lasting, _STEPS * max(h, other_h))
    return (first, second) if alike.all() else None


def _alike(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    moments: tuple[NDArray[np.intp], NDArray[np.intp]],
    size: float,
) -> bool:
    """Return whether a signal is the same at the moments of switching, as far as these may be a step late."""
    first, second = moments
    late = np.abs(a[first] - a[first - 1]) + np.abs(b[second] - b[second - 1])
    return bool((np.abs(a[first] - b[second]) <= _ALIKE * size + late).all())

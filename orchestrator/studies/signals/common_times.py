"""Times at which two recordings with intervals of their own can be compared."""

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers, Vector
from orchestrator.core.errors import InputError

# times that differ by less than this part of the shorter interval are one time, rounded in two ways
_NOISE = 1e-6


def median_interval(times: Numbers) -> float:
    """Return the median time between two samples [s]; 0 of fewer than two."""
    return float(np.median(np.diff(times))) if len(times) > 1 else 0.0


@dataclass(frozen=True)
class CommonTimes:
    """Times of the run with the longer interval, within the time that both runs have."""

    times: Numbers  # shape (n,) [s]
    remark: str  # sentence on runs with different intervals; empty where both have the same times
    _rows: tuple[Vector | None, Vector | None]
    _recorded: tuple[Numbers, Numbers]

    def values(self, run: int, signal: Numbers) -> Numbers:
        rows = self._rows[run]
        found = (
            signal[rows] if rows is not None else np.interp(self.times, self._recorded[run], signal)
        )
        return np.asarray(found, dtype=float)


def common_times(a: Numbers, b: Numbers, labels: tuple[str, str]) -> CommonTimes:
    """Times at which two runs are compared: those of the run with the longer interval.

    The other run's values are those that it recorded at these times. Where it lacks one of these times, its values are
    interpolated: between two times of the shorter interval, and never between two of the longer one."""
    both = (np.asarray(a, dtype=float), np.asarray(b, dtype=float))
    noise = _NOISE * min(map(median_interval, both))
    begin, end = max(t[0] for t in both) - noise, min(t[-1] for t in both) + noise
    inside = [np.flatnonzero((t >= begin) & (t <= end)) for t in both]
    coarse = 0 if len(inside[0]) <= len(inside[1]) else 1
    fine = 1 - coarse
    times = both[coarse][inside[coarse]]
    if len(times) < 2:
        raise InputError(
            f"{labels[0]} and {labels[1]} have no time in common; nothing can be compared"
        )
    at = np.searchsorted(both[fine], times - noise)
    met = bool(np.all(np.abs(both[fine][np.minimum(at, len(both[fine]) - 1)] - times) <= noise))
    rows: list[Vector | None] = [inside[coarse], at if met else None]
    order = (rows[0], rows[1]) if coarse == 0 else (rows[1], rows[0])
    same = met and len(inside[0]) == len(inside[1])
    remark = "" if same else _remark(both, coarse, len(times), labels, met=met)
    return CommonTimes(times, remark, order, both)


def _remark(
    both: tuple[Numbers, Numbers], coarse: int, count: int, labels: tuple[str, str], *, met: bool
) -> str:
    intervals = [f"{median_interval(times):.6g} s" for times in both]
    head = f"{labels[0]} is recorded every {intervals[0]}, {labels[1]} every {intervals[1]}"
    if met:
        return f"{head}: they are compared at the {count} times that both have."
    return (
        f"{head}, and they do not have all times in common: they are compared at the {count} times of "
        f"{labels[coarse]}, between the records of {labels[1 - coarse]} where it has none. A fast motion "
        "differs a little by that alone."
    )

"""The mean over a period, which is what a phasor measurement gives.

An instantaneous model rings at the rated frequency with whatever the voltage did between two samples; the mean over a
period does not hold that, nor the swing of an unbalanced voltage at twice the frequency."""

import numpy as np

from orchestrator.core.arrays import Complex, Numbers


def averaged(
    times: Numbers, values: Complex, length: float, at: Numbers, ahead: float = 0.0
) -> Complex:
    """Mean of values along straight lines over ``length`` [s] up to ``ahead`` [s] after some times.

    At both ends of the signal it is over what there is."""
    if length <= 0:
        found: Complex = np.interp(at, times, values)
        return found
    steps = np.diff(times)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * steps)])
    low = np.clip(at + ahead - length, times[0], times[-2])
    high = np.clip(at + ahead, times[1], times[-1])
    whole = _integral(times, values, area, high) - _integral(times, values, area, low)
    return np.asarray(whole / (high - low))


def _integral(times: Numbers, values: Complex, area: Complex, at: Numbers) -> Complex:
    """From the first time to some others, exact for straight lines."""
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    part = at - times[k]
    slope = (values[k + 1] - values[k]) / (times[k + 1] - times[k])
    return np.asarray(area[k] + part * (values[k] + 0.5 * slope * part))

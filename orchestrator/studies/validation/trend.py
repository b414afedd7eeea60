"""How far P and Q move in a part of a recording, without what changes from sample to sample."""

from __future__ import annotations

import numpy as np

from orchestrator.core.arrays import Complex

PARTS_OF_TREND = 10
"""Parts of a time, of each of which a mean is taken."""


def trend_of(power: Complex) -> float:
    """Return the range of P's or Q's means, the larger one [pu of the rating]; 0 of fewer than two samples."""
    if len(power) < 2:
        return 0.0
    width = max(1, len(power) // PARTS_OF_TREND)
    means = power[: len(power) // width * width].reshape(-1, width).mean(axis=1)
    return float(max(np.ptp(means.real), np.ptp(means.imag)))

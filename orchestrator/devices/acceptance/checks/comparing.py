"""How far two runs lie apart, relative to how far their outputs move."""

import numpy as np

from orchestrator.core.arrays import Numbers


def scales(*trajectories: Numbers) -> Numbers:
    """For each output how far it moves in all runs together; its size where it hardly moves."""
    values = np.concatenate(trajectories)
    finite = np.where(np.isfinite(values), values, 0.0)
    size = np.abs(finite).max(axis=0)
    moved: Numbers = np.maximum(np.ptp(finite, axis=0), np.maximum(1e-6 * size, 1e-9))
    return moved


def difference(a: Numbers, b: Numbers) -> tuple[float, int]:
    """Largest difference of two runs relative to how far the outputs move, and the output's place."""
    if not a.size:
        return 0.0, 0
    apart = np.abs(a - b) / scales(a, b)
    apart = np.where(np.isnan(a) & np.isnan(b), 0.0, np.where(np.isfinite(apart), apart, np.inf))
    place = np.unravel_index(int(np.argmax(apart)), apart.shape)
    return float(apart[place]), int(place[1])

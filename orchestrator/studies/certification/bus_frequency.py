"""The frequency of a bus, from its voltage."""

import numpy as np

from orchestrator.core.arrays import Numbers


def bus_frequency(times: Numbers, v_re: Numbers, v_im: Numbers, f_n: float) -> Numbers:
    """Frequency of a voltage [Hz]: its angle's turn over one period of the grid, around each of even instants.

    Over a whole period the 50 Hz component of an electromagnetic transient drops out."""
    angle = np.unwrap(np.angle(v_re + 1j * v_im))
    half = max(1, round(0.5 / f_n / (times[1] - times[0])))
    last = len(times) - 1
    here = np.arange(len(times))
    before, after = np.maximum(here - half, 0), np.minimum(here + half, last)
    return np.asarray(
        f_n + (angle[after] - angle[before]) / (times[after] - times[before]) / (2 * np.pi)
    )

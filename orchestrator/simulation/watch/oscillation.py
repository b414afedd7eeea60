"""The strongest oscillation in a stretch of a signal: frequency, growth rate and amplitude."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.signals.identification import identify_modes

LEAST_PERIODS = 2  # number of periods that an oscillation needs to be recognised
# A signal is thinned to show frequencies up to this one [Hz], unless it turns more often
_HIGHEST_HZ = 10.0
_PER_PERIOD = 5  # least number of samples in a period of an oscillation that can be recognised


# A long stretch of a fast oscillation is judged by this number of samples at its end
_MOST_SAMPLES = 600
_ENOUGH_SAMPLES = 300  # samples to which a slow oscillation is thinned
_BEYOND = 3  # frequencies up to this number times its own are kept all the same


@dataclass(frozen=True)
class Oscillation:
    """A·e^{rate·t}·cos(2π·frequency·t): rate [1/s], frequency [Hz], amplitude at the stretch's end [signal's unit]."""

    frequency_hz: float
    rate: float
    amplitude: float


def strongest_oscillation(
    times: Numbers, signal: Numbers, least_periods: float = LEAST_PERIODS
) -> Oscillation | None:
    """Find the strongest oscillation by the matrix pencil; None if no oscillation lasts `LEAST_PERIODS`, or if it is
    too fast for the samples."""
    if too_fast(times, signal):
        return None
    crossing = crossings_hz(times, signal)
    enough = round(
        _MOST_SAMPLES / (_PER_PERIOD * max(crossing, _HIGHEST_HZ / 2) * float(times[1] - times[0]))
    )
    times, signal = times[-enough:], signal[-enough:]
    length = float(times[-1] - times[0])
    highest = max(
        min(_HIGHEST_HZ, max(_ENOUGH_SAMPLES / (10 * length), _BEYOND * crossing)), 1.2 * crossing
    )
    try:
        found = identify_modes(times, signal - signal.mean(), highest_hz=highest)
    except AnalysisError:
        return None
    all_modes = (  # an oscillation is a pair of exponentials
        Oscillation(
            m.frequency_hz,
            m.eigenvalue.real,
            2 * m.amplitude * float(np.exp(m.eigenvalue.real * length)),
        )
        for m in found
    )
    oscillating = [m for m in all_modes if m.frequency_hz * length >= least_periods]
    return max(oscillating, key=lambda m: m.amplitude, default=None)


def crossings_hz(times: Numbers, signal: Numbers) -> float:
    """Half of the rate at which a signal crosses its own trend [Hz]."""
    around = without_trend(signal)
    passes = int((np.diff(np.sign(around)) != 0).sum())
    return passes / 2 / float(times[-1] - times[0])


def too_fast(times: Numbers, signal: Numbers) -> bool:
    return crossings_hz(times, signal) * float(times[1] - times[0]) * _PER_PERIOD > 1


def without_trend(signal: Numbers) -> Numbers:
    """The signal minus a fitted cubic, along the first axis."""
    basis = _cubics(len(signal))
    rest: Numbers = signal - basis @ (basis.T @ signal)
    return rest


@lru_cache(maxsize=64)
def _cubics(count: int) -> Numbers:
    basis: Numbers = np.linalg.qr(
        np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, count), 3)
    )[0]
    return basis

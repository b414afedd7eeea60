"""Modes seen in a recorded signal: the matrix pencil method.

Hua and Sarkar, "Matrix pencil method for estimating parameters of exponentially damped/undamped
sinusoids in noise", IEEE Trans. ASSP 38(5), 1990."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.spectra.modes import OfEigenvalue

TOLERANCE = 1e-6  # singular values below this fraction of the largest are taken for noise
MOST_EXPONENTIALS = 24  # more of them are noise, in any signal of a grid
_MIN_SAMPLES = 20  # fewer hold no swing with its damping
_LEAST_MULTIPLIER = 1e-6  # of a mode from sample to sample; a smaller one is gone within one sample
_MAX_SAMPLES = 1200  # more are thinned out: the singular values of their Hankel matrix take seconds
# rows of the triangle below this part of the tolerance change modes by its square, and most are
_DROPPED = 1e-3
# part of a signal's power that is too fast for the samples used, from which on they are averages
_ALIASED = 1e-6
_LARGEST_EXPONENT = 300.0
"""Largest exponent of e within the window. A larger exponent is not a signal, and its square exceeds the range of
numbers."""


@dataclass(frozen=True, slots=True)
class IdentifiedMode(OfEigenvalue):
    """One component A·e^{λt} of a signal: λ [rad/s], and |A| at the window's start [unit of the signal]."""

    eigenvalue: complex
    amplitude: float
    # why it may be no mode of the system, where that was asked; see `mode_doubts`
    doubts: tuple[str, ...] = ()


def identify_modes(
    times: NDArray[np.float64],
    signal: NDArray[np.float64],
    *,
    tolerance: float = TOLERANCE,
    order: int | None = None,
    max_order: int = MOST_EXPONENTIALS,
    highest_hz: float = 10.0,
) -> list[IdentifiedMode]:
    """Write a signal as a sum of damped exponentials.

    ``times`` and ``signal``: shape (n,); equally spaced samples of a free response, [s] and any unit.
    ``tolerance``: singular values below this fraction of the largest are taken for noise.
    ``order``: number of exponentials, where it is not to be found from the tolerance.
    ``highest_hz``: the signal is thinned to ten samples per period of this frequency."""
    used = sampling(times, highest_hz)
    thin, interval = used.thin, used.interval
    weights = averaging(signal, thin)
    y = signal[::thin] if len(weights) == 1 else np.convolve(signal, weights, mode="valid")[::thin]
    lags = np.arange(len(weights)) * used.recorded
    if len(y) < _MIN_SAMPLES or np.ptp(y) == 0:
        what = (
            "a constant signal" if len(y) >= _MIN_SAMPLES else f"a signal of {len(signal)} samples"
        )
        raise AnalysisError(
            f"no mode can be identified in {what}; record a longer response to an event"
        )
    pencil = len(y) // 3
    hankel = np.lib.stride_tricks.sliding_window_view(y, pencil + 1)
    triangle, columns = scipy.linalg.qr(np.linalg.qr(hankel, mode="r"), mode="r", pivoting=True)
    size = np.abs(np.diagonal(triangle))
    kept = triangle[: max(1, np.count_nonzero(size > _DROPPED * tolerance * size[0]))]
    _, singular, right = np.linalg.svd(kept[:, np.argsort(columns)], full_matrices=False)
    seen = int((singular > tolerance * singular[0]).sum())
    basis = right[: min(seen if order is None else order, max_order)].T
    multipliers = np.linalg.eigvals(np.linalg.pinv(basis[:-1]) @ basis[1:])
    if len(y) * np.log(np.abs(multipliers).max(initial=1.0)) > _LARGEST_EXPONENT:
        raise AnalysisError(
            "no mode can be identified: the signal seems to grow beyond all bounds within the window"
        )
    vandermonde = multipliers[None, :] ** np.arange(len(y))[:, None]
    residues = np.linalg.lstsq(vandermonde, y.astype(complex), rcond=None)[0]
    found = [
        (complex(np.log(complex(mu)) / interval), abs(r))  # also of a real one below zero
        for mu, r in zip(multipliers, residues, strict=True)
        if mu.imag >= 0 and abs(mu) > _LEAST_MULTIPLIER
    ]
    modes = [
        IdentifiedMode(x, float(size / abs((weights * np.exp(x * lags)).sum())))
        for x, size in found
    ]
    return sorted(modes, key=lambda m: -m.amplitude)


def averaging(signal: NDArray[np.float64], thin: int) -> NDArray[np.float64]:
    """Return the weights with which samples are averaged before every ``thin``-th is used.

    A signal in which nothing is too fast for the samples used needs no average: its one weight is 1. An average
    over equal times leaves the eigenvalues of a free response as they are."""
    if thin <= 1 or len(signal) <= 4 * thin + 1:
        return np.ones(1)
    power = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal)))) ** 2
    if power[len(signal) // (2 * thin) :].sum() <= _ALIASED * power.sum():
        return np.ones(1)
    weights = np.hanning(4 * thin + 3)[1:-1]
    return np.asarray(weights / weights.sum())


@dataclass(frozen=True, slots=True)
class Sampling:
    """The samples that `identify_modes` uses of a record."""

    recorded: float  # time between two samples of the record [s]
    thin: int  # every so many of them are used
    number: int
    # time between two samples from which on they are thinned, however short the record [s]
    finest: float

    @property
    def interval(self) -> float:
        """Time between the samples used [s]; oscillations faster than half of its inverse are aliased."""
        return self.recorded * self.thin

    @property
    def remedy(self) -> str:
        shorter = f"identify a shorter part of the record (start, stop), as at most {_MAX_SAMPLES} samples are used"
        if self.thin == 1 and self.recorded > 1.5 * self.finest:
            more = "record more often (solver.record_interval)"
            return f"{more}, and {shorter}" if 2 * self.number > _MAX_SAMPLES else more
        if self.thin > round(self.finest / self.recorded):
            return f"{shorter}, and the record has one every {self.recorded:g} s"
        return (
            f"look at the record itself, which has a sample every {self.recorded:g} s: its modes are looked for in "
            f"samples every {self.finest:g} s, or longer ones, however often it is recorded"
        )


def sampling(times: NDArray[np.float64], highest_hz: float = 10.0) -> Sampling:
    """Return which samples of a record are used: ten for a period of ``highest_hz``, or fewer in a long record."""
    step = float(times[1] - times[0]) if len(times) > 1 else 0.0
    finest = 1 / (10 * highest_hz)
    thin = (
        max(1, round(1 / (10 * highest_hz * step)), -(-len(times) // _MAX_SAMPLES))
        if step > 0
        else 1
    )
    return Sampling(step, thin, len(times), finest)


def nearest(modes: list[IdentifiedMode], eigenvalue: complex) -> IdentifiedMode | None:
    """Return the mode whose eigenvalue is nearest to another [rad/s]; None where there is no mode."""
    return min(modes, key=lambda m: abs(m.eigenvalue - eigenvalue), default=None)

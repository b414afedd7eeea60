"""When an oscillation begins, with the interval that holds the truth.

Beside a mode of the system a forced oscillation builds up slowly: its envelope reaches half of its level many seconds
after its begin. So the envelope's own law is fitted: from the begin on a + b·exp(−κ·t), a steady oscillation and the
mode's answer that dies away beside it, with κ = σ − jδ, the mode's decay and its distance in frequency. The begin, κ, a
and b are those that explain the envelope best, and the interval holds all begins that explain it about as well."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers

_DECAYS = np.geomspace(0.04, 6.0, 11)  # σ [1/s]
_APART = np.linspace(
    -0.3, 0.3, 13
)  # δ, as a part of the oscillation's frequency [1]; at most half a swing's neighbours
_STEPS = 8  # places a period at which a begin is tried
_INDEPENDENT = 0.5  # of a window's length, after which an envelope's noise is another one
_MORE = 6.0
"""Growth of what is left over, by independent sample, up to which a begin explains the envelope about as well. It is
chosen by `python -m tests.benchmarks.begins`: 3.84 would be that of a smooth fit to white noise; a begin is a corner,
and the noise of loads is not white beside a mode."""

_LEAST = 0.5  # half of the narrowest interval [periods]


Places = NDArray[np.int64]


@dataclass(frozen=True)
class Onset:
    """Best begin and the interval that holds it in 95 % of records [s]."""

    at: float
    earliest: float
    latest: float


def onset_of(times: Numbers, envelope: Numbers, half: int, frequency: float) -> Onset:
    """The begin of an oscillation in a record.

    ``times``: of the record's samples [s], shape (n,).
    ``envelope``: complex amplitude from a window of ``2·half + 1`` samples, shape (n − 2·half,).
    """
    step = float(times[1] - times[0])
    stride = max(1, round(1 / (_STEPS * frequency * step)))
    z = envelope[::stride]
    begins = np.arange(0, len(envelope) + 2 * half - stride, stride)  # samples of the record
    window = np.hanning(2 * half + 3)[1:-1]
    window = window / window.sum()
    moves = np.arange(1 - len(begins), len(z)) * stride  # of a window behind a begin
    left = np.full(len(begins), np.inf)
    steady = _seen(np.ones(len(times)), window, moves)
    for sigma in _DECAYS:
        for delta in _APART * 2 * np.pi * frequency:
            dying = np.exp((-sigma + 1j * delta) * step * np.arange(len(times)))
            left = np.minimum(left, _left_over(z, steady, _seen(dying, window, moves)))
    best = int(np.argmin(left))
    samples = len(envelope) / (_INDEPENDENT * len(window))
    # running sums of an envelope that a law explains wholly may leave less than nothing
    least = max(left[best], np.finfo(float).eps * np.vdot(z, z).real)
    good = np.flatnonzero(left <= least * (1 + _MORE / samples))
    margin = _LEAST / frequency
    found = float(times[0]) + step * begins
    return Onset(
        float(found[best]), float(found[good[0]] - margin), float(found[good[-1]] + margin)
    )


def _seen(law: Numbers, window: Numbers, moves: Places) -> Numbers:
    """A law as the window sees it that stands so many samples behind the law's begin, shape (moves,)."""
    length = len(window)
    # seen[k]: the window's first sample stands k − length behind the begin
    seen = np.convolve(np.concatenate([np.zeros(length), law]), window, mode="valid")
    return np.where(moves >= -length, seen[np.maximum(moves + length, 0)], 0.0)


def _left_over(z: Numbers, one: Numbers, other: Numbers) -> Numbers:
    """Squares that two laws leave over of ``z``, shape (begins,), the first begin first.

    A later begin moves a law along the samples, so that all products are those of one row: running sums and a
    correlation."""
    p, q = (_running(np.abs(law) ** 2, len(z)) for law in (one, other))
    r = _running(one.conj() * other, len(z))
    x, y = (np.correlate(law, z, mode="valid")[::-1].conj() for law in (one, other))
    determinant = p * q - np.abs(r) ** 2
    alone = np.abs(x) ** 2 / np.maximum(p, 1e-12)
    both = (q * np.abs(x) ** 2 + p * np.abs(y) ** 2 - 2 * (x.conj() * r * y).real) / np.where(
        determinant > 1e-6 * p * q, determinant, np.inf
    )
    return np.asarray((np.abs(z) ** 2).sum() - np.maximum(alone, both))


def _running(values: Numbers, length: int) -> Numbers:
    """Sums of so many values in a row, the last row first."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray((sums[length:] - sums[:-length])[::-1])

"""Confirmation by the whole response of an oscillation that does not decay at its end.

Over a few periods two decaying oscillations that beat, or the harmonics that a large swing has in magnitudes of
voltages and currents, look like one that grows. An eigenvalue belongs to the system: a true growth has one rate in
every part of the response, while that of a beat changes from part to part."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.simulation.watch.oscillation import (
    Oscillation,
    strongest_oscillation,
    without_trend,
)

KEPT = 0.7  # A swing is decaying if its last third is smaller than this part of its middle third


@dataclass(frozen=True)
class KnownModes:
    """Eigenvalues of the linear model at the start [rad/s], and whether it is that of the stretch as well."""

    modes: Sequence[complex] = ()
    holds: bool = False

    def rate(self, hertz: float) -> float | None:
        """Largest real part [1/s] at a frequency or, as magnitudes show it, at half of it; None without modes there."""
        sizes = [(z.real, z.imag / (2 * np.pi * hertz)) for z in self.modes]
        return max(
            (rate for rate, part in sizes if min(abs(part - 1), abs(2 * part - 1)) < SAME),
            default=None,
        )


@dataclass(frozen=True)
class Swing:
    name: str
    size: float  # root mean square in the last third without the trend, relative to ``scale``
    scale: float  # 1 or the start's magnitude [the signal's unit]
    response: tuple[Numbers, Numbers]  # times [s] since the event, and the signal at them
    # times, signal: the same in the last three quarters
    times: Numbers
    signal: Numbers
    # half of the rate at which the signal turns [Hz], counted at every communication step; only for signals that were
    # followed between the looks
    turns_hz: float | None = None
    known: KnownModes = KnownModes()

    def is_explained(self, hertz: float) -> bool:
        """Return whether modes that the model knows to decay make a fast swing that does not grow far."""
        first, *_, last = (float(part.mean()) for part in np.array_split(self.signal, 3))
        swing_still = (
            self.turns_hz is not None
            and self.known.holds
            and self.times[-1] < self.decay_end(hertz)
        )
        return swing_still and last < _FAR * first

    def decay_end(self, hertz: float) -> float:
        """Time from which on nothing is left of modes that decay at a frequency [s]; 0 if there are none."""
        rate = self.known.rate(hertz)
        return float(self.response[0][0]) + _GONE / -rate if rate is not None and rate < 0 else 0.0


# the logarithm of a sustained oscillation's amplitude changes less over the judged part
STEADY = 0.05

PERIODS = 4.5
"""Number of periods that the response must have of an oscillation that grows or lasts. With fewer it cannot be told
from a beat with a mode of a similar frequency: of eleven faults on nine buses, each watched until 50 different times,
those that seemed to grow in every part of the response had 4 at most."""

# largest relative difference of frequency between the judged part and the whole response
SAME = 0.05
AGREE = 2.0  # largest factor between the growth rates of the judged part and of the whole response
_GONE = 3.0  # time constants of a mode until it is gone
_FAR = 2.0  # factor by which a beat may grow between thirds
_GROWN = 0.7  # least growth of a true swing over fifths, as a logarithm
_EVEN = 1.3  # its mean growth by its least, at most: a beat bends more

# a swing of any shape grows if it rises by this factor from the first to the last quarter
FAR_ABOVE = 10.0
RISING = 1.3  # and at least by this factor from each quarter to the next


_PIECES = 8  # pieces of the judged part whose sizes tell whether a swing of any shape decays
# standard errors that the slope of their logarithms is from 0, at least, if it decays
_CERTAIN = 3.0


def change(swing: Swing, rate: float) -> float:
    """Change of the logarithm of an amplitude over the judged part, for a growth rate [1/s]."""
    return rate * float(swing.times[-1] - swing.times[0])


def rms(signal: Numbers) -> float:
    """Root mean square of a signal around its trend."""
    return float(np.sqrt(np.mean(without_trend(signal) ** 2)))


def rises(signal: Numbers, *, extents: bool = False) -> bool:
    sizes = [float(part.mean()) if extents else rms(part) for part in np.array_split(signal, 4)]
    return sizes[3] > FAR_ABOVE * sizes[0] and all(
        late > RISING * early for early, late in pairwise(sizes)
    )


def doubt(swing: Swing, oscillation: Oscillation) -> str:
    """Why an oscillation that seems to grow, or to last, may decay; empty where the whole response confirms it."""
    grows = change(swing, oscillation.rate) > STEADY
    if swing.turns_hz is not None:
        return _fast_doubt(swing, oscillation.frequency_hz, grows=grows)
    times, signal = (part[1:] for part in swing.response)  # the first look is that before the event
    if grows and rises(signal):
        return ""
    periods = float(times[-1] - times[0]) * oscillation.frequency_hz
    if periods < PERIODS:
        return f"{periods:.2g} periods cannot tell that from a beat of oscillations that decay"
    whole = strongest_oscillation(times, signal)
    if not grows:
        falls = (
            whole is not None
            and _same(whole, oscillation)
            and change(swing, whole.rate) < -2 * STEADY
        )
        return (
            f"over the whole response it decays at {whole.rate:+.3g} 1/s"
            if falls and whole is not None
            else ""
        )
    if whole is None or not _same(whole, oscillation):
        return "the whole response does not show that oscillation as the strongest"
    if not oscillation.rate / AGREE < whole.rate < AGREE * oscillation.rate:
        return f"over the whole response its rate is {whole.rate:+.3g} 1/s"
    halves = (np.array_split(swing.times, 2), np.array_split(swing.signal, 2))
    parts = [strongest_oscillation(t, y, least_periods=1) for t, y in zip(*halves, strict=True)]
    if any(part is not None and part.rate < 0 for part in parts):
        return "in one half of its end it decays"
    return ""


def _fast_doubt(swing: Swing, hertz: float, *, grows: bool) -> str:
    first, *_, last = (float(part.mean()) for part in np.array_split(swing.signal, 3))
    if last <= (1.0 if grows else KEPT) * first:
        return "it was larger before"
    if (swing.known.rate(hertz) or 0.0) > 0 or (
        not grows and swing.times[-1] >= swing.decay_end(hertz)
    ):
        return ""
    sizes = np.array([np.median(part) for part in np.array_split(swing.response[1][1:], 5)])
    rates = np.diff(np.log(sizes)) if (sizes > 0).all() else np.zeros(1)
    if grows and (
        rises(swing.signal, extents=True) or _GROWN < rates.sum() < 4 * _EVEN * rates.min()
    ):
        return ""
    tells = swing.known.holds and swing.known.rate(hertz) is not None
    return f"modes that decay may beat like that{'' if tells else ' (no model tells, as none holds here)'}"


def irregular_doubt(swing: Swing) -> str:
    """Why a swing of any shape, which seems to last, may decay; empty where its sizes do not fall."""
    sizes = np.array([rms(piece) for piece in np.array_split(swing.signal, _PIECES)])
    if not (sizes > 0).all():
        return ""
    at = (np.arange(_PIECES) + 0.5) / _PIECES
    (slope, _), covariance = np.polyfit(at, np.log(sizes), 1, cov=True)
    late = float(np.polyfit(at[_PIECES // 2 :], np.log(sizes[_PIECES // 2 :]), 1)[0])
    if late < 0 and slope < -max(STEADY, _CERTAIN * float(np.sqrt(covariance[0, 0]))):
        rate = slope / float(swing.times[-1] - swing.times[0])
        return f"from piece to piece it decays at {rate:+.3g} 1/s, to the end"
    first, second = (rms(half) for half in np.array_split(swing.signal, 2))
    return "it was larger before" if second < KEPT * first else ""


def needed_end(swing: Swing, oscillation: Oscillation | None = None) -> float:
    """Time until which a run should go on for a clear answer [s]."""
    begin, end = float(swing.response[0][0]), float(swing.times[-1])
    longer = begin + 1.5 * (end - begin)
    if oscillation is None:
        return longer
    return max(
        longer,
        begin + 1.2 * PERIODS / oscillation.frequency_hz,
        swing.decay_end(oscillation.frequency_hz),
    )


def _same(one: Oscillation, other: Oscillation) -> bool:
    return abs(one.frequency_hz - other.frequency_hz) <= SAME * other.frequency_hz

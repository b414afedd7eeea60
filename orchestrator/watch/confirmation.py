"""Whether the whole response confirms an oscillation that does not decay at its end.

Over a few periods two decaying oscillations that beat, or the harmonics that a large swing has in magnitudes of
voltages and currents, look like one that grows. An eigenvalue belongs to the system: a true growth has one rate in
every part of the response, while that of a beat changes from part to part."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.watch.known_modes import NOTHING_KNOWN, KnownModes
from orchestrator.watch.oscillation import Oscillation, crossings_hz, strongest_oscillation, too_fast, without_trend

KEPT = 0.7  # A swing is decaying if its last third is smaller than this part of its middle third


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
    known: KnownModes = NOTHING_KNOWN


STEADY = 0.05  # the logarithm of a sustained oscillation's amplitude changes less over the judged part

PERIODS = 4.5
"""Number of periods that the response must have of an oscillation that grows or lasts. With fewer it cannot be told
from a beat with a mode of a similar frequency: of eleven faults on nine buses, each watched until 50 different times,
those that seemed to grow in every part of the response had 4 at most."""

SAME = 0.05  # largest relative difference of frequency between the judged part and the whole response
AGREE = 2.0  # largest factor between the growth rates of the judged part and of the whole response
_FAR = 2.0  # from the first to the last third, the factor by which an oscillation of modes that decay may grow
_GROWN, _EVEN = 0.7, 1.6
"""A fast oscillation that grows in truth goes from the first to the last fifth by the first figure at least, as a
logarithm, and from each fifth to the next by the same, up to the second figure as a factor: a beat bends more."""

FAR_ABOVE, RISING = 10.0, 1.3
"""A swing of any shape grows if it rises by the first factor from the first to the last quarter, and by the second one
at least from each quarter to the next."""


_PIECES, _CERTAIN = 8, 3.0
"""Number of pieces of the judged part whose sizes tell whether a swing of any shape decays, and least number of its
standard errors that the slope of their logarithms has if it does."""


def change(swing: Swing, rate: float) -> float:
    """Change of the logarithm of an amplitude over the judged part, for a growth rate [1/s]."""
    return rate * float(swing.times[-1] - swing.times[0])


def rms(signal: Numbers) -> float:
    """Root mean square of a signal around its trend."""
    return float(np.sqrt(np.mean(without_trend(signal) ** 2)))


def rises(signal: Numbers, *, extents: bool = False) -> bool:
    sizes = [float(part.mean()) if extents else rms(part) for part in np.array_split(signal, 4)]
    return sizes[3] > FAR_ABOVE * sizes[0] and all(late > RISING * early for early, late in pairwise(sizes))


def doubt(swing: Swing, oscillation: Oscillation) -> str:
    """Why an oscillation that seems to grow, or to last, may decay; empty where the whole response confirms it."""
    grows = change(swing, oscillation.rate) > STEADY
    if swing.turns_hz is not None:
        return _fast_doubt(swing, oscillation, grows=grows)
    times, signal = (part[1:] for part in swing.response)  # the first look is that before the event
    if grows and rises(signal):
        return ""
    periods = float(times[-1] - times[0]) * oscillation.frequency_hz
    if periods < PERIODS:
        return f"{periods:.2g} periods cannot tell that from a beat of oscillations that decay"
    whole = strongest_oscillation(times, signal)
    if not grows:
        falls = whole is not None and _same(whole, oscillation) and change(swing, whole.rate) < -2 * STEADY
        return f"over the whole response it decays at {whole.rate:+.3g} 1/s" if falls and whole is not None else ""
    if whole is None or not _same(whole, oscillation):
        return "the whole response does not show that oscillation as the strongest"
    if not oscillation.rate / AGREE < whole.rate < AGREE * oscillation.rate:
        return f"over the whole response its rate is {whole.rate:+.3g} 1/s"
    halves = (np.array_split(swing.times, 2), np.array_split(swing.signal, 2))
    parts = [strongest_oscillation(t, y, least_periods=1) for t, y in zip(*halves, strict=True)]
    if any(part is not None and part.rate < 0 for part in parts):
        return "in one half of its end it decays"
    return ""


def _growth(swing: Swing) -> float:
    """Factor from the first third to the last one of a swing whose extents are known."""
    first, *_, last = (float(part.mean()) for part in np.array_split(swing.signal, 3))
    return last / first


def _lasts(swing: Swing) -> float:
    return float(swing.times[-1] - swing.response[0][0])


def is_explained(swing: Swing, oscillation: Oscillation) -> bool:
    """Whether modes that the model knows to decay make a fast oscillation that does not grow far meanwhile."""
    rate = swing.known.rate(oscillation.frequency_hz)
    decays = rate is not None and _lasts(swing) < swing.known.decays_until(oscillation.frequency_hz)
    return decays and _growth(swing) < _FAR


def is_known_to_decay(swing: Swing) -> bool:
    """Whether the model's modes at the frequency of a swing that is too fast for the looks decay."""
    rate = swing.known.rate(crossings_hz(swing.times, swing.signal)) if too_fast(swing.times, swing.signal) else None
    return rate is not None and rate < 0


def _fast_doubt(swing: Swing, oscillation: Oscillation, *, grows: bool) -> str:
    if _growth(swing) <= (1.0 if grows else KEPT):
        return "it was larger before"
    rate = swing.known.rate(oscillation.frequency_hz)
    sizes = np.array([np.median(part) for part in np.array_split(swing.response[1][1:], 5)])
    rates = np.diff(np.log(sizes)) if (sizes > 0).all() else np.zeros(1)
    even = rates.sum() > _GROWN and 0 < rates.max() < _EVEN * rates.min()
    if (rate is not None and rate >= 0) or (grows and (even or rises(swing.signal, extents=True))):
        return ""
    if not grows and _lasts(swing) >= swing.known.decays_until(oscillation.frequency_hz):
        return ""
    if rate is not None:
        return f"the linear model's modes there decay, the slowest at {rate:+.3g} 1/s, and may beat"
    return "no linear model tells of modes there, and offsets that decay and beat swing like that for a while"


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
    hertz = oscillation.frequency_hz
    return begin + max(longer - begin, 1.2 * PERIODS / hertz, swing.known.decays_until(hertz))


def _same(one: Oscillation, other: Oscillation) -> bool:
    return abs(one.frequency_hz - other.frequency_hz) <= SAME * other.frequency_hz

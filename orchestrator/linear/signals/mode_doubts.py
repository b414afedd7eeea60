"""Doubts about modes that were identified in a signal: what a window, a model order and noise may have made up."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from orchestrator.linear.signals.identification import IdentifiedMode

# distance, as a part of |λ|, within which a half shows the same mode where there is no noise
SAME = 0.015
SENSIBLE = 0.3  # distance, as a part of |λ|, beyond which a mode is another one
# standard deviations of an eigenvalue within which a half shows the same mode in noise
_CERTAIN = 5.0
_FEWEST_PERIODS = 2.0
_WHITE = 0.3  # largest correlation of noise with itself one to three samples later
_LEFT = 0.01  # part of a mode's amplitude below which next to nothing of it is left
_BEATING = 0.2  # part of a mode's amplitude from which on another one beats with it
_MOST_SAMPLES = 4000


@dataclass(frozen=True, slots=True)
class WindowPart:
    modes: Sequence[IdentifiedMode]
    length: float  # of this part [s]
    samples: int
    remainder: float  # root mean square of what the modes leave [unit of the signal]
    noise_like: bool  # whether the remainder is not correlated with itself

    def shows(self, mode: IdentifiedMode) -> bool | None:
        """Return whether this part shows a mode of all of the signal; None where it cannot tell.

        It cannot where it is too short, or where a beat, noise or the decay hides the mode."""
        if mode.frequency_hz * self.length < _FEWEST_PERIODS:
            return None
        here = near(self.modes, mode)
        if here is None or here.amplitude < _LEFT * mode.amplitude or self._beats(here):
            return None
        within = _CERTAIN * self._spread(here)
        if _distance(here, mode) > max(SAME, within):
            return False
        return True if within < SENSIBLE else None

    def _beats(self, mode: IdentifiedMode) -> bool:
        """Return whether another mode beats with this one, slower than this part can tell apart in noise."""
        apart = 2 * np.pi / self.length
        return any(
            other is not mode
            and other.amplitude > _BEATING * mode.amplitude
            and abs(other.eigenvalue.imag - mode.eigenvalue.imag) < apart
            for other in self.modes
            if other.frequency_hz > 0
        )

    def _spread(self, mode: IdentifiedMode) -> float:
        """Least standard deviation of an eigenvalue in white noise, as a part of |λ|.

        Rife and Boorstyn, "Single-tone parameter estimation from discrete-time observations", IEEE Trans. Information
        Theory 20(5), 1974, for a real signal of amplitude 2·|A|; a damped one counts for one of its time constants."""
        if mode.amplitude <= 0:
            return np.inf
        lasting = min(self.length, 1 / max(abs(mode.eigenvalue.real), 1e-9))
        count = max(self.samples * lasting / self.length, 1.0)
        deviation = np.sqrt(24 / count) * self.remainder / (2 * mode.amplitude * lasting)
        return float(deviation / abs(mode.eigenvalue))


def near(modes: Sequence[IdentifiedMode] | None, mode: IdentifiedMode) -> IdentifiedMode | None:
    """The nearest mode within a sensible distance."""
    best = min(modes or (), key=lambda other: _distance(other, mode), default=None)
    return best if best is not None and _distance(best, mode) <= SENSIBLE else None


def part_of(
    times: NDArray[np.float64], signal: NDArray[np.float64], modes: Sequence[IdentifiedMode]
) -> WindowPart:
    """Return what the modes of a part of a signal leave of it."""
    thin = -(-len(times) // _MOST_SAMPLES)
    t, y = times[::thin] - times[0], signal[::thin]
    length = float(t[-1])
    columns = [np.ones_like(t)]
    for mode in modes:
        later = max(mode.eigenvalue.real, 0.0) * length
        wave = np.exp(mode.eigenvalue * t - later)
        columns += [wave.real, wave.imag] if mode.frequency_hz > 0 else [wave.real]
    matrix = np.column_stack(columns)
    left = y - matrix @ np.linalg.lstsq(matrix, y, rcond=None)[0]
    power = float(left @ left) or 1.0
    white = all(
        abs(float(left[:-lag] @ left[lag:])) < _WHITE * power
        for lag in (1, 2, 3)
        if len(left) > lag
    )
    return WindowPart(modes, length, len(t), float(np.sqrt(np.mean(left**2))), white)


def _distance(one: IdentifiedMode, other: IdentifiedMode) -> float:
    return abs(one.eigenvalue - other.eigenvalue) / abs(other.eigenvalue)


FEWEST_PERIODS = 2.0  # A mode with fewer periods in the window may be a part of a trend
# with a higher damping [%] less than a fifteenth of an amplitude is left after one period
LARGEST_DAMPING = 40.0
LEAST_ENERGY = 1e-3  # least part of the energy of all oscillations in the window
# largest distance, as a part of |λ|, to the same mode in another identification of the same signal
AGREE = 0.05
# A straight line that changes by this many times the strongest oscillation may hide smaller ones
STEEP = 10.0
# Two modes d Hz apart need 0.75/d s: with 3 % of noise the damping is right to 0.8 points then
TOLD_APART = 0.75
# the other identification leaves out this part of the window at its beginning
SHORTER = 0.1
# it takes singular values for noise that are this factor larger: its order is lower if noise made modes
COARSER = 30.0


def with_doubts(
    modes: Sequence[IdentifiedMode],
    length: float,
    others: Sequence[IdentifiedMode] | None,
    halves: Sequence[WindowPart] = (),
    noise_like: bool = False,
) -> list[IdentifiedMode]:
    """The modes, each with its doubts; real poles have none, as they do not swing.

    ``length``: of the window [s].
    ``others``: modes of the same signal by another order and window; None where that shows none.
    ``noise_like``: whether the modes leave nothing of the signal but noise."""
    energies = [_energy(mode, length) for mode in modes]
    total = sum(
        energy for mode, energy in zip(modes, energies, strict=True) if _swings(mode, length)
    )
    judged = []
    for mode, energy in zip(modes, energies, strict=True):
        if mode.frequency_hz > 0:
            share = energy / total if total else 1.0
            doubts = tuple(_doubts(mode, length, share, others, halves, noise_like))
            judged.append(replace(mode, doubts=doubts))
        else:
            judged.append(mode)
    return judged


def is_trend(mode: IdentifiedMode, length: float) -> bool:
    """Return whether a component is a part of an offset or a trend.

    In the window it changes by less than a factor e and turns by less than one radian."""
    return abs(mode.eigenvalue) * length < 1


def worth_showing(
    modes: Sequence[IdentifiedMode], length: float, weakest: float
) -> list[IdentifiedMode]:
    """The modes without those that are too small.

    A straight line comes out as exponentials of huge amplitudes that cancel, so that oscillations are compared with the
    strongest one that swings at least once in the window.

    ``length``: of the window [s]."""
    largest = max((mode.amplitude for mode in modes), default=0.0)
    swing = max((mode.amplitude for mode in modes if _swings(mode, length)), default=largest)
    return [
        mode
        for mode in modes
        if mode.amplitude >= weakest * (swing if mode.frequency_hz > 0 else largest)
    ]


def _swings(mode: IdentifiedMode, length: float) -> bool:
    return mode.frequency_hz * length >= 1


def _doubts(
    mode: IdentifiedMode,
    length: float,
    share: float,
    others: Sequence[IdentifiedMode] | None,
    halves: Sequence[WindowPart],
    noise_like: bool,
) -> list[str]:
    found = []
    periods = mode.frequency_hz * length
    if periods < FEWEST_PERIODS:
        found.append(f"the window has {_fewer(periods)} periods of it")
    if mode.damping_percent > LARGEST_DAMPING:
        found.append(
            f"its damping of {mode.damping_percent:.0f} % leaves next to nothing after a period"
        )
    if share < LEAST_ENERGY:
        found.append(f"it has {100 * share:.1g} % of the energy of all oscillations")
    shown = [half.shows(mode) for half in halves]
    other = near(others, mode)
    by_another = "a model of another order, of a slightly shorter window,"
    if other is None and not (noise_like and shown == [True, True]):
        found.append(f"{by_another} does not show it")
    elif other is not None and (moved := abs(other.eigenvalue / mode.eigenvalue - 1)) > AGREE:
        found.append(f"{by_another} moves it by {100 * moved:.2g} %")
    differing = [
        f"the {name} half of the window shows {instead.frequency_hz:.4g} Hz and {instead.damping_percent:.3g} %"
        for name, half, shows in zip(("first", "second"), halves, shown, strict=False)
        if shows is False and (instead := near(half.modes, mode))
    ]
    if differing:
        found.append(f"{', '.join(differing)} in its place")
    return found


def _fewer(periods: float) -> str:
    """A number of periods that are too few, with as many digits as show this."""
    texts = (f"{periods:.{digits}g}" for digits in range(2, 17))
    return next((text for text in texts if float(text) < FEWEST_PERIODS), repr(periods))


def _energy(mode: IdentifiedMode, length: float) -> float:
    """Integral of |A·e^{λt}|² over the window."""
    rate = 2 * mode.eigenvalue.real * length
    return mode.amplitude**2 * length * float(np.expm1(rate) / rate if abs(rate) > 1e-9 else 1.0)


def short_window(modes: Sequence[IdentifiedMode], start: float, stop: float) -> str:
    """A sentence on a window that is too short for the strongest oscillation; else empty."""
    length = stop - start
    strongest = next(
        (mode for mode in modes if mode.frequency_hz > 0 and not is_trend(mode, length)), None
    )
    if strongest is None or strongest.frequency_hz * length >= FEWEST_PERIODS:
        return ""
    return (
        f"The window from {start:g} to {stop:g} s is too short: it has {_fewer(strongest.frequency_hz * length)} "
        f"periods of its strongest oscillation at {strongest.frequency_hz:.4g} Hz, and modes need "
        f"{FEWEST_PERIODS:g} at least. Give an earlier start, a later stop, or a longer run."
    )


def told_apart(modes: Sequence[IdentifiedMode], length: float) -> str:
    """How far apart two modes must lie to be told from each other, and which of those found lie closer."""
    apart = TOLD_APART / length
    swings = sorted(mode.frequency_hz for mode in modes if _swings(mode, length))
    close = [pair for pair in pairwise(swings) if 0 < pair[1] - pair[0] < apart]
    text = f"{length:.4g} s of record tell two modes apart that lie {apart:.2g} Hz or more from each other"
    longer = [f"{a:.4g} and {b:.4g} Hz need {TOLD_APART / (b - a):.3g} s" for a, b in close]
    return f"{text}{': ' * bool(longer)}{', '.join(longer)}."


def nothing_swings(modes: Sequence[IdentifiedMode], length: float) -> str:
    """A sentence where no oscillation was found in a window of this length [s]; else empty."""
    if not modes:
        return "Nothing above the noise: the window shows no mode."
    if any(mode.frequency_hz > 0 and not is_trend(mode, length) for mode in modes):
        return ""
    return "No oscillation above the noise: the window shows a trend or a decay only."


def straight_line(times: NDArray[np.float64], signal: NDArray[np.float64]) -> float:
    """By how much the straight line through a signal changes from its first to its last sample [unit of the signal]."""
    centred = times - times.mean()
    return float(centred @ (signal - signal.mean()) / (centred @ centred) * (times[-1] - times[0]))


def over_a_trend(modes: Sequence[IdentifiedMode], length: float, line: float) -> str:
    """A sentence on a trend that is large beside the strongest oscillation, or that is all there is; else empty."""
    swing = max((2 * mode.amplitude for mode in modes if _swings(mode, length)), default=0.0)
    trends = any(is_trend(mode, length) for mode in modes)
    if not trends or abs(line) <= STEEP * swing:
        return ""
    beside = (
        f"{abs(line) / swing:.0f} times its strongest oscillation"
        if swing
        else "and no oscillation was found"
    )
    return (
        f"The signal drifts by {line:.3g} along a straight line, {beside}: smaller modes may be hidden below this "
        "trend. Give a shorter window, or take a signal without the trend, such as a difference of two."
    )

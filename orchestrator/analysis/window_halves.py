"""Whether the two halves of a window show the modes that all of it shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.analysis.identification import IdentifiedMode

SAME = 0.015  # distance, as a part of |λ|, within which a half shows the same mode where there is no noise
SENSIBLE = 0.3  # distance, as a part of |λ|, beyond which a mode is another one
_CERTAIN = 5.0  # standard deviations of an eigenvalue within which a half shows the same mode in noise
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
        """Whether this part shows a mode of all of the signal; None where it cannot tell.

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
        """Whether another mode beats with this one, slower than this part can tell apart in noise."""
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
        lasting = min(self.length, 1 / max(abs(mode.eigenvalue.real), 1e-9))
        count = max(self.samples * lasting / self.length, 1.0)
        deviation = np.sqrt(24 / count) * self.remainder / (2 * mode.amplitude * lasting)
        return float(deviation / abs(mode.eigenvalue))


def near(modes: Sequence[IdentifiedMode] | None, mode: IdentifiedMode) -> IdentifiedMode | None:
    """The nearest mode within a sensible distance."""
    best = min(modes or (), key=lambda other: _distance(other, mode), default=None)
    return best if best is not None and _distance(best, mode) <= SENSIBLE else None


def part_of(times: NDArray[np.float64], signal: NDArray[np.float64], modes: Sequence[IdentifiedMode]) -> WindowPart:
    """What the modes of a part of a signal leave of it."""
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
    white = all(abs(float(left[:-lag] @ left[lag:])) < _WHITE * power for lag in (1, 2, 3) if len(left) > lag)
    return WindowPart(modes, length, len(t), float(np.sqrt(np.mean(left**2))), white)


def _distance(one: IdentifiedMode, other: IdentifiedMode) -> float:
    return abs(one.eigenvalue - other.eigenvalue) / abs(other.eigenvalue)

"""What the run's own linear model says of an oscillation that is too fast for the looks.

Offsets in stators and lines decay over seconds, and those of neighbouring machines beat over tens of them: for a while,
such a response seems to grow or to last. Slow swings are judged by the response alone, because large ones may grow
where small ones decay."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.coupling.system import System

_SAME = 0.05  # relative difference of frequency within which modes make an oscillation, or beat in it
_GONE = 3.0  # time constants after which hardly anything is left of a mode, however it beats
_OFFSET, _OFFSET_GONE = 0.02, 20.0
"""Relative distance from the rated frequency, or from twice it, within which a swing may be a decaying offset where no
model holds, and time from which on it is none [s]."""


@dataclass(frozen=True)
class KnownModes:
    """``eigenvalues``: all of the linear model that holds [rad/s]; none where no model does."""

    eigenvalues: Sequence[complex] = ()
    rated_hz: float = 0.0

    def rate(self, hertz: float) -> float | None:
        """Largest real part [1/s] of the modes at a frequency or, as in magnitudes, at half of it; None if there are
        none."""
        found = np.asarray(self.eigenvalues, dtype=complex)
        of_modes = found.imag / (2 * np.pi)
        near = (np.abs(of_modes - hertz) < _SAME * hertz) | (np.abs(of_modes - hertz / 2) < _SAME * hertz / 2)
        return float(found.real[near].max()) if near.any() else None

    def decays_until(self, hertz: float) -> float:
        """Time since an event for which modes that decay may still be seen at a frequency [s]; 0 if there are none."""
        rate = self.rate(hertz)
        if rate is not None:
            return _GONE / -rate if rate < 0 else 0.0
        offset = any(abs(hertz - k * self.rated_hz) < _OFFSET * k * self.rated_hz for k in (1, 2))
        return _OFFSET_GONE if offset else 0.0


def rated_hz(system: System) -> float:
    plans = system.components.values()
    return max((plan.number("f_n") for plan in plans if "f_n" in plan.description.variables), default=0.0)


NOTHING_KNOWN = KnownModes()

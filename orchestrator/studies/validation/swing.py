"""How far an event moved the plant's P and Q: a yardstick for the errors of a model, where nobody gave limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.studies.validation.event import EventComparison
from orchestrator.studies.validation.figures import largest_of_noise, noise_in

_LEAST_SWING = 1e-3  # movement [pu] below which instruments of the best class may have made it
_ABOVE_NOISE = 2.0  # times the largest of the noise, from which on a movement is the plant's


@dataclass(frozen=True)
class PlantSwing:
    """The movement of one measured signal from the event on, and how far the model is off it [pu of the rating].

    ``largest``, ``rms``: of the measured signal less its value before the event; ``noise``: the largest that its
    scatter alone would make of it; ``error``, ``rms_error``: of the simulated less the measured one."""

    largest: float
    rms: float
    noise: float
    error: float
    rms_error: float

    @property
    def seen(self) -> bool:
        """Return whether the event moved the signal by more than an instrument makes."""
        return self.largest > max(_LEAST_SWING, _ABOVE_NOISE * self.noise)

    @property
    def part(self) -> float | None:
        """The largest error as part of the largest movement; None where the event did not move the signal."""
        return self.error / self.largest if self.seen else None

    @property
    def rms_part(self) -> float | None:
        """The same of rms values."""
        return self.rms_error / self.rms if self.seen else None

    def as_json(self) -> dict[str, float | None]:
        part, rms_part = self.part, self.rms_part
        return {
            "swing_pu": self.largest,
            "swing_rms_pu": self.rms,
            "swing_of_noise_pu": self.noise,
            "max_error_pu": self.error,
            "rms_error_pu": self.rms_error,
            "max_error_percent": None if part is None else 100 * part,
            "rms_error_percent": None if rms_part is None else 100 * rms_part,
        }


def swings_of(comparison: EventComparison) -> Mapping[str, PlantSwing]:
    """The swings of P and Q of one event, by name."""
    event = comparison.event
    recording, power = event.recording, event.start.power
    part = recording.good & (recording.times > event.windows.begin)
    found = {}
    for name, before in (("p", power.real), ("q", power.imag)):
        measured, simulated = comparison.measured[name], comparison.simulated[name]
        moved, error = measured[part] - before, (simulated - measured)[part]
        noise = largest_of_noise(noise_in(recording, measured, event.windows), len(moved))
        found[name] = PlantSwing(*_sizes(moved), noise, *_sizes(error))
    return found


def _sizes(values: Numbers) -> tuple[float, float]:
    """The largest magnitude and the rms value; zeros where there is no sample."""
    if not len(values):
        return 0.0, 0.0
    return float(np.abs(values).max()), float(np.sqrt(np.mean(values**2)))

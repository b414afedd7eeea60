"""A plant that falls out of step itself: its current turns by whole turns beside its own voltage.

Near the loss a little decides when it comes. The right model, driven by the recorded voltage, may fall earlier, later
or not at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Complex
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.windows import Windows

_MEAN = 0.04  # time over which the current is looked at, two periods of 50 Hz [s]
_LEAST_TURNS = 0.8  # that no swing makes: from feeding to consuming and back is less than one
_IN_STEP = 0.25  # turns within which a plant is in step
_LEAST_CURRENT = 0.1  # current [pu of the rating] below which its angle says nothing


@dataclass(frozen=True)
class PlantLoss:
    """The moment until which a plant is in step [s from the recording's begin], and by how many turns it leaves."""

    time: float
    turns: float


def plant_loss(recording: Recording, windows: Windows) -> PlantLoss | None:
    """Find the loss of step of a plant; None where it stays in step, or no current tells."""
    width = max(1, round(_MEAN / recording.interval))
    first = max(1, int(windows.begin / recording.interval))
    seen = recording.current_of(recording.power)
    before = complex(seen[:first].mean())
    if abs(before) < _LEAST_CURRENT or len(recording.voltage) < first + 2 * width:
        return None
    current: Complex = np.convolve(seen, np.ones(width) / width, mode="same")
    large = np.flatnonzero(np.abs(current) > _LEAST_CURRENT)
    turns = np.unwrap(np.angle(current[large] / before)) / (2 * np.pi)
    far = np.flatnonzero(np.abs(turns) > _LEAST_TURNS)
    if not len(far):
        return None
    near = np.flatnonzero(np.abs(turns[: far[0]]) < _IN_STEP)
    if not len(near):
        return None
    moment = float(recording.interval * large[near[-1]])
    return PlantLoss(moment, float(np.abs(turns).max())) if moment > windows.begin else None

"""A model that falls out of step where the plant did not: the recorded voltage does not bring it back.

A device at its limit of the current is unstable beside a voltage that does not give way. A little that is off before,
or that no sample holds, makes it fall; what it does then tells nothing of the value that was off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.windows import Windows

_MEAN = 0.1  # time over which P and Q are looked at, five periods of 50 Hz [s]
_LEAST_OFF = 0.8  # power by which a device out of step is off [pu of the rating]
_TIMES_SWING = 2.5  # the same, of the plant's largest movement; a wrong sign makes two of it
_IN_STEP = 0.4  # part of the plant's largest movement by which a model in step is off
_LEAST_IN_STEP = 0.05  # power by which it may be off as well [pu of the rating]
_SHORTEST = 0.3  # time for which it is off, to the end of the recording [s]
_LEAST_BEFORE = 0.3  # time after the event's begin in which it was in step [s]


@dataclass(frozen=True)
class StepLoss:
    """The moment until which a model is in step [s from the recording's begin], and what comes after.

    ``own``, ``seen``: mean active power of the model and of the plant after it [pu of the rating]."""

    time: float
    own: float
    seen: float


def step_loss(recording: Recording, windows: Windows, simulated: Complex) -> StepLoss | None:
    """Find the loss of step of a model; None where it is in step at the end, or never was."""
    width = max(1, round(_MEAN / recording.interval))
    first = int(windows.begin / recording.interval)
    before = recording.power[: max(first, 1)].mean()
    moved = _means(recording.power - before, width)[first:]
    off = _means(simulated - recording.power, width)[first:]
    if not len(moved):
        return None
    swing = float(moved.max())
    far = off > max(_LEAST_OFF, _TIMES_SWING * swing)
    apart = len(far) if far.all() else int(far[::-1].argmin())  # samples up to the end
    near = np.flatnonzero(off[: len(off) - apart] <= max(_IN_STEP * swing, _LEAST_IN_STEP))
    if apart * recording.interval < _SHORTEST or not len(near):
        return None
    last = int(near[-1])
    if last * recording.interval < _LEAST_BEFORE:
        return None
    own, seen = (float(one.real[-apart:].mean()) for one in (simulated, recording.power))
    return StepLoss(float(recording.interval * (first + last)), own, seen)


def _means(values: Complex, width: int) -> Numbers:
    """Magnitudes of the means over so many samples, each of those from one on."""
    return np.asarray(np.abs(np.convolve(values, np.ones(width) / width, mode="valid")))

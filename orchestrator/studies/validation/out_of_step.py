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
_LEAST_CURRENT = 0.1  # current [pu of the rating] below which its angle says nothing
_BESIDE = 0.25  # turns within which the currents of model and plant are in step
_PASSES = 0.55  # turns by which a model leaves its plant: half a turn and the ringing of both
_SHORT_MEAN = 0.04  # time over which currents are looked at, two periods of 50 Hz [s]


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


def slip(recording: Recording, windows: Windows, simulated: Complex) -> float | None:
    """Find the moment until which a model is in step [s], whose current passes the opposite of the plant's after it.

    So falls a model that comes back after a whole turn, or of little power. What turns while one of both currents is
    small is not told: a power that changes its sign goes through zero, and turns by half a turn as well."""
    width = max(1, round(_SHORT_MEAN / recording.interval))
    first = int(windows.begin / recording.interval)
    seen, own = (
        _smooth(one / np.maximum(np.abs(recording.voltage), _LEAST_CURRENT), width)
        for one in (recording.power, simulated)
    )
    large = (np.abs(seen) > _LEAST_CURRENT) & (np.abs(own) > _LEAST_CURRENT)
    wanted = range(max(0, first - width), len(large))
    told = np.array([k for k in wanted if large[k]], dtype=int)
    if len(told) < width:
        return None
    turns = np.unwrap(np.angle(own[told] / seen[told])) / (2 * np.pi)
    lost = np.flatnonzero((np.diff(told) > 1) & (np.abs(np.diff(turns)) > _BESIDE))
    turns = turns[: lost[0] + 1] if len(lost) else turns
    far = np.flatnonzero(np.abs(turns) > _PASSES)
    near = np.flatnonzero(np.abs(turns[: far[0]]) < _BESIDE) if len(far) else far
    if not len(near) or abs(turns[0]) > _BESIDE:
        return None
    moment = float(recording.interval * told[near[-1]])
    return moment if moment > windows.begin else None


def _smooth(values: Complex, width: int) -> Complex:
    """Means over so many samples around each."""
    return np.asarray(np.convolve(values, np.ones(width) / width, mode="same"))


def _means(values: Complex, width: int) -> Numbers:
    """Magnitudes of the means over so many samples, each of those from one on."""
    return np.asarray(np.abs(np.convolve(values, np.ones(width) / width, mode="valid")))

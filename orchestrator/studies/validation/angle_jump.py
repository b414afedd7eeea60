"""An angle that jumps in the recording and in no plant: the magnitude stays, and P and Q do not answer.

A recorder that takes a new reference, or loses the time of its clock, turns the angle at one sample. A grid that turned
so would move P and Q of every plant."""

from __future__ import annotations

import math

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import Recording

_LEAST = math.radians(3.0)
"""Jump [rad]: a smaller one moves most plants by little more than their usual swings."""

_STANDS_OUT = 4.0  # times the changes beside it, by which an angle jumps
_BESIDE = 10  # changes before and after it that are looked at
_MAGNITUDE = 0.01  # change of the magnitude [pu] within which it stays
_NEAR = 0.06  # time before and after the jump [s] in which a plant answers: three periods
_ANSWERS = 0.2  # part of the model's movement, by which a plant answers at least
_ASKED = 0.02  # movement of the model [pu] that is an answer


def ask_of_angle_jump(recording: Recording, simulated: Complex) -> list[Question]:
    """Ask about the largest jump of the angle that the model answers and the plant does not."""
    if recording.instantaneous:
        return []
    found = [one for at in _jumps(recording) for one in _unanswered(recording, simulated, at)]
    return sorted(found, key=lambda one: -abs(one.figures["jump"]))[:1]


def _jumps(recording: Recording) -> list[int]:
    """Samples before a change of the angle that stands out from those beside it."""
    steps = _steps(recording)
    sizes = np.abs(steps - np.median(steps))
    found = []
    for at in map(int, np.flatnonzero(sizes > _LEAST)):
        low, high = max(0, at - _BESIDE), at + _BESIDE + 1
        beside = np.concatenate([sizes[low:at], sizes[at + 1 : high]])
        if sizes[at] > _STANDS_OUT * float(np.sort(beside)[-2:].min(initial=0.0)):
            found.append(at)
    return found


def _steps(recording: Recording) -> Numbers:
    return np.asarray(np.diff(np.unwrap(np.angle(recording.voltage))))


def _unanswered(recording: Recording, simulated: Complex, at: int) -> list[Question]:
    near = max(2, round(_NEAR / recording.interval))
    around = slice(max(0, at - near), at + 1 + near)
    good = recording.good[around]
    magnitude = np.abs(recording.voltage[around])
    if good.sum() < 3 or np.ptp(magnitude) > _MAGNITUDE:
        return []
    seen, asked = (_movement(one[around][good]) for one in (recording.power, simulated))
    if asked < _ASKED or seen > _ANSWERS * asked:
        return []
    figures = {
        "at": recording.begin + float(recording.times[at + 1]),
        "jump": math.degrees(float(_steps(recording)[at])),
        "asked": asked,
        "seen": seen,
    }
    return [Question(QuestionKind.ANGLE_JUMP, figures)]


def _movement(power: Complex) -> float:
    """The largest movement of P or Q [pu of the rating]."""
    return float(max(np.ptp(power.real), np.ptp(power.imag)))

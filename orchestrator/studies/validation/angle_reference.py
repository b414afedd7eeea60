"""An angle that was taken against a bus of the same grid, which moves itself: the plant answers its own voltage alone.

An angle against another bus lacks what both have in common, above all the frequency. So P stays off after an event,
though the recorded frequency comes back to the rated one; no droop does that. And where the other bus swings before the
event, the model swings with it, and the plant rests."""

from __future__ import annotations

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.filled import Mask
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.trend import PARTS_OF_TREND, trend_of
from orchestrator.studies.validation.windows import Windows

_OFFSET = 0.015  # error of P that stays [pu]
_STIFFEST = 0.002
"""Part of the rated frequency by which it is off while P moves by 1 pu, below which no control answers it.

Droops of 0.02 to 0.1 are usual, and a POD with a slow washout beside one makes 0.008 of it."""
_STAYS = 0.3  # part of an error at the end that is there in the third before
_RIGHT_BEFORE = 0.15  # part of it that may be there before the event
_LATE = 3  # the last so many-th part of what follows an event is its end
_LONG_ENOUGH = 1.0  # time [s] of that end, in which a mean frequency holds little of a swing
_ASKED = 0.015  # movement of the model before the event [pu] that its voltage makes
_ANSWERS = 0.1  # part of it by which a plant answers at least
_FEWEST = 10  # samples of which a mean is told


def ask_of_swing_before(
    recording: Recording, windows: Windows, simulated: Complex
) -> list[Question]:
    """Ask about an angle that moves the model before the event, where the plant rests."""
    if not _may_be_asked(recording, windows):
        return []
    before = windows.part("before", recording.times) & recording.good
    if before.sum() < PARTS_OF_TREND:
        return []
    asked, seen = (trend_of(power[before]) for power in (simulated, recording.power))
    if asked < _ASKED or seen > _ANSWERS * asked:
        return []
    return [Question(QuestionKind.ANGLE_REFERENCE, {"asked": asked, "seen": seen})]


def ask_of_lacking_frequency(
    recording: Recording, windows: Windows, simulated: Complex, rated_hz: float
) -> list[Question]:
    """Ask about an angle without the frequency by which P stays off the model's to the end."""
    if not _may_be_asked(recording, windows):
        return []
    times, error = recording.times, (simulated - recording.power).real
    third = (recording.length - windows.end) / _LATE
    before = windows.part("before", times) & recording.good
    late = (times > recording.length - third) & recording.good
    earlier = (times > recording.length - 2 * third) & recording.good & ~late
    if third < _LONG_ENOUGH or min(before.sum(), earlier.sum(), late.sum()) < _FEWEST:
        return []
    level, was, offset = (float(error[part].mean()) for part in (before, earlier, late))
    if abs(offset) < _OFFSET or was / offset < _STAYS or abs(level) > _RIGHT_BEFORE * abs(offset):
        return []
    hertz = _frequency(recording, late) - _frequency(recording, before)
    if abs(hertz) > _STIFFEST * rated_hz * abs(offset):
        return []
    figures = {"offset": -offset, "hertz": hertz, "at": recording.begin + recording.length - third}
    return [Question(QuestionKind.ANGLE_REFERENCE, figures)]


def _may_be_asked(recording: Recording, windows: Windows) -> bool:
    """Return whether there is an angle and an event, and the recording's own frequency has asked nothing."""
    asked = any(one.kind is QuestionKind.ANGLE_REFERENCE for one in recording.questions)
    return "angle" in recording.channels and windows.seen and not asked


def _frequency(recording: Recording, part: Mask) -> float:
    """The mean frequency of the voltage in a part [Hz], in the recording's frame."""
    angle: Numbers = np.unwrap(np.angle(recording.voltage))[part]
    slope = np.polyfit(recording.times[part] - recording.times[part].mean(), angle, 1)[0]
    return float(slope / (2 * np.pi))

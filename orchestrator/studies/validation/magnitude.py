"""P or Q that was recorded without its sign: it never falls below zero, and is the model's where that is turned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from orchestrator.core.arrays import Complex
from orchestrator.studies.validation.event import EventComparison, RecordedEvent, cut_event
from orchestrator.studies.validation.questions import Question, QuestionKind

_CROSSES = 0.005  # the model goes to both sides of zero by more [pu]
_NEVER_BELOW = 0.1  # part of that, by which the recording may: its means smooth a corner
_EXPLAINS = 0.35  # part of the error that is left without the sign
_BEFORE = (
    1.0  # part of a recording before the event in which the device starts with the other sign [s]
)
_AFTER = 3.0  # part after its begin, the same [s]


def ask_of_magnitude(comparison: EventComparison) -> Iterator[Question]:
    """Ask about P and Q that agree with the model's but for the sign.

    They follow the recording better than its mean does, as those of a model that falls out of step do not. Where the
    sign was lost before the event already, the device started with the other one: it runs again. Values of
    one sign alone are another question, which has a sign to give."""
    for role in ("p", "q"):
        if role in comparison.event.recording.channels:
            yield from _question_of(comparison.event, role, comparison.played.power, comparison)
            yield from _from_the_other_side(comparison, role)


def _from_the_other_side(comparison: EventComparison, role: str) -> Iterator[Question]:
    """The same of a device that starts with the other sign; nothing where it does not start there."""
    near = cut_event(comparison.event, _AFTER, _BEFORE)
    power = near.start.power
    turned = power.conjugate() if role == "q" else -power.conjugate()
    tried = f"{role.upper()} of the other sign before the event"
    with comparison.device.trials.trial(tried, of_reading=True):
        played = comparison.device.play(near.recording, replace(near.start, power=turned))
        yield from _question_of(near, role, played.power, comparison)


def _question_of(
    event: RecordedEvent, role: str, power: Complex, comparison: EventComparison
) -> Iterator[Question]:
    recording = event.recording
    values = (recording.power, power, comparison.near_power(event))
    seen, own, now = ((x.real if role == "p" else x.imag)[recording.good] for x in values)
    least = float(own.min())
    crosses = least < -_CROSSES and own.max() > _CROSSES
    if not crosses or seen.min() < _NEVER_BELOW * least:
        return
    error = float(np.sqrt(np.mean((now - seen) ** 2)))
    left = float(np.sqrt(np.mean((np.abs(own) - seen) ** 2)))
    if left <= min(_EXPLAINS * error, float(seen.std())):
        figures = {"role": role, "column": recording.channels[role].column, "least": least}
        yield Question(QuestionKind.MAGNITUDE, figures | {"error": error, "left": left})

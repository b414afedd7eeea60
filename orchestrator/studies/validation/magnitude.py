"""P or Q that was recorded without its sign: it never falls below zero, and is the model's where that is turned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.averaging import averaged
from orchestrator.studies.validation.device import PlayedDevice
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
        turned_start = replace(near.start, power=turned)
        played = comparison.device.play(near.recording, turned_start)
        yield from _question_of(replace(near, start=turned_start), role, played.power, comparison)


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
    most = min(_EXPLAINS * error, float(seen.std()))
    left = float(np.sqrt(np.mean((np.abs(own) - seen) ** 2)))
    if left > most and recording.average > recording.interval and not recording.ahead:
        sizes = _means_of_size(event, role, comparison.device)[recording.good]
        left = float(np.sqrt(np.mean((sizes - seen) ** 2)))
    if left <= most:
        figures = {"role": role, "column": recording.channels[role].column, "least": least}
        yield Question(QuestionKind.MAGNITUDE, figures | {"error": error, "left": left})


def _means_of_size(event: RecordedEvent, role: str, device: PlayedDevice) -> Numbers:
    """The means of the device's P or Q that lost its sign before they were taken: a mean of both signs is smaller."""
    recording = event.recording
    power = device.play(replace(recording, average=0.0), event.start).power
    sizes = np.abs(power.real if role == "p" else power.imag) + 0j
    return averaged(recording.times, sizes, recording.average, recording.times).real

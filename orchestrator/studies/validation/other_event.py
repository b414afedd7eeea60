"""P and Q of another event than the voltage's: one of them moves where the other does nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import Recording

_JUMP = 0.04  # time [s] over which a bend of a signal is a jump: what is averaged over a period jumps within it
_SWING = 0.5  # the same, of a swing
_QUIET = 0.01  # bend of the voltage as part of the power's [pu]: at a bus with 100 times the rating's short circuit
_LEAST = 0.01  # bend of the power [pu] that is an event
_STANDS_OUT = 3.0  # times the bends just before, from which on one is an event
_BESIDE = 0.4  # time before [s] with which it is compared
_NEAR = 2.0  # times the jump's time, within which the signals of one event jump
_ANSWERS = 0.2  # part of the model's jump, by which a plant answers its own voltage at least


def ask_of_other_event(recording: Recording, simulated: Complex) -> list[Question]:
    """Ask if power moves by itself, or jumps where the voltage is quiet and is quiet where the voltage jumps.

    A power that moves through any line moves the voltage as well, and a voltage that jumps moves the power of whatever
    the model does then."""
    found = [*_beside_quiet_voltage(recording), *_at_another_time(recording, simulated)]
    return found[:1]


def _beside_quiet_voltage(recording: Recording) -> Iterator[Question]:
    for time in (_JUMP, _SWING):
        power = _bends(recording, recording.power, time)
        at = int(power.argmax())
        still = _bends(recording, recording.voltage, time).max()
        if power[at] > _LEAST and still < _QUIET * power[at]:
            figures = {"at": _moment(recording, at), "moves": float(power[at])}
            yield Question(QuestionKind.OTHER_EVENT, figures)


def _at_another_time(recording: Recording, simulated: Complex) -> Iterator[Question]:
    voltage, power, own = (
        _bends(recording, one, _JUMP) for one in (recording.voltage, recording.power, simulated)
    )
    of_voltage, of_power = int(voltage.argmax()), int(power.argmax())
    near = max(1, round(_NEAR * _JUMP / recording.interval))
    answer, asked = (float(one[_around(of_voltage, near)].max()) for one in (power, own))
    apart = abs(of_voltage - of_power) > 2 * near
    alone = _stands_out(recording, power, of_power) and not _stands_out(
        recording, voltage, of_power
    )
    moves = min(float(power[of_power]), asked) > _LEAST
    if apart and alone and moves and answer < _ANSWERS * asked:
        figures = {
            "voltage_at": _moment(recording, of_voltage),
            "at": _moment(recording, of_power),
            "moves": float(power[of_power]),
            "asked": asked,
        }
        yield Question(QuestionKind.OTHER_EVENT, figures)


def _bends(recording: Recording, values: Complex, time: float) -> Numbers:
    """How far each sample is off the middle of those so long before and after it [pu]; 0 where one is missing."""
    lag = max(1, round(time / recording.interval))
    found = np.zeros(len(values))
    if len(values) <= 2 * lag:
        return found
    good = recording.good
    known = good[lag:-lag] & good[2 * lag :] & good[: -2 * lag]
    off = values[lag:-lag] - 0.5 * (values[2 * lag :] + values[: -2 * lag])
    found[lag:-lag] = np.abs(off) * known
    return found


def _stands_out(recording: Recording, bends: Numbers, at: int) -> bool:
    """Return whether a signal bends around a sample as it does not just before."""
    near = max(1, round(_NEAR * _JUMP / recording.interval))
    before = bends[max(0, at - near - round(_BESIDE / recording.interval)) : max(1, at - near)]
    return bool(bends[_around(at, near)].max() > _STANDS_OUT * before.max(initial=0.0))


def _around(at: int, near: int) -> slice:
    return slice(max(0, at - near), at + near + 1)


def _moment(recording: Recording, at: int) -> float:
    """The time of a sample in the recording's own clock [s]."""
    return recording.begin + float(recording.times[at])

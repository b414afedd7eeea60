"""An angle that a recorder smoothed: integrated from a filtered frequency it lacks the jump that the plant felt.

The smoothing is taken back, by the derivative of the recorded angle, and the device runs again with the sharper one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import (
    EventComparison,
    RecordedEvent,
    cut_event,
    rms_error,
    rms_movement,
)
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import Recording

_AFTER = 2.0  # part of the recording after the event's begin that is looked at [s]
_BEFORE = 0.5  # part before it, the same [s]
_LEAST = 0.003  # rms error in that part [pu] below which nothing is tried
_OFF = 0.06  # part of the movement there that the error is at least
_EXPLAINS = 0.4  # part of the error that a sharper angle may leave, to be named
_SMALL = 0.03  # change of the angle [rad] that gives the part of the lost one: a shock says nothing of it
_PROMISES = 0.8  # part of the error that a straight line may leave, for a run to say what is left
_ABRUPT = 0.005  # time [s] within which an angle jumps, and over which its derivative is taken
_TIMES = 2.0  # times the recorded angle's fastest change, from which on the sharper one has a jump of its own
_SHORTEST = 0.01  # smoothing over less [s] is none that matters


@dataclass(frozen=True)
class Smoothing:
    """A way to smooth an angle over a time [s], and what it took away from the recorded one [rad]."""

    length: float
    lost: Callable[[Recording], Numbers]


def _lost_by_lag(length: float) -> Callable[[Recording], Numbers]:
    """A first-order lag: the time constant times the derivative."""
    return lambda recording: length * _slope(recording)


def _lost_by_mean(length: float, ahead: float) -> Callable[[Recording], Numbers]:
    """A mean over so long, of which a part ``ahead`` comes after its time.

    Its derivative is the difference of the angle at both ends over the length, so that each end gives the other."""

    def lost(recording: Recording) -> Numbers:
        count = max(1, round(length / recording.interval))
        shift = round(ahead * count)
        angle = np.unwrap(np.angle(recording.voltage))
        moves = count * recording.interval * _slope(recording)
        sharp = angle.copy()
        for k in range(count, len(angle)):
            at = k - shift
            sharp[k] = sharp[k - count] + moves[at] if at < len(angle) else angle[k]
        return np.asarray(sharp - angle)

    return lost


SMOOTHINGS = (
    Smoothing(0.1, _lost_by_lag(0.1)),
    *(Smoothing(length, _lost_by_mean(length, 0.0)) for length in (0.04, 0.05, 0.1, 0.2)),
    *(
        Smoothing(length, _lost_by_mean(length, 0.5))
        for length in (0.04, 0.06, 0.08, 0.1, 0.2, 0.3)
    ),
)


def lost_jump(comparison: EventComparison) -> Iterator[tuple[float, Question]]:
    """A sharper angle that explains most of the error around the event's begin, with the part that it leaves."""
    near = cut_event(comparison.event, _AFTER, _BEFORE)
    if near.recording.instantaneous:
        return
    power = comparison.near_power(near)
    error, moved = math.hypot(*rms_error(power, near)), math.hypot(*rms_movement(near))
    if error < max(_LEAST, _OFF * moved):
        return
    device = comparison.device.rough
    if device is not comparison.device:
        power = device.play(near.recording, near.start).power
    found = [one for smoothing in SMOOTHINGS for one in _tried(device, near, power, smoothing)]
    if not found:
        return
    left, length, lost = min(found, key=lambda one: one[0])
    angle = np.unwrap(np.angle(near.recording.voltage))
    jumps = _fastest(angle + lost, near.recording) > _TIMES * _fastest(angle, near.recording)
    if left > _EXPLAINS * error or not jumps:
        return
    figures = {
        "at": near.recording.begin + near.windows.begin,
        "length": length,
        "jump": math.degrees(float(np.abs(lost).max())),
        "error": error,
        "left": left,
    }
    yield left / error, Question(QuestionKind.LOST_JUMP, figures)


def _tried(
    device: PlayedDevice, near: RecordedEvent, base: Complex, smoothing: Smoothing
) -> Iterator[tuple[float, float, Numbers]]:
    """The rms error left [pu], the likeliest length of the smoothing [s] and the lost angle.

    ``base``: what the device does by the recorded angle. None if it cannot run, or a straight line promises too
    little."""
    recording = near.recording
    lost = smoothing.lost(recording)
    part = min(1.0, _SMALL / max(float(np.abs(lost).max()), _SMALL))
    with device.trials.trial(f"an angle smoothed over {1000 * smoothing.length:g} ms"):
        moves = (device.play(_turned(recording, part * lost), near.start).power - base) / part
        off = recording.power - base
        good = recording.good
        size = float(np.sum(np.abs(moves[good]) ** 2))
        scale = float(np.real(np.vdot(moves[good], off[good]))) / size if size > 0 else 0.0
        promised = _rms((off - scale * moves)[good])
        if promised > _PROMISES * _rms(off[good]) or scale * smoothing.length < _SHORTEST:
            return
        power = device.play(_turned(recording, scale * lost), near.start).power
        yield math.hypot(*rms_error(power, near)), scale * smoothing.length, scale * lost


def _rms(values: Complex) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def _turned(recording: Recording, angle: Numbers) -> Recording:
    return replace(recording, voltage=np.asarray(recording.voltage * np.exp(1j * angle)))


def _lag(recording: Recording) -> int:
    return max(1, round(_ABRUPT / recording.interval))


def _slope(recording: Recording) -> Numbers:
    """The derivative of the recorded angle [rad/s], over a few milliseconds around each sample."""
    angle = np.unwrap(np.angle(recording.voltage))
    lag = _lag(recording)
    low = np.clip(np.arange(len(angle)) - lag // 2, 0, len(angle) - 1)
    high = np.clip(low + lag, 0, len(angle) - 1)
    return np.asarray((angle[high] - angle[low]) / (lag * recording.interval))


def _fastest(angle: Numbers, recording: Recording) -> float:
    lag = _lag(recording)
    return float(np.abs(angle[lag:] - angle[:-lag]).max(initial=0.0))

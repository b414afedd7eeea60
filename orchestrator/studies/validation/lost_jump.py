"""An angle or a magnitude that a recorder smoothed: it lacks the jump that the plant felt.

The smoothing is taken back, by the derivative of what was recorded, and the device runs again with the sharper one. An
angle is smoothed where it was integrated from a filtered frequency, a magnitude in transducers of rms values."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers, rms
from orchestrator.studies.validation.device import Play, PlayedDevice
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
_SMALL = 0.03  # change [rad, or part of 1] that gives the part of what was lost: a shock says nothing of it
_PROMISES = 0.8  # part of the error that a straight line may leave, for a run to say what is left
_ABRUPT = 0.005  # time [s] within which a voltage jumps, and over which its derivative is taken
_TIMES = 2.0  # times the recorded one's fastest change, from which on the sharper one has a jump of its own
_LEAST_VOLTAGE = 0.05  # [pu] below which a magnitude says nothing of its smoothing
_SHORTEST = 0.01  # smoothing over less [s] is none that matters


Lost = Callable[[Numbers, float], Numbers]
"""What a smoothing took away from values that are so far apart [s]."""


@dataclass(frozen=True)
class Smoothing:
    """A way to smooth over a time [s], and what it took away from the recorded values."""

    length: float
    lost: Lost


def _lost_by_lag(length: float) -> Lost:
    """A first-order lag: the time constant times the derivative."""
    return lambda values, interval: length * _slope(values, interval)


def _lost_by_mean(length: float, ahead: float) -> Lost:
    """A mean over so long, of which a part ``ahead`` comes after its time.

    Its derivative is the difference of the values at both ends over the length, so that each end gives the other."""

    def lost(values: Numbers, interval: float) -> Numbers:
        count = max(1, round(length / interval))
        shift = round(ahead * count)
        moves = count * interval * _slope(values, interval)
        sharp = values.copy()
        for k in range(count, len(values)):
            at = k - shift
            sharp[k] = sharp[k - count] + moves[at] if at < len(values) else values[k]
        return np.asarray(sharp - values)

    return lost


def _angles(voltage: Complex) -> Numbers:
    return np.asarray(np.unwrap(np.angle(voltage)))


@dataclass(frozen=True)
class SmoothedPart:
    """A part of the voltage that a recorder may have smoothed.

    ``way``: 1j or 1, by which a change of the part is one of the voltage's logarithm; ``unit``: of a change, as it is
    told."""

    name: str
    kind: QuestionKind
    values: Callable[[Complex], Numbers]
    way: complex
    unit: float


SMOOTHINGS = (
    Smoothing(0.1, _lost_by_lag(0.1)),
    *(Smoothing(length, _lost_by_mean(length, 0.0)) for length in (0.04, 0.05, 0.1, 0.2)),
    *(
        Smoothing(length, _lost_by_mean(length, 0.5))
        for length in (0.04, 0.06, 0.08, 0.1, 0.2, 0.3)
    ),
)


SMOOTHINGS_OF_MAGNITUDE = (Smoothing(0.1, _lost_by_lag(0.1)),)  # of transducers
ANGLE = SmoothedPart("an angle", QuestionKind.LOST_JUMP, _angles, 1j, math.degrees(1.0))
MAGNITUDE = SmoothedPart(
    "a magnitude", QuestionKind.LOST_STEP, lambda voltage: np.log(np.abs(voltage)), 1 + 0j, 1.0
)


def lost_jump(comparison: EventComparison) -> Iterator[tuple[float, Question]]:
    """A sharper angle, or magnitude, that explains most of the error around the event's begin, and what it leaves."""
    for part, smoothings in ((ANGLE, SMOOTHINGS), (MAGNITUDE, SMOOTHINGS_OF_MAGNITUDE)):
        yield from _lost(comparison, part, smoothings)


def _lost(
    comparison: EventComparison, part: SmoothedPart, smoothings: Sequence[Smoothing]
) -> Iterator[tuple[float, Question]]:
    near = cut_event(comparison.event, _AFTER, _BEFORE)
    if near.recording.instantaneous or float(np.abs(near.recording.voltage).min()) < _LEAST_VOLTAGE:
        return
    power = comparison.near_power(near)
    error, moved = math.hypot(*rms_error(power, near)), math.hypot(*rms_movement(near))
    if error < max(_LEAST, _OFF * moved):
        return
    device = comparison.device.rough
    if device is not comparison.device:
        power = device.play(near.recording, near.start).power
    values = part.values(near.recording.voltage)
    ways = [_way_of(near.recording, part, one, values) for one in smoothings]
    device.announce([Play(device, one.recording, near.start) for one in ways])
    found = [one for way in ways for one in _tried(device, near, power, way)]
    if not found:
        return
    left, length, lost = min(found, key=lambda one: one[0])
    jumps = _fastest(values + lost, near.recording) > _TIMES * _fastest(values, near.recording)
    if left > _EXPLAINS * error or not jumps:
        return
    figures = {
        "at": near.recording.begin + near.windows.begin,
        "length": length,
        "jump": part.unit * float(np.abs(lost).max()),
        "error": error,
        "left": left,
    }
    yield left / error, Question(part.kind, figures)


@dataclass(frozen=True)
class _Way:
    """A smoothing with the values that it took away, and the recording that is sharper by a small part of them."""

    of: SmoothedPart
    smoothing: Smoothing
    lost: Numbers
    part: float
    recording: Recording


def _way_of(recording: Recording, of: SmoothedPart, smoothing: Smoothing, values: Numbers) -> _Way:
    lost = smoothing.lost(values, recording.interval)
    part = min(1.0, _SMALL / max(float(np.abs(lost).max()), _SMALL))
    return _Way(of, smoothing, lost, part, _sharper(recording, of, part * lost))


def _tried(
    device: PlayedDevice, near: RecordedEvent, base: Complex, way: _Way
) -> Iterator[tuple[float, float, Numbers]]:
    """The rms error left [pu], the likeliest length of the smoothing [s] and what was lost.

    ``base``: what the device does by the recorded voltage. None if it cannot run, or a straight line promises too
    little."""
    recording = near.recording
    of, smoothing, lost = way.of, way.smoothing, way.lost
    with device.trials.trial(
        f"{of.name} smoothed over {1000 * smoothing.length:g} ms", of_reading=True
    ):
        moves = (device.play(way.recording, near.start).power - base) / way.part
        off = recording.power - base
        good = recording.good
        size = float(np.sum(np.abs(moves[good]) ** 2))
        scale = float(np.real(np.vdot(moves[good], off[good]))) / size if size > 0 else 0.0
        promised = rms((off - scale * moves)[good])
        if promised > _PROMISES * rms(off[good]) or scale * smoothing.length < _SHORTEST:
            return
        power = device.play(_sharper(recording, of, scale * lost), near.start).power
        yield math.hypot(*rms_error(power, near)), scale * smoothing.length, scale * lost


def _sharper(recording: Recording, part: SmoothedPart, lost: Numbers) -> Recording:
    return replace(recording, voltage=np.asarray(recording.voltage * np.exp(part.way * lost)))


def _lag(interval: float) -> int:
    return max(1, round(_ABRUPT / interval))


def _slope(values: Numbers, interval: float) -> Numbers:
    """The derivative of recorded values [1/s], over a few milliseconds around each sample."""
    lag = _lag(interval)
    low = np.clip(np.arange(len(values)) - lag // 2, 0, len(values) - 1)
    high = np.clip(low + lag, 0, len(values) - 1)
    return np.asarray((values[high] - values[low]) / (lag * interval))


def _fastest(values: Numbers, recording: Recording) -> float:
    lag = _lag(recording.interval)
    return float(np.abs(values[lag:] - values[:-lag]).max(initial=0.0))

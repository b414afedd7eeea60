"""Magnitude and angle of the voltage that a recorder takes by two clocks: at an event both jump, one of them late.

A switching in the grid turns and shortens a phasor at once. So the jumps of both tell by which time they are apart, and
the device tells which of the two is the late one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.event import (
    EventComparison,
    RecordedEvent,
    cut_event,
    rms_error,
)
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.windows import Windows

_LONGEST_INTERVAL = 0.002  # between samples [s]: slower ones are means that blur a jump
_OVER = 0.003  # time over which a jump is taken [s]
_NEAR = 0.1  # time before and after the event that is looked at [s]
_MOST = 0.06  # longest delay that is looked for [s]
_LEAST_DELAY = 0.004  # [s]: a jump over a few samples tells no less
_LEAST_ERROR = 0.003  # rms error [pu] below which nothing is tried
_ALIKE = 0.5
"""Correlation of both parts' jumps at the delay, at least.

Of five recordings of faults and load steps 1 ms apart, with one part 20 ms late, it was 0.59 to 1.0. Behind a lag one
part seemed late by 10 ms and more at up to 0.44."""
_STANDS_OUT = 0.4  # part of it that they have without the delay at most: of those five it was 0.14
_LEAVES = 0.6  # part of the error that is left once both are of one time, to be named
_BEFORE = 0.5  # part of the recording before the event with which the device is tried [s]
_AFTER = 2.0  # part after its begin, the same [s]


def ask_of_voltage_clocks(comparison: EventComparison) -> Iterator[tuple[float, Question]]:
    """Ask about a magnitude or an angle that is later than the other one, with the part of the error that is left."""
    event, device = comparison.event, comparison.device
    delay = delay_of_magnitude(event.recording, event.windows)
    near = cut_event(event, _AFTER, _BEFORE)
    here = math.hypot(*rms_error(comparison.near_power(near), near))
    if not delay or here < _LEAST_ERROR:
        return

    def error_with(of: RecordedEvent, part: str) -> float:
        found = math.inf
        tried = f"the voltage's {part} {1000 * abs(delay):.3g} ms away"
        with device.trials.trial(tried, of_reading=True):
            other = _move_part(of.recording, part, delay)
            found = math.hypot(*rms_error(device.play(other, of.start).power, of))
        return found

    lefts = {part: error_with(near, part) for part in ("magnitude", "angle")}
    part = min(lefts, key=lambda one: lefts[one])
    if lefts[part] > _LEAVES * here:
        return
    error, rest = math.hypot(*rms_error(comparison.played.power, event)), error_with(event, part)
    if rest <= _LEAVES * error:
        late = delay if part == "magnitude" else -delay
        figures = {"which": f"V's {part}", "delay": late, "error": error, "left": rest}
        yield rest / error, Question(QuestionKind.CLOCKS, figures | {"together": 0, "signals": []})


def delay_of_magnitude(recording: Recording, windows: Windows) -> float:
    """Return how much later than the angle's the magnitude's jumps come [s], negative where the angle's do.

    0 where a recording does not tell: it has no such jumps, or both at once."""
    interval = recording.interval
    if recording.instantaneous or interval > _LONGEST_INTERVAL or not windows.seen:
        return 0.0
    over, most = (max(1, round(one / interval)) for one in (_OVER, _MOST))
    times = recording.times[:-over]
    part = (times > windows.begin - _NEAR) & (times < windows.end + _NEAR)
    if part.sum() <= 2 * most:
        return 0.0
    magnitude, angle = (_jumps(one, over)[part] for one in _parts(recording.voltage))
    size = math.sqrt(float(magnitude @ magnitude) * float(angle @ angle))
    if size == 0:
        return 0.0
    alike = np.correlate(magnitude, angle, "full")[len(angle) - 1 - most : len(angle) + most] / size
    best = int(alike.argmax())
    delay = (best - most) * interval
    told = alike[best] >= _ALIKE and alike[most] <= _STANDS_OUT * alike[best]
    return float(delay) if told and _LEAST_DELAY <= abs(delay) < _MOST else 0.0


def _parts(voltage: Complex) -> tuple[Numbers, Numbers]:
    """The magnitude's logarithm and the angle [rad]."""
    size = np.maximum(np.abs(voltage), np.finfo(float).tiny)
    return np.asarray(np.log(size)), np.asarray(np.unwrap(np.angle(voltage)))


def _jumps(values: Numbers, over: int) -> Numbers:
    """The squares of changes over so many samples, less the usual one: what swings or rings beside a jump is little."""
    changes = values[over:] - values[:-over]
    away = np.abs(changes - np.median(changes))
    return np.asarray(np.maximum(away - np.median(away), 0.0) ** 2)


def _move_part(recording: Recording, part: str, delay: float) -> Recording:
    """The recording with its magnitude earlier by a delay, or with its angle later by it [s]."""
    magnitude, angle = np.abs(recording.voltage), np.unwrap(np.angle(recording.voltage))
    times = recording.times
    if part == "magnitude":
        magnitude = np.interp(times + delay, times, magnitude)
    else:
        angle = np.interp(times - delay, times, angle)
    return replace(recording, voltage=np.asarray(magnitude * np.exp(1j * angle)))

"""Other ways to read a recording, tried where the device does not do as it says: turned signs, other units, clocks.

Each is judged by the device itself: it starts and runs again as the recording would then have it, and a reading is
named only where most of the error goes away with it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.errors import CosimError
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import (
    EventComparison,
    RecordedEvent,
    prepare_event,
    rms_error,
    rms_movement,
)
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import PortBases, Recording

_OFF = (
    0.25  # part of the movement by which a response is off, from which on other readings are tried
)
_NOISY = 1.5  # times the scatter before the event, which is not the response's
_LEAST_OFF = 0.003  # rms error [pu] below which nothing is tried
_EXPLAINS = 0.35  # part of the error that a reading may leave, to be named
_RADIAN = 180 / math.pi  # [deg]
_LEAST_CLOCK = 0.004  # delay [s] that is named, and at least
_SAMPLES_CLOCK = 0.6  # so many samples
_ALIKE = 0.25  # part by which the delays of P and Q may differ and be one clock's
_CLOCK_LEAVES = 0.6  # part of the error that is left once the clocks are alike, to be named


@dataclass(frozen=True)
class Reading:
    """Another way to read a recording: what is changed, and how ``--channel`` says so."""

    name: str
    roles: tuple[str, ...]
    factor: float
    change: Callable[[Recording], Recording]


def _power(p: float, q: float) -> Callable[[Recording], Recording]:
    """A change of P and Q by factors."""

    def changed(recording: Recording) -> Recording:
        power = p * recording.power.real + 1j * q * recording.power.imag
        return replace(recording, power=np.asarray(power))

    return changed


def _angle(factor: float) -> Callable[[Recording], Recording]:
    def changed(recording: Recording) -> Recording:
        angle = np.unwrap(np.angle(recording.voltage))
        turned = np.abs(recording.voltage) * np.exp(1j * factor * angle)
        return replace(recording, voltage=np.asarray(turned))

    return changed


READINGS = (
    Reading("P counts into the plant", ("p",), -1, _power(-1, 1)),
    Reading("Q counts into the plant", ("q",), -1, _power(1, -1)),
    Reading("P and Q count into the plant", ("p", "q"), -1, _power(-1, -1)),
    Reading("P and Q are of one phase", ("p", "q"), 3, _power(3, 3)),
    Reading("the angle is in radians", ("angle",), _RADIAN, _angle(_RADIAN)),
    Reading("the angle is in degrees", ("angle",), 1 / _RADIAN, _angle(1 / _RADIAN)),
    Reading("the angle has the other sign", ("angle",), -1, _angle(-1)),
)


def question_readings(comparison: EventComparison, bases: PortBases) -> list[Question]:
    """Return what another reading of the recording, or another clock, would explain."""
    event = comparison.event
    error, moved = rms_error(comparison.played.power, event), rms_movement(event)
    scatter = (comparison.noise["p"].scatter, comparison.noise["q"].scatter)
    excess = [max(e * e - (_NOISY * n) ** 2, 0) ** 0.5 for e, n in zip(error, scatter, strict=True)]
    off = [one > max(_LEAST_OFF, _OFF * way) for one, way in zip(excess, moved, strict=True)]
    named = _likeliest(comparison, bases, math.hypot(*error)) if any(off) else []
    return named or _clock(comparison, math.hypot(*error))


def _likeliest(comparison: EventComparison, bases: PortBases, error: float) -> list[Question]:
    """The one reading that explains the most, where it explains enough."""
    event, device = comparison.event, comparison.device
    tried = [
        (left, reading)
        for reading in READINGS
        if set(reading.roles) <= event.recording.channels.keys()
        for left in _error_left(device, event, reading, bases)
    ]
    if not tried:
        return []
    left, best = min(tried, key=lambda one: one[0])
    if left > _EXPLAINS * error:
        return []
    channels = event.recording.channels
    remedy = [channels[role].changed(factor=round(best.factor, 6)) for role in best.roles]
    figures = {"reading": best.name, "error": error, "left": left, "remedy": remedy}
    return [Question(QuestionKind.READ_OTHERWISE, figures)]


def _error_left(
    device: PlayedDevice, event: RecordedEvent, reading: Reading, bases: PortBases
) -> Iterator[float]:
    """The rms error that a reading leaves; nothing where the device cannot start so.

    The error is counted per unit of the power as it would then be read."""
    windows = event.windows
    try:
        changed = prepare_event(reading.change(event.recording), bases, windows)
        played = device.play(changed.recording, changed.start)
    except CosimError:
        return
    scale = abs(reading.factor) if reading.factor == 3 else 1.0
    yield math.hypot(*rms_error(played.power, changed)) / scale


def _clock(comparison: EventComparison, error: float) -> list[Question]:
    """P and Q that come later than the model's by one time, which takes most of the error away."""
    event = comparison.event
    interval = event.recording.interval
    delays = [one.delay for one in comparison.signals.values() if one.delay is not None]
    if not delays:
        return []
    delay = float(np.mean(delays))
    least = max(_LEAST_CLOCK, _SAMPLES_CLOCK * interval)
    if abs(delay) < least or np.ptp(delays) > max(_ALIKE * abs(delay), interval):
        return []
    times = event.recording.times
    shifted = np.interp(times - delay, times, comparison.played.power)
    left = math.hypot(*rms_error(np.asarray(shifted), event))
    if left > _CLOCK_LEAVES * error:
        return []
    figures = {"delay": delay, "error": error, "left": left, "together": len(delays)}
    return [Question(QuestionKind.CLOCKS, figures)]

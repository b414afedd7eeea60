"""Questions on the angle of a recording, by itself: degrees or radians, an angle that is held, and one that is not the
integral of the frequency beside it.

Where the device has to run to know, as of another sign or another side of a transformer, `hypotheses` asks."""

import math
from collections.abc import Iterator

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.studies.validation.channels import RecordedChannel
from orchestrator.studies.validation.questions import Question, QuestionKind

_RADIANS = 2 * np.pi  # of a turn
_DEGREES = 360.0  # of a turn
_BEYOND = 1.01  # turns from which on an angle is beyond one, with its rounding

_NEAR_A_TURN = 0.2  # part of a turn by which a jump of the angle may miss a whole one
_AS_BESIDE = 3.0  # times the largest change beside it, by which an angle moves while it wraps
_BESIDE_WRAP = 4  # changes before and after it that are looked at
_LEAST_CHANGE = 1e-3  # part of a turn by which an angle may change while it wraps, be it at rest

_MOVES = 1e-6
"""Part of its range from which on an angle moves: more than rounding makes of an angle at rest."""
_HELD = 0.2  # part of the samples with the angle of the sample before, from which on it is held

_AT_REST = 1e-3  # range [rad] of an angle, or of a frequency's integral, that moves no power
_STRAIGHT = 1e-5  # range [rad] of an angle beside its straight line, below which it tells nothing
_SAME = (0.5, 2.0)  # factors between an angle and its frequency's integral that may be one's own
_OTHER_REFERENCE = math.radians(3.0)
"""Movement [rad] of an angle beyond its frequency's integral: noise of 1 mHz and a filter of 0.3 s make less."""
_OF_JUMP = 0.2  # part of the largest jump of an angle, which a filtered frequency follows late
_JUMPS_WITHIN = 0.1  # [s]
_MOST_SAMPLES = 20, 80  # percentiles within which samples count: a fault lasts for a moment
_UNEXPLAINED = 0.5  # part of the angle that its frequency's integral may leave, to name a factor


def questions_of_unit(raw: Numbers, unit: str, channel: RecordedChannel) -> Iterator[Question]:
    """Ask about an angle that wraps by a turn of the other unit, or begins beyond a turn of its own.

    ``raw``: as recorded, in ``unit``, deg or rad."""
    steps = np.diff(raw[np.isfinite(raw)])
    in_degrees = unit == "deg"
    wraps = _wraps(steps, _RADIANS if in_degrees else _DEGREES)
    if in_degrees and _largest(raw) > _BEYOND * _RADIANS:
        wraps = False  # radians that wrap stay within a turn
    if wraps or (not in_degrees and _largest(raw[:5]) > _BEYOND * _RADIANS):
        other = "rad" if in_degrees else "deg"
        figures = {"jump": float(np.abs(steps).max(initial=0.0)), "unit": other}
        yield Question(QuestionKind.ANGLE_UNIT, figures | {"remedy": channel.changed(unit=other)})


def questions_of_hold(angle: Numbers) -> Iterator[Question]:
    """Ask about an angle [rad] that stands at its last value for many of its samples.

    An angle that has not begun to move is not held: the count begins with the first that moves."""
    known = angle[np.isfinite(angle)]
    if not len(known):
        return
    moved = np.abs(known - known[:1]) > _MOVES * np.ptp(known)
    begin = int(np.argmax(moved)) if moved.any() else 0
    held = float(np.mean(np.diff(known[begin:]) == 0))
    if float(np.ptp(known)) > _AT_REST and held > _HELD:
        yield Question(QuestionKind.ANGLE_HELD, {"part": held})


def questions_beside_frequency(
    times: Numbers,
    angles: tuple[Numbers, Numbers],
    channel: RecordedChannel,
    frequency: RecordedChannel,
) -> Iterator[Question]:
    """Ask about an angle that is not the integral of its own frequency: of another unit, sign or reference.

    ``angles``: the recorded one, and the frequency's integral [rad]."""
    angle, integrated = angles
    known = np.isfinite(angle)
    line = np.vander(times[known], 2)
    own, other = (
        x - line @ np.linalg.lstsq(line, x, rcond=None)[0]
        for x in (angle[known], integrated[known])
    )
    if np.ptp(other) < _AT_REST or np.ptp(own) < _STRAIGHT:
        return
    factor = float(own @ other / (other @ other))
    rest = float(np.std(own - factor * other) / np.std(own))
    if not _SAME[0] < factor < _SAME[1] and rest < _UNEXPLAINED:
        remedy = channel.changed(factor=round(1 / factor, 6))
        yield Question(QuestionKind.ANGLE_AND_FREQUENCY, {"factor": factor, "remedy": remedy})
        return
    apart = _beyond_filter(times[known], own, other)
    if apart > max(_OTHER_REFERENCE, _OF_JUMP * _largest_jump(times[known], own)):
        figures = {"apart": math.degrees(apart), "remedy": frequency.as_text()}
        yield Question(QuestionKind.ANGLE_REFERENCE, figures)


def _beyond_filter(times: Numbers, own: Numbers, other: Numbers) -> float:
    """How far an angle moves beyond its frequency's integral [rad], but for moments and for what a filter makes.

    A filtered frequency gives an angle behind a lag: the derivatives of the integral stand for that."""
    slope = np.gradient(other, times)
    columns = np.column_stack([slope, np.gradient(slope, times)])
    rest = own - other
    rest = rest - columns @ np.linalg.lstsq(columns, rest, rcond=None)[0]
    low, high = np.percentile(rest, _MOST_SAMPLES)
    return float(high - low)


def _largest_jump(times: Numbers, angle: Numbers) -> float:
    """The largest change of an angle over a short time [rad]."""
    lag = max(1, round(_JUMPS_WITHIN / float(np.median(np.diff(times)))))
    return float(np.abs(angle[lag:] - angle[:-lag]).max(initial=0.0))


def _largest(values: Numbers) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0))


def _wraps(steps: Numbers, turn: float) -> bool:
    """Return whether the largest change of an angle is a wrap: without the turn it changes as it does beside it.

    A jump of the phase does not, be it as large as a turn of another unit by chance."""
    if not len(steps):
        return False
    at = int(np.abs(steps).argmax())
    rest = abs(abs(float(steps[at])) - turn)
    beside = np.delete(
        np.abs(steps[max(0, at - _BESIDE_WRAP) : at + _BESIDE_WRAP + 1]), min(at, _BESIDE_WRAP)
    )
    moves = _AS_BESIDE * float(beside.max(initial=0.0)) + _LEAST_CHANGE * turn
    return rest < min(moves, _NEAR_A_TURN * turn)

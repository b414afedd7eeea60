"""A setpoint that changed while an event was recorded: P or Q leaves the model's, and the voltage does not tell why."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from orchestrator.core.arrays import Complex, Matrix, Numbers
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.windows import Windows

_OFFSET = 0.015  # error that stays [pu]
_BACK = 0.005  # deviation of the voltage [pu] that is none of an event
_WITHIN = 0.1  # time [s] within which a setpoint moves P or Q by most of its step
_ABRUPT = 6.0  # times the usual change over that time
_BESIDE = 0.4  # part of the step by which the signal moves just before or after, as a swing does
_SHORTEST_AFTER = 0.3  # time [s] for which a change is seen to stay
_MOST_BLOCKS = 80  # means over some time, between which ramps are looked for
_SHORTEST_RAMP = 0.2  # [s]
_BEFORE_RAMP = 0.3  # time [s] for which the model is seen to be right before a ramp
_RIGHT_BEFORE = 0.15  # part of a ramp by which the model may be off before it
_STRAIGHT = 0.06  # part of a ramp by which the error may be off its straight lines (rms)
_SETTLED = (
    0.5  # time [s] after an event, from which on a setpoint that changed in it has moved P or Q
)
_CONSTANT = 0.02  # part of an offset by which the error may be off it (rms of means over some time)
_WORSE = 3.0  # times that, by which the voltage is worse at explaining it


def ask_of_setpoint(recording: Recording, windows: Windows, simulated: Complex) -> list[Question]:
    """P or Q that leaves the model's, at once or along a straight line, for good while the voltage does nothing.

    An error that shrinks is the end of a transient, in which the model was off. Figure ``stop``: the end of the part
    before, in which no mean over some time holds anything of the change [s]."""
    error = simulated - recording.power
    event_end = windows.end if windows.first_end is None else windows.first_end
    first = int(np.searchsorted(recording.times, event_end + _WITHIN))
    found = []
    for name, values in (("p", error.real), ("q", error.imag)):
        found += [*_steps(recording, name, values, first), *_ramps(recording, name, values, first)]
    found = found or [
        *_within_event(recording, windows, "p", error.real),
        *_within_event(recording, windows, "q", error.imag),
    ]
    return found[:1]


def without_step(recording: Recording, question: Question) -> Recording:
    """A recording without the step of P or Q that is asked about."""
    figures = question.figures
    moved = recording.times + recording.begin >= figures["at"] - recording.interval / 2
    axis = 1.0 if figures["signal"] == "p" else 1j
    power = recording.power - figures["offset"] * axis * moved
    return replace(recording, power=np.asarray(power))


def _within_event(
    recording: Recording, windows: Windows, name: str, values: Numbers
) -> Iterator[Question]:
    """An error that is none before the event, and the same from then on, whatever frequency and voltage do.

    A droop or a gain that is wrong moves with them. Figure ``within``: no part after it is without the step."""
    times, good = recording.times, recording.good
    before, after = good & (times < windows.begin), good & (times > windows.end + _SETTLED)
    if times[-1] - windows.end - _SETTLED < _SHORTEST_AFTER or not before.any():
        return
    level, offset = float(values[before].mean()), float(values[after].mean())
    if abs(offset) < _OFFSET or abs(level) > _RIGHT_BEFORE * abs(offset):
        return
    count = max(1, round(_WITHIN / recording.interval))
    magnitude, angle = np.abs(recording.voltage), np.unwrap(np.angle(recording.voltage))
    error, *columns = (
        _means(one[after], count)
        for one in (
            values,
            magnitude - magnitude[before].mean(),
            np.gradient(angle),
            angle - angle[before].mean(),
        )
    )
    rest = float(np.std(error))
    beside = _error_beside(np.column_stack(columns), error)
    if rest > _CONSTANT * abs(offset) or beside < _WORSE * rest:
        return
    begin = int(np.searchsorted(times, windows.begin))
    stop = int(np.searchsorted(times, windows.end + _SETTLED))
    part = values[begin:stop]
    costs = [
        float(part[:k] @ part[:k] + np.sum((part[k:] - offset) ** 2)) for k in range(len(part))
    ]
    at = recording.begin + float(times[begin + int(np.argmin(costs))])
    yield Question(
        QuestionKind.SETPOINT, {"signal": name, "offset": -offset, "at": at, "within": True}
    )


def _steps(recording: Recording, name: str, values: Numbers, first: int) -> Iterator[Question]:
    width = max(1, round(_WITHIN / recording.interval))
    means = np.convolve(values, np.ones(width) / width, mode="valid")
    steps = np.abs(means[width:] - means[:-width])[first:]
    if len(steps) < 4 * width:
        return
    at = first + int(steps.argmax())
    before, after = values[max(0, at - 2 * width) : at], values[at + 2 * width :]
    if len(after) * recording.interval < _SHORTEST_AFTER:
        return
    offset = float(after.mean() - before.mean())
    leaves = abs(after.mean()) > abs(before.mean())
    abrupt = float(steps.max()) > _ABRUPT * float(np.median(steps)) + _OFFSET
    abrupt = abrupt and leaves and _stands_alone(steps, width)
    around = recording.voltage[at : at + 2 * width]
    if abrupt and abs(offset) > _OFFSET and np.ptp(np.abs(around)) < _BACK:
        moment = recording.begin + float(recording.times[at + width])
        figures = {"signal": name, "offset": -offset, "at": moment, "stop": moment - _WITHIN}
        yield Question(QuestionKind.SETPOINT, figures)


def _stands_alone(steps: Numbers, width: int) -> bool:
    """Return whether the largest change stands alone: a swing changes as fast before or after."""
    at = int(steps.argmax())
    low, high = 3 * width // 2, 4 * width
    beside = [steps[max(0, at - high) : max(0, at - low)], steps[at + low : at + high]]
    return float(np.concatenate(beside).max(initial=0.0)) < _BESIDE * float(steps[at])


def _ramps(recording: Recording, name: str, values: Numbers, first: int) -> Iterator[Question]:
    """An error that is none, grows along a straight line, and stays, unlike anything that the voltage does."""
    count = max(1, round((len(values) - first) / _MOST_BLOCKS))
    if (len(values) - first) // count < _MOST_BLOCKS // 4:
        return
    angle = np.unwrap(np.angle(recording.voltage))
    blocks = [
        _means(one[first:], count)
        for one in (recording.times, values, np.abs(recording.voltage), np.gradient(angle), angle)
    ]
    times, error = blocks[0], blocks[1]
    if np.ptp(error) < _OFFSET:
        return
    rest, shape, ends = _straightest(times, error)
    level, size = np.linalg.lstsq(np.column_stack([np.ones_like(shape), shape]), error, rcond=None)[
        0
    ]
    if (
        abs(size) < _OFFSET
        or abs(level) > _RIGHT_BEFORE * abs(size)
        or rest > _STRAIGHT * abs(size)
    ):
        return
    columns = [np.ones_like(times), *blocks[2:]]
    if _error_beside(np.column_stack(columns[:-1]), error) < _WORSE * rest:
        return
    # the angle by itself, which is the sum of all that the frequency was off: a control that sums it up moves P so
    drifts = _error_beside(np.column_stack(columns), error) < _WORSE * rest
    begin, until = (recording.begin + float(one) for one in ends)
    stop = begin - max(_WITHIN, count * recording.interval)
    figures = {"signal": name, "offset": -float(size), "at": begin, "until": until, "stop": stop}
    yield Question(QuestionKind.SETPOINT, figures | {"drifts": drifts})


def _straightest(times: Numbers, error: Numbers) -> tuple[float, Numbers, tuple[float, float]]:
    """The ramp that leaves the least of an error: the rms left, its shape from 0 to 1, begin and end [s]."""
    best = (np.inf, np.zeros_like(times), (0.0, 0.0))
    deviation = error - error.mean()
    for low in times[times - times[0] >= _BEFORE_RAMP]:
        highs = times[times - low >= _SHORTEST_RAMP]
        if not len(highs):
            break
        shapes = np.clip((times - low) / (highs - low)[:, None], 0.0, 1.0)
        moved = shapes - shapes.mean(axis=1, keepdims=True)
        sizes = moved @ deviation / np.sum(moved**2, axis=1)
        left = np.sqrt(np.mean((deviation - sizes[:, None] * moved) ** 2, axis=1))
        at = int(left.argmin())
        if left[at] < best[0]:
            best = (float(left[at]), shapes[at], (float(low), float(highs[at])))
    return best


def _error_beside(columns: Matrix, error: Numbers) -> float:
    """The rms error that a sum of columns leaves."""
    rest = error - columns @ np.linalg.lstsq(columns, error, rcond=None)[0]
    return float(np.sqrt(np.mean(rest**2)))


def _means(values: Numbers, count: int) -> Numbers:
    """Means of so many samples after one another."""
    whole = values[: len(values) // count * count]
    return np.asarray(whole.reshape(-1, count).mean(axis=1))

"""How far a cause that was found while the model was held in step holds in plain play-back, and with which value.

While it is held in step, a right model leaves something as well: what gives way. So its value is off by a little, and
what it leaves says nothing of another cause. In plain play-back the same model follows the plant until what no sample
holds makes it fall. Of that part the value is found again, and what it leaves there is judged by the recording's noise.

There is no interval for it: at the limit of the current a fit's counts the noise of the samples, and missed the value
of the plant by up to four of its half widths in nine fits to parts of three runs (0.9296 to 0.9304 in place of 0.93):
what the voltage does between the samples moves the model by more than that noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.late import optimize
from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.validation.cause_bench import CauseBench, squares_of
from orchestrator.studies.validation.causes import EXPLAINS, CauseKind, Explanation
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import RecordedEvent, cut_event, rms_error
from orchestrator.studies.validation.parameters import adjustable
from orchestrator.studies.validation.residuals import Report

_MEAN = 0.02  # time over which the error is looked at, a period of 50 Hz [s]
_FOLLOWS = (
    0.05  # part of the plant's largest movement by which a model that follows it is off at most
)
_LEAST_OFF = (
    0.003  # power [pu of the rating] by which it may be off as well, as samples and steps make
)
_SHORTEST = 0.1  # time after the event's begin [s] that shows a response, and in which a value is found again
_AROUND = (0.05, 0.005, 0.0005)
"""Parts of a value, to each side, in which it is found again: held in step it is off by less than the first. Then in
longer parts, up to where the model leaves with the value that was found in the one before."""

_LOOKS = 21  # values within these: beside the lowest valley there may be others
_FINEST = 1e-5  # part of a value to which it is found again
_REFUSED = 1e3  # squared error [pu²] of a value with which the device does not run


@dataclass(frozen=True)
class PlainPart:
    """The part of a recording in which the model follows the plant with a cause's values, without being held.

    ``until``: its end [s of the recording]; ``error``, ``left``: rms error of P and Q in it with the model's own values
    and with these [pu of the rating]; ``noise``: the recording's own [pu of the rating]."""

    recording: str
    values: dict[str, float | bool]
    until: float
    to_end: bool  # whether the model follows to the recording's end
    shows: bool  # whether the part is long enough to show a response
    error: float = 0.0
    left: float = 0.0
    noise: float = 0.0

    @property
    def confirms(self) -> bool:
        """Return whether the values take most of the squared error of the part away, or all but its noise."""
        if not self.shows:
            return False
        rest = max(self.left**2 - self.noise**2, 0.0)
        return rest <= (1 - EXPLAINS) * max(self.error**2 - self.noise**2, 0.0)

    def as_json(self) -> dict[str, Any]:
        return asdict(self) | {"confirms": self.confirms}


def plain_part(
    device: PlayedDevice,
    events: Sequence[RecordedEvent],
    cause: Explanation,
    report: Report = lambda text: None,
) -> PlainPart | None:
    """The part of the event with the largest error in which a cause's values hold in plain play-back.

    None where the device does not run with them, or the cause has none, as a delay."""
    event = max(events, key=lambda one: _error_of(device, one))
    bench = CauseBench(device, [event], report)
    best: tuple[PlainPart, RecordedEvent] | None = None
    values = dict(cause.values)
    for around in _AROUND:
        responses = bench.responses(values) if values else None
        if responses is None:
            break
        found, part = _part(event, responses[0], values)
        if best is not None and found.until <= best[0].until:
            break
        best = found, part
        numbers = _at_one_value(bench, cause)
        if found.to_end or not numbers:
            break
        at_least = cut_event(event, max(found.until - _begin_of(event), _SHORTEST))
        values = values | _found_again(device.with_values(values), at_least, numbers, around)
    if best is None or not best[0].shows:
        return best and best[0]
    return _with_errors(best[0], CauseBench(device, [best[1]], report))


def _part(
    event: RecordedEvent, power: Complex, values: dict[str, float | bool]
) -> tuple[PlainPart, RecordedEvent]:
    """The part up to where a response leaves the plant, still without its errors."""
    recording, begin = event.recording, event.windows.begin
    leaves = _leaves_at(event, power)
    until = recording.length if leaves is None else leaves
    found = PlainPart(
        recording.label,
        values,
        until=recording.begin + until,
        to_end=leaves is None,
        shows=until >= begin + _SHORTEST - recording.interval,
    )
    return found, event if leaves is None else cut_event(event, until - begin)


def _leaves_at(event: RecordedEvent, power: Complex) -> float | None:
    """When a response is off by more than a model that follows may be [s]; None where it follows to the end."""
    recording = event.recording
    width = max(1, round(_MEAN / recording.interval))
    first = int(event.windows.begin / recording.interval)
    moved = _means(recording.power - event.start.power, width)[first:]
    off = _means(power - recording.power, width)[first:]
    most = max(_FOLLOWS * float(moved.max(initial=0.0)), _LEAST_OFF)
    far = np.flatnonzero(off > most)
    return float(recording.interval * (first + far[0])) if len(far) else None


def _means(values: Complex, width: int) -> Numbers:
    """Magnitudes of the means over so many samples, each of those from one on."""
    return np.asarray(np.abs(np.convolve(values, np.ones(width) / width, mode="valid")))


def _at_one_value(bench: CauseBench, cause: Explanation) -> list[VariableInfo]:
    """The number that is found again, with those that have its value; none of a position, or of two by themselves."""
    names = [cause.name, *cause.beside]
    if cause.cause is not CauseKind.VALUE or any(x != cause.value for x in cause.beside.values()):
        return []
    return [bench.device.description.variables[name] for name in names]


def _found_again(
    device: PlayedDevice, part: RecordedEvent, numbers: Sequence[VariableInfo], around: float
) -> dict[str, float | bool]:
    """The one value of some numbers that leaves the least in a part, as it is written for a command.

    ``around``: part of their value, to each side, in which it is looked for."""
    bench = CauseBench(device, [part], lambda text: None)
    ranges = [adjustable(device, info, None) for info in numbers]
    start = ranges[0].start
    low = max(start - around * abs(start), *(one.low for one in ranges))
    high = min(start + around * abs(start), *(one.high for one in ranges))

    def squares_at(value: float) -> float:
        found = bench.responses(dict.fromkeys((one.name for one in numbers), value))
        return _REFUSED if found is None else squares_of(bench.errors(found))

    looked = np.linspace(low, high, _LOOKS)
    bench.announce(dict.fromkeys((one.name for one in numbers), float(x)) for x in looked)
    least = int(np.argmin([squares_at(float(one)) for one in looked]))
    near = float(looked[max(least - 1, 0)]), float(looked[min(least + 1, _LOOKS - 1)])
    best = optimize.minimize_scalar(
        squares_at, bounds=near, method="bounded", options={"xatol": _FINEST * abs(start)}
    )
    return dict.fromkeys((one.name for one in numbers), float(f"{best.x:.4g}"))


def _with_errors(found: PlainPart, bench: CauseBench) -> PlainPart:
    responses = bench.responses(found.values)
    if responses is None:
        return found
    left = bench.errors(responses)
    error, rest = (float(np.sqrt(squares_of(one))) for one in (bench.error, left))
    return replace(found, error=error, left=rest, noise=bench.noise)


def _begin_of(event: RecordedEvent) -> float:
    """When the event begins, by the recording's times [s]."""
    return event.recording.begin + event.windows.begin


def _error_of(device: PlayedDevice, event: RecordedEvent) -> float:
    """The rms error of plain play-back [pu of the rating]."""
    return float(np.hypot(*rms_error(device.play(event.recording, event.start).power, event)))

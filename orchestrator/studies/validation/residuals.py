"""The errors of a device at events as one vector, in units of the recordings' scatter, and how parameters move it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from orchestrator.core.arrays import Complex, Matrix, Numbers, Vector
from orchestrator.core.errors import CosimError, InputError
from orchestrator.studies.validation.correlation import correlation_length
from orchestrator.studies.validation.device import Play, PlayedDevice
from orchestrator.studies.validation.event import RecordedEvent, noise_before
from orchestrator.studies.validation.hidden import (
    HiddenVoltage,
    hidden_voltages,
    jumps_of,
    likelihoods,
    with_hidden,
)
from orchestrator.studies.validation.record import Recording

Values = Mapping[str, float | bool]
Report = Callable[[str], None]

LEAST_SCATTER = 2e-4
"""[pu]: a recording is not trusted more than an instrument of the best class."""

_GAIN = 1e-3  # gain error of instruments of the best usual class, 0.1: no mean over samples takes it away
_SLOW = 0.005  # interval between samples [s], from which on it matters what the voltage does between them
_REFUSED = 1e3  # error, in scatters, of values with which the device does not run


@dataclass(frozen=True)
class ErrorRows:
    """The samples of one event in the vector: P first, then Q."""

    event: RecordedEvent
    rows: Vector  # of the recording, thinned to samples that tell something each
    weights: tuple[float, float]  # 1/scatter of P and Q [1/pu]

    @property
    def size(self) -> int:
        return 2 * len(self.rows)


@dataclass
class Residuals:
    """Errors of one device at some events; a run is made for each event and each set of values.

    ``hidden``: parts of the voltage that no sample holds, unknowns whose likelihoods are the last rows."""

    device: PlayedDevice
    stretches: Sequence[ErrorRows]
    report: Report = lambda text: None
    _made: int = 0
    hidden: Sequence[HiddenVoltage] = field(init=False)
    _moved: dict[tuple[object, ...], Recording] = field(default_factory=dict)
    _kept: dict[tuple[tuple[str, float | bool], ...], Numbers] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.hidden = hidden_voltages([one.event for one in self.stretches])

    @property
    def runs(self) -> int:
        """How many runs were made, those in longer steps among them."""
        return self._made + (0 if self.rough is self else self.rough.runs)

    @cached_property
    def rough(self) -> Residuals:
        """The same in longer steps, where the device takes any: good enough to see where a fit goes."""
        device = self.device.rough
        return self if device is self.device else Residuals(device, self.stretches, self.report)

    def at(self, values: Values) -> Numbers:
        """Errors with other values, in scatters; those of values with which the device does not run are large."""
        key = tuple(sorted(values.items()))
        if key not in self._kept:
            device = self._device_with(values)
            parts = [self._of(device, k, values) for k in range(len(self.stretches))]
            self._kept[key] = np.concatenate([*parts, likelihoods(self.hidden, values)])
        return self._kept[key]

    def announce(self, each: Sequence[Values]) -> None:
        """Tell with which values errors will be asked for, one after the other: runs may be made side by side."""
        self._moved.clear()
        anew = [one for one in each if tuple(sorted(one.items())) not in self._kept]
        plays = [
            Play(self._device_with(values), self._recording(k, values), stretch.event.start)
            for values in anew
            for k, stretch in enumerate(self.stretches)
        ]
        self.device.announce(plays)

    def _device_with(self, values: Values) -> PlayedDevice:
        unknown = {one.name for one in self.hidden}
        return self.device.with_values(
            {name: value for name, value in values.items() if name not in unknown}
        )

    def _recording(self, number: int, values: Values) -> Recording:
        """The recording of one event with the hidden parts of its voltage; the same one for the same parts."""
        unknown = [one for one in self.hidden if one.event == number]
        key = (number, *(values.get(one.name) for one in unknown))
        if key not in self._moved:
            recording = self.stretches[number].event.recording
            self._moved[key] = with_hidden(recording, unknown, values)
        return self._moved[key]

    def _of(self, device: PlayedDevice, number: int, values: Values) -> Numbers:
        stretch = self.stretches[number]
        event = stretch.event
        try:
            power = device.play(self._recording(number, values), event.start).power
        except InputError:
            raise
        except CosimError as error:
            device.trials.note("values on the way of the fit", error)
            return np.full(stretch.size, _REFUSED)
        finally:
            self._made += 1
        return weighted(power - event.recording.power, stretch)

    def hidden_later(self, values: Values) -> Numbers:
        """By how much the errors change if all hidden parts of the voltage are one sample later."""
        other = Residuals(self.device, self.stretches, self.report)
        other.hidden = [replace(one, sample=one.sample + 1) for one in self.hidden]
        self._made += len(self.stretches)
        return other.at(values) - self.at(values)

    def doubt_between(self, values: Values) -> Numbers:
        """By how much each error may be the moment of a jump between two samples [scatters]; 0 of slow samples.

        As of a limit: of fast ones that explains an error and makes none. Of slow ones it may be all of an error, and
        would let any model pass."""
        here, doubt = self.at(values), np.zeros(0)
        for part in (0.0, 1.0):
            stretches = [
                one
                if one.event.recording.interval >= _SLOW
                else replace(one, event=replace(one.event, recording=_jumps_at(part)(one.event)))
                for one in self.stretches
            ]
            other = Residuals(self.device, stretches, self.report)
            other.hidden = self.hidden
            self._made += len(self.stretches)
            moved = np.abs(other.at(values) - here)
            doubt = np.maximum(doubt, moved) if len(doubt) else moved
        return doubt

    def of_other_voltages(self, values: Values) -> list[Matrix]:
        """By how much the errors change with what else the voltage may have done between slow samples.

        Two columns each, of which one may be true: all jumps right after the sample before or right before the one
        after, and curves to either side of the straight lines. None for fast samples."""
        here = self.at(values)
        found = []
        for changed in ((_jumps_at(0.0), _jumps_at(1.0)), (_bending,)):
            columns = [self._errors_by(change, values) - here for change in changed]
            if any(column.any() for column in columns):
                found.append(np.column_stack(columns))
        return found

    def _errors_by(self, change: Callable[[RecordedEvent], Recording], values: Values) -> Numbers:
        """Errors by voltages that are changed between samples, where these are slow."""
        stretches = [
            replace(one, event=replace(one.event, recording=change(one.event)))
            if one.event.recording.interval >= _SLOW
            else one
            for one in self.stretches
        ]
        if all(one is other for one, other in zip(stretches, self.stretches, strict=True)):
            return self.at(values)
        other = Residuals(self.device, stretches, self.report)
        other.hidden = self.hidden
        self._made += len(self.stretches)
        return other.at(values)

    def slopes(
        self, values: Values, steps: Mapping[str, float], *, both_sides: bool = True
    ) -> Matrix:
        """How the errors move with each parameter, a column each, by differences to one side or to both."""
        columns = []
        own = {name: float(values[name]) for name in steps}
        ways = (1, -1) if both_sides else (1,)
        self.announce(
            [
                {**values, name: own[name] + way * step}
                for name, step in steps.items()
                for way in ways
            ]
        )
        for name, step in steps.items():
            self.report(f"sensitivity to {name}")
            at = float(values[name])
            high = self.at({**values, name: at + step})
            low = self.at({**values, name: at - step} if both_sides else values)
            columns.append((high - low) / (step + both_sides * step))
        return np.column_stack(columns)

    def hidden_slopes(self, values: Values) -> Matrix:
        """How the errors move with each hidden part of the voltage, a column each [1/pu]."""
        here = self.at(values)
        columns = []
        others = [
            {**values, one.name: float(values.get(one.name, 0.0)) + one.scale}
            for one in self.hidden
        ]
        self.announce(others)
        for one, other in zip(self.hidden, others, strict=True):
            columns.append((self.at(other) - here) / one.scale)
        return np.column_stack(columns) if columns else np.empty((len(here), 0))


def _jumps_at(part: float) -> Callable[[RecordedEvent], Recording]:
    """A change of an event's voltage, which jumps after such a part of an interval."""
    return lambda event: replace(
        event.recording, jumps={sample: part for sample, _ in jumps_of(event)}
    )


def _bending(event: RecordedEvent) -> Recording:
    """An event's voltage along smooth curves between its samples."""
    return replace(event.recording, bends=True)


def weighted(error: Complex, stretch: ErrorRows) -> Numbers:
    seen = error[stretch.rows]
    return np.concatenate([seen.real * stretch.weights[0], seen.imag * stretch.weights[1]])


def stretches_of(device: PlayedDevice, events: Sequence[RecordedEvent]) -> list[ErrorRows]:
    """The events' samples, each weighted by the scatter before its event."""
    found = []
    for event in events:
        recording = event.recording
        noise = noise_before(event, device.play(recording, event.start))
        weights = [1 / max(noise[s].scatter, LEAST_SCATTER) for s in ("p", "q")]
        thin = max(1, int(0.5 * recording.average / recording.interval))
        rows = np.flatnonzero(recording.good)[::thin]
        found.append(ErrorRows(event, rows, (weights[0], weights[1])))
    return found


def means_over(stretches: Sequence[ErrorRows], length: float, errors: Matrix) -> Matrix:
    """Means of errors, or of their slopes, over a time [s], half of it apart; the rows of hidden voltages as they are.

    Each counts as the independent samples in it would, so that the hidden voltages keep their weight."""
    found = []
    begin = 0
    for one in stretches:
        interval = float(np.median(np.diff(one.rows))) * one.event.recording.interval
        width, apart = max(1, round(length / interval)), max(1, round(0.5 * length / interval))
        for _ in range(2):
            part = errors[begin : begin + len(one.rows)]
            total = np.cumsum(np.concatenate([np.zeros_like(part[:1]), part]), axis=0)
            found.append((total[width:] - total[:-width])[::apart] / width * np.sqrt(apart))
            begin += len(one.rows)
    return np.concatenate([*found, errors[begin:]])


def gain_errors(stretches: Sequence[ErrorRows], count: int) -> Matrix:
    """The errors that a wrong gain of the instruments makes, a column each for P and for Q, in scatters."""
    found = []
    for p, q in ((1.0, 0.0), (0.0, 1.0)):
        parts = []
        for one in stretches:
            way: Complex = one.event.recording.power - one.event.start.power
            gained = np.asarray(_GAIN * (p * way.real + 1j * q * way.imag), dtype=np.complex128)
            parts.append(weighted(gained, one))
        column = np.concatenate(parts)
        found.append(np.pad(column, (0, count - len(column))))
    return np.column_stack(found)


def covariance(slopes: Matrix, errors: Numbers, stretches: Sequence[ErrorRows]) -> Matrix:
    """Covariance of the parameters, with errors that are alike from sample to sample.

    The larger of two: errors as one stationary noise of their own correlation, and errors as they are, with their size
    where the parameter acts (Newey and West, Econometrica 55, 1987). Both weigh lags by a triangle. Neither counts
    errors as smaller than the scatter before the event."""
    bread = np.linalg.inv(slopes.T @ slopes)
    stationary, plain = np.zeros_like(bread), np.zeros_like(bread)
    begin = 0
    for one in stretches:
        count = len(one.rows)
        parts = [slice(begin, begin + count), slice(begin + count, begin + 2 * count)]
        scores = np.sum([slopes[part] * errors[part, None] for part in parts], axis=0)
        plain = plain + _summed(scores, max(_reach(errors[part]) for part in parts))
        for part in parts:
            stationary += _toeplitz(slopes[part], errors[part])
        begin += 2 * count
    likely = slopes[begin:].T @ slopes[begin:]
    stationary = stationary + likely
    plain = plain + likely
    factor = len(errors) / max(len(errors) - slopes.shape[1], 1)
    # errors that are smaller than the scatter before the event are luck, or a scatter that no instrument has
    factor *= max(1.0, len(errors) / float(errors @ errors))
    found = [factor * bread @ meat @ bread for meat in (stationary, plain)]
    scale = np.sqrt(np.maximum(np.diag(found[1]) / np.diag(found[0]), 1.0))
    return np.asarray(found[0] * np.outer(scale, scale))


def _reach(errors: Numbers) -> int:
    """Lags [samples] over which errors are alike."""
    return int(min(len(errors) // 4, np.ceil(4 * correlation_length(errors))))


def _summed(scores: Matrix, reach: int) -> Matrix:
    total = scores.T @ scores
    for lag in range(1, reach + 1):
        cross = scores[lag:].T @ scores[:-lag]
        total = total + (1 - lag / (reach + 1)) * (cross + cross.T)
    return np.asarray(total)


def _toeplitz(slopes: Matrix, errors: Numbers) -> Matrix:
    count, reach = len(errors), _reach(errors)
    total = float(errors @ errors) / count * slopes.T @ slopes
    for lag in range(1, reach + 1):
        alike = float(errors[lag:] @ errors[:-lag]) / count
        cross = slopes[lag:].T @ slopes[:-lag]
        total = total + (1 - lag / (reach + 1)) * alike * (cross + cross.T)
    return np.asarray(total)


def independent_samples(errors: Numbers, stretches: Sequence[ErrorRows]) -> float:
    """How many samples that are alike no more the errors are worth."""
    found = 0.0
    begin = 0
    for one in stretches:
        for _ in range(2):
            part = errors[begin : begin + len(one.rows)]
            found += len(part) / correlation_length(part)
            begin += len(one.rows)
    return found

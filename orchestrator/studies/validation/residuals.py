"""The errors of a device at events as one vector, in units of the recordings' scatter, and how parameters move it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from orchestrator.core.arrays import Complex, Matrix, Numbers, Vector
from orchestrator.core.errors import CosimError, InputError
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import RecordedEvent, judge_response
from orchestrator.studies.validation.figures import correlation_length

Values = Mapping[str, float | bool]
Report = Callable[[str], None]

_LEAST_SCATTER = 2e-4  # [pu]: a recording is not trusted more than an instrument of the best class
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

    ``runs``: how many were made."""

    device: PlayedDevice
    stretches: Sequence[ErrorRows]
    report: Report = lambda text: None
    runs: int = 0
    _kept: dict[tuple[tuple[str, float | bool], ...], Numbers] = field(default_factory=dict)

    def at(self, values: Values) -> Numbers:
        """Errors with other values, in scatters; those of values with which the device does not run are large."""
        key = tuple(sorted(values.items()))
        if key not in self._kept:
            device = self.device.with_values(values)
            self._kept[key] = np.concatenate([self._of(device, one) for one in self.stretches])
        return self._kept[key]

    def _of(self, device: PlayedDevice, stretch: ErrorRows) -> Numbers:
        event = stretch.event
        try:
            power = device.play(event.recording, event.start).power
        except InputError:
            raise
        except CosimError:
            return np.full(stretch.size, _REFUSED)
        finally:
            self.runs += 1
        return weighted(power - event.recording.power, stretch)

    def between_samples(self, values: Values) -> Numbers:
        """By how much the errors change where every second sample of the voltage is missing.

        No less is due to what the voltage did between the samples that there are."""
        device = self.device.with_values(values)
        coarse = [
            replace(one, event=replace(one.event, recording=one.event.recording.coarser()))
            for one in self.stretches
        ]
        return np.concatenate([self._of(device, one) for one in coarse]) - self.at(values)

    def slopes(self, values: Values, steps: Mapping[str, float]) -> Matrix:
        """How the errors move with each parameter, a column each, by differences to both sides."""
        columns = []
        for name, step in steps.items():
            self.report(f"sensitivity to {name}")
            at = float(values[name])
            high, low = (self.at({**values, name: at + side * step}) for side in (1, -1))
            columns.append((high - low) / (2 * step))
        return np.column_stack(columns)


def weighted(error: Complex, stretch: ErrorRows) -> Numbers:
    seen = error[stretch.rows]
    return np.concatenate([seen.real * stretch.weights[0], seen.imag * stretch.weights[1]])


def stretches_of(device: PlayedDevice, events: Sequence[RecordedEvent]) -> list[ErrorRows]:
    """The events' samples, each weighted by the scatter before its event."""
    found = []
    for event in events:
        recording = event.recording
        compared = judge_response(device, event, device.play(recording, event.start))
        weights = [1 / max(compared.noise[s].scatter, _LEAST_SCATTER) for s in ("p", "q")]
        thin = max(1, int(0.5 * recording.average / recording.interval))
        rows = np.flatnonzero(recording.good)[::thin]
        found.append(ErrorRows(event, rows, (weights[0], weights[1])))
    return found


def covariance(slopes: Matrix, errors: Numbers, stretches: Sequence[ErrorRows]) -> Matrix:
    """Covariance of the parameters, with errors that are alike from sample to sample.

    The larger of two: errors as one stationary noise of their own correlation, and errors as they are, with their size
    where the parameter acts (Newey and West, Econometrica 55, 1987). Both weigh lags by a triangle."""
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
    factor = len(errors) / max(len(errors) - slopes.shape[1], 1)
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

"""Which single parameter would explain what a model does otherwise than the plant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from orchestrator.core.errors import CosimError
from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import RecordedEvent, rms_error
from orchestrator.studies.validation.fit import FittedParameter, fit_parameters
from orchestrator.studies.validation.parameters import NEVER, Wanted, adjustable
from orchestrator.studies.validation.residuals import Report, Residuals, stretches_of

_TRIED = 3  # numbers that are fitted, those first of which a small change promises the most
_EXPLAINS = 0.5  # part of the error that an explanation may leave
_MOST_WORDS = 8  # positions of a whole number that are tried


@dataclass(frozen=True)
class Explanation:
    """One parameter with another value, and the error that it leaves: rms of P and Q together [pu of the rating]."""

    parameter: str
    now: float | bool
    value: float | bool
    error: float
    left: float

    @property
    def explains(self) -> bool:
        """Return whether most of the error goes away with it."""
        return self.left <= _EXPLAINS * self.error

    def as_json(self) -> dict[str, Any]:
        return {
            "parameter": self.parameter,
            "now": self.now,
            "value": self.value,
            "rms_now_pu": self.error,
            "rms_left_pu": self.left,
            "explains": self.explains,
        }


def explain_errors(
    device: PlayedDevice, events: Sequence[RecordedEvent], report: Report = lambda text: None
) -> list[Explanation]:
    """Explanations by one parameter each, the best first: switches and kinds tried, likeliest numbers fitted."""
    error = _error(device, events)
    found = []
    for info, value in _positions(device):
        report(f"trying {info.name} = {value}")
        left = _error(device.with_values({info.name: value}), events)
        if left is not None and error is not None:
            found.append(Explanation(info.name, device.value(info.name), value, error, left))
    for one in _likeliest(device, events, report):
        left = _error(device.with_values({one.name: one.value}), events)
        if left is not None and error is not None:
            found.append(Explanation(one.name, one.start, one.value, error, left))
    return sorted(found, key=lambda one: one.left)


def _error(device: PlayedDevice, events: Sequence[RecordedEvent]) -> float | None:
    """Rms error of all events together [pu]; None where the device does not run so."""
    squares = []
    for event in events:
        try:
            power = device.play(event.recording, event.start).power
        except CosimError:
            return None
        squares += [one**2 for one in rms_error(power, event)]
    return math.sqrt(sum(squares) / len(events))


def _parameters(device: PlayedDevice, kind: str) -> Iterator[VariableInfo]:
    for info in device.description.variables.values():
        if info.causality == "parameter" and info.type == kind and info.name not in NEVER:
            yield info


def _positions(device: PlayedDevice) -> Iterator[tuple[VariableInfo, float | bool]]:
    """Other positions of switches and of kinds, which are whole numbers within bounds."""
    for info in _parameters(device, "Boolean"):
        yield info, not device.value(info.name)
    for info in _parameters(device, "Integer"):
        low, high = info.minimum, info.maximum
        if low is None or high is None or high - low >= _MOST_WORDS:
            continue
        for value in range(int(low), int(high) + 1):
            if value != device.value(info.name):
                yield info, value


def _likeliest(
    device: PlayedDevice, events: Sequence[RecordedEvent], report: Report
) -> Iterator[FittedParameter]:
    """The numbers of which a change promises the most, each fitted alone."""
    residuals = Residuals(device, stretches_of(device, events), report)
    numbers = [adjustable(device, info, None) for info in _parameters(device, "Real")]
    numbers = [one for one in numbers if one.high > one.low]
    errors = residuals.at({})
    promises = []
    for one in numbers:
        at = replace(one, start=one.inside())
        slope = residuals.slopes({one.name: at.start}, {one.name: at.step})[:, 0]
        size = float(slope @ slope)
        if size > 0:
            promises.append((float(slope @ errors) ** 2 / size, one))
    promises.sort(key=lambda pair: -pair[0])
    for _, one in promises[:_TRIED]:
        report(f"fitting {one.name} alone")
        fit = fit_parameters(device, events, Wanted([one], []), report)
        yield from (found for found in fit.parameters if found.value != found.start)

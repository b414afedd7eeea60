"""The voltage between two samples where it jumps: a recording does not hold it, and a fast mode rings with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.arrays import Matrix, Numbers
from orchestrator.studies.validation.event import RecordedEvent
from orchestrator.studies.validation.record import Recording

_MOST_JUMPS = 3  # of one event: a fault's begin, its clearing, and one more
_JUMPS = 0.25  # part of the largest change from sample to sample, from which on it is a jump
_LEAST_JUMP = 5e-4  # [pu]
_APART = 0.03  # least time between two jumps [s]
_LIKELY = 0.5  # scatter of the voltage between the samples, as part of the jump


@dataclass(frozen=True)
class HiddenVoltage:
    """A part of the voltage around the middle of a jump that no sample holds: an unknown beside the parameters.

    ``sample``: the last one before the jump; ``axis``: 1 or 1j; ``scale``: how large it is likely to be [pu]."""

    name: str
    event: int
    sample: int
    axis: complex
    scale: float


def hidden_voltages(events: Sequence[RecordedEvent]) -> list[HiddenVoltage]:
    """Two unknowns, one for each axis, for every jump of the events' voltages."""
    return [
        HiddenVoltage(f"voltage {axis.real:g} at {sample} of {k}", k, sample, axis, _LIKELY * jump)
        for k, event in enumerate(events)
        for sample, jump in jumps_of(event)
        for axis in (1 + 0j, 1j)
    ]


def jumps_of(event: RecordedEvent) -> list[tuple[int, float]]:
    """Samples before the largest changes of the voltage, with these changes [pu], from the event's begin on."""
    recording = event.recording
    change = np.abs(np.diff(recording.voltage))
    begin = int(event.windows.begin / recording.interval)
    usual = float(np.median(change[: max(begin, 1)]))
    first = max(begin - 2, 0)
    change[:first] = 0.0
    least = max(_JUMPS * float(change.max(initial=0.0)), _LEAST_JUMP, 10 * usual)
    apart = max(1, round(_APART / recording.interval))
    found: list[tuple[int, float]] = []
    while len(found) < _MOST_JUMPS:
        at = int(change.argmax())
        if change[at] < least:
            break
        found.append((at, float(change[at])))
        change[max(0, at - apart) : at + apart + 1] = 0.0
    return found


def with_hidden(
    recording: Recording, hidden: Sequence[HiddenVoltage], values: Mapping[str, float | bool]
) -> Recording:
    """The recording with unknown parts of its voltage as they are assumed [pu]."""
    seen = [one for one in hidden if values.get(one.name)]
    if not seen:
        return recording
    voltage = recording.voltage.copy()
    for one in seen:
        voltage[one.sample : one.sample + 2] += 0.5 * values[one.name] * one.axis
    return replace(recording, voltage=voltage)


def likelihoods(hidden: Sequence[HiddenVoltage], values: Mapping[str, float | bool]) -> Numbers:
    """Each unknown in its scale: rows that keep it near what is likely."""
    return np.array([float(values.get(one.name, 0.0)) / one.scale for one in hidden])


@dataclass(frozen=True)
class HiddenPart:
    """The part of an error that the voltage between samples may have made.

    ``ways``: how the error moves with each unknown, one column each, and below them how unlikely its size is;
    ``inverse``: of these, in the sense of least squares."""

    ways: Matrix
    inverse: Matrix

    @classmethod
    def of(cls, columns: Sequence[Numbers], scales: Sequence[float], scatter: float) -> HiddenPart:
        """From the errors' slopes; ``scales``: likely sizes; ``scatter``: of one of the errors, in their unit."""
        if not columns:
            return cls(np.empty((0, 0)), np.empty((0, 0)))
        ways = np.concatenate([np.column_stack(columns), np.diag(scatter / np.array(scales))])
        return cls(ways, np.asarray(np.linalg.pinv(ways)))

    def taken_out_of(self, error: Numbers) -> Numbers:
        """The error without that part, and below it what taking so much out of it costs in likelihood."""
        count = self.ways.shape[1]
        if not count:
            return error
        whole = np.concatenate([error, np.zeros(count)])
        return np.asarray(whole - self.ways @ (self.inverse @ whole))

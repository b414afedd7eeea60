"""The study: events of one device, each by the recorded voltage, beside limits and with what a fit finds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from orchestrator.core.errors import InputError
from orchestrator.core.late import xr
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import (
    EventComparison,
    RecordedEvent,
    compare_with,
    prepare_event,
)
from orchestrator.studies.validation.hypotheses import question_readings
from orchestrator.studies.validation.limits import (
    Criterion,
    LimitTables,
    LimitVerdict,
    judge_limits,
    verdict_of,
)
from orchestrator.studies.validation.record import PortBases, read_recording
from orchestrator.studies.validation.windows import given_windows

Report = Callable[[str], None]


@dataclass(frozen=True)
class GivenRecording:
    """A recording as it was given."""

    dataset: xr.Dataset
    label: str
    sha256: str = ""
    held_back: bool = False  # whether it confirms a fit, and is none of those that are fitted


@dataclass(frozen=True)
class ValidationRequest:
    """A device and the recordings by which it is validated."""

    device: PlayedDevice
    recordings: Sequence[GivenRecording]
    bases: PortBases
    channels: Sequence[str] = ()
    place: str | None = None
    # begin and end of the event [s], one for all recordings or one for each; none where they are found
    events: Sequence[tuple[float, float]] = ()
    limits: LimitTables | None = None


@dataclass(frozen=True)
class ValidationResult:
    """Comparisons in the order of the recordings; ``verdict`` is None without limits."""

    request: ValidationRequest
    comparisons: Sequence[EventComparison]
    criteria: Sequence[Criterion] = field(default=())
    verdict: LimitVerdict | None = None


def events_of(request: ValidationRequest) -> list[RecordedEvent]:
    """Read all recordings of a request, and find their windows and operating points."""
    given = list(request.events)
    if len(given) not in (0, 1, len(request.recordings)):
        raise InputError(
            f"--event: {len(given)} are given for {len(request.recordings)} recordings; give one for all, or one for "
            "each in their order"
        )
    each: Sequence[tuple[float, float] | None]
    alone = given[0] if given else None
    each = given if len(given) > 1 else [alone] * len(request.recordings)
    return [
        _event(request, one, window) for one, window in zip(request.recordings, each, strict=True)
    ]


def _event(
    request: ValidationRequest, given: GivenRecording, window: tuple[float, float] | None
) -> RecordedEvent:
    recording = read_recording(
        given.dataset, given.label, request.bases, request.channels, request.place
    )
    recording = replace(recording, sha256=given.sha256)
    windows = None if window is None else given_windows(recording, *window)
    return prepare_event(recording, request.bases, windows)


def validate_device(
    request: ValidationRequest, report: Report = lambda text: None
) -> ValidationResult:
    """Drive the device by each recording, and judge it by the limits."""
    request.device.check_port()
    comparisons = []
    for event in events_of(request):
        report(f"{event.recording.label}: driving {request.device.name}")
        comparison = compare_with(request.device, event)
        asked = question_readings(comparison, request.bases)
        comparisons.append(replace(comparison, questions=comparison.questions + tuple(asked)))
    return add_verdict(ValidationResult(request, comparisons))


def add_verdict(result: ValidationResult) -> ValidationResult:
    """The result beside the limits of its request, where there are any."""
    limits = result.request.limits
    if limits is None:
        return result
    criteria = [
        one for comparison in result.comparisons for one in judge_limits(limits, comparison)
    ]
    return replace(result, criteria=criteria, verdict=verdict_of(criteria, result.comparisons))

"""The study: events of one device, each by the recorded voltage, beside limits and with what a fit finds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any

from orchestrator.core.errors import CosimError, InputError
from orchestrator.core.late import xr
from orchestrator.core.options import Option
from orchestrator.core.threads import one_thread
from orchestrator.studies.validation.asked_first import AskedFirst, asked_before
from orchestrator.studies.validation.beside import WindowApart, models_apart
from orchestrator.studies.validation.between_samples import with_doubt_between
from orchestrator.studies.validation.causes import EXPLAINS, CauseSearch, Explanation
from orchestrator.studies.validation.device import PlayedDevice, StartRefusedError
from orchestrator.studies.validation.event import (
    EventComparison,
    RecordedEvent,
    before_setpoint,
    compare_with,
    in_step,
    loses_step,
    prepare_event,
    rms_error,
)
from orchestrator.studies.validation.explain import explain_errors
from orchestrator.studies.validation.fit import Fit, fit_parameters
from orchestrator.studies.validation.hypotheses import question_readings, sign_that_starts
from orchestrator.studies.validation.lagged import lag_alone
from orchestrator.studies.validation.limits import (
    Criterion,
    LimitTables,
    LimitVerdict,
    judge_limits,
    verdict_of,
)
from orchestrator.studies.validation.parameters import Wanted, wanted_parameters
from orchestrator.studies.validation.plain_part import PlainPart, plain_part
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import PortBases, read_recording
from orchestrator.studies.validation.trials import RefusedTrial
from orchestrator.studies.validation.unreached import unreached_limits
from orchestrator.studies.validation.windows import given_windows
from orchestrator.studies.validation.words import sentence

Report = Callable[[str], None]

_LITTLE = 0.1  # part of the squared error by which a fit has to lower it, to be confirmed
_AGREES = 0.7
"""Part of that, by which an event that was kept back agrees.

Of 84 pairs of events of one plant each had 0.74, or an error of its noise; of 39 with an event of another plant 3 had
more than this, and 11 had 0.5."""
_AS_NOISE = 2.0  # times the recording's own noise, up to which an error needs no fall


@dataclass(frozen=True)
class GivenRecording:
    """A data set, its label in tables, and the hash of its file."""

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
    fit: Sequence[str] = ()  # parameters that are fitted
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    beside: PlayedDevice | None = None  # another model of the same plant
    explain: bool = False  # whether it is asked which one parameter would explain the errors


@dataclass(frozen=True)
class FitCheck:
    """Errors of one recording before and after a fit: rms of P and Q together [pu of the rating]."""

    recording: str
    fitted: bool  # False for an event that was kept back
    before: float
    after: float
    scatter: float = 0.0  # that the recording's noise alone makes
    agrees: bool | None = None  # of an event that was kept back; None where the fit changes little

    def as_json(self) -> dict[str, Any]:
        return {
            "recording": self.recording,
            "fitted": self.fitted,
            "rms_before_pu": self.before,
            "rms_after_pu": self.after,
            "agrees": self.agrees,
        }


def with_agreement(checks: Sequence[FitCheck]) -> list[FitCheck]:
    """The checks with whether the events that were kept back agree with a fit.

    The squared error of such an event falls by seven tenths of the part at least by which that of the fitted ones
    falls, or to what is hardly more than its noise."""
    fitted = [one for one in checks if one.fitted]
    before = sum(one.before**2 for one in fitted)
    fall = 1 - sum(one.after**2 for one in fitted) / before if before > 0 else 0.0
    if fall < _LITTLE:
        return list(checks)
    return [one if one.fitted else replace(one, agrees=_agrees(one, fall)) for one in checks]


def _agrees(one: FitCheck, fall: float) -> bool:
    own_fall = 1 - (one.after / one.before) ** 2 if one.before > 0 else 0.0
    return own_fall >= _AGREES * fall or one.after <= _AS_NOISE * one.scatter


@dataclass(frozen=True)
class ValidationResult:
    """Comparisons in the order of the recordings; ``verdict`` is None without limits."""

    request: ValidationRequest
    comparisons: Sequence[EventComparison]
    criteria: Sequence[Criterion] = field(default=())
    verdict: LimitVerdict | None = None
    fit: Fit | None = None
    confirmations: Sequence[FitCheck] = field(default=())
    explanations: Sequence[Explanation] = field(default=())
    # questions that explain more than these
    asked_first: AskedFirst | None = None
    explained_in_step: bool = False  # whether the model was held in step for them
    unreached: Sequence[str] = field(default=())  # limits beside it of which nothing is seen
    plain_part: PlainPart | None = None  # up to where the first of them holds without that
    others: Sequence[EventComparison] = field(default=())  # of the other model, in the same order
    interrupted: bool = False  # before all that was asked for was done

    @property
    def devices(self) -> list[PlayedDevice]:
        """The model, and the other one of the plant where there is one."""
        both = (self.request.device, self.request.beside)
        return [one for one in both if one is not None]

    @property
    def finished(self) -> bool:
        """Return whether all was done that was asked for."""
        return not self.interrupted and (self.fit is None or self.fit.finished)

    @property
    def refused(self) -> list[RefusedTrial]:
        """Readings, values and steps that were tried and did not run, with the reason."""
        return [one for device in self.devices for one in device.trials.refused]

    @property
    def apart(self) -> list[WindowApart]:
        """How far two models are from the recordings and from each other; empty where there is one."""
        pairs = zip(self.comparisons, self.others, strict=False)
        return [one for first, second in pairs for one in models_apart(first, second)]


def events_of(request: ValidationRequest) -> list[RecordedEvent]:
    """Read all recordings of a request, and find their windows and operating points."""
    given = list(request.events)
    if len(given) not in (0, 1, len(request.recordings)):
        raise InputError(
            Option.EVENT
            + f": {len(given)} are given for {len(request.recordings)} recordings; give one "
            "for all, or one for each in their order"
        )
    each: Sequence[tuple[float, float] | None]
    alone = given[0] if given else None
    each = given if len(given) > 1 else [alone] * len(request.recordings)
    events = [
        _event(request, one, window) for one, window in zip(request.recordings, each, strict=True)
    ]
    _refuse_twice(request, events)
    return events


def _refuse_twice(request: ValidationRequest, events: Sequence[RecordedEvent]) -> None:
    """Refuse an event that is given twice: it would count twice in a fit, or confirm itself."""
    both = list(zip(events, request.recordings, strict=True))
    for k, (event, given) in enumerate(both):
        for other, first in both[:k]:
            if not event.same_as(other):
                continue
            if given.held_back != first.held_back:
                kept, fitted = (given, first) if given.held_back else (first, given)
                raise InputError(
                    Option.HOLD_BACK
                    + f" {kept.label}: it holds the same samples and the same event as {fitted.label}, which is "
                    "fitted, and confirms nothing; give a recording of another event"
                )
            raise InputError(
                f"{given.label}: it holds the same samples and the same event as {first.label}, and would count twice; "
                "give each recording once"
            )


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
    with ExitStack() as kept:
        for device in filter(None, (request.device, request.beside)):
            kept.enter_context(device.shelf.keeping())
            kept.enter_context(device.made.keeping())
        kept.enter_context(one_thread())  # matrices are small, and other threads would only wait
        return _validate(request, report)


def _validate(request: ValidationRequest, report: Report) -> ValidationResult:
    request.device.check_port()
    if request.fit:  # before the device is driven, which takes seconds
        _find_wanted(request)
    comparisons = []
    for event in events_of(request):
        report(f"{event.recording.label}: driving {request.device.name}")
        comparison = _compare(request.device, event, request.bases)
        asked = question_readings(in_step(comparison), request.bases)
        comparisons.append(replace(comparison, questions=comparison.questions + tuple(asked)))
    others = _others(request, [one.event for one in comparisons], report)
    result = add_verdict(ValidationResult(request, comparisons, others=others))
    if request.explain:
        search = _search_causes(request.device, result.comparisons, report)
        answered = _without_explained(request.device, result.comparisons, search)
        result = add_verdict(replace(result, comparisons=answered))
        lacking = any(one.lacks_limit for one in comparisons)
        causes = [replace(c, stands_in=lacking and c.leaves_much) for c in search.causes]
        first = asked_before(result.comparisons, causes)
        result = replace(
            result,
            explanations=[replace(c, behind_question=first is not None) for c in causes],
            asked_first=first,
            explained_in_step=search.held,
            interrupted=not search.finished,
        )
        result = _with_confirmation(result, report)
    return _with_fit(result, report) if request.fit and not result.interrupted else result


def _with_confirmation(result: ValidationResult, report: Report) -> ValidationResult:
    """The result with what else is known of its first cause: limits beside it that are not reached, and, where it was
    found in step, the part in which it holds in plain play-back.

    If that is interrupted, the causes stay."""
    causes, events = result.explanations, [one.event for one in result.comparisons]
    if result.interrupted or not causes or not causes[0].explains:
        return result
    device = result.request.device
    held = device.in_step if result.explained_in_step else device
    try:
        unreached = unreached_limits(held, events, causes[0], report)
        result = replace(result, unreached=unreached)
        if not result.explained_in_step:
            return result
        return replace(result, plain_part=plain_part(device, events, causes[0], report))
    except KeyboardInterrupt:
        return replace(result, interrupted=True)


def _search_causes(
    device: PlayedDevice, comparisons: Sequence[EventComparison], report: Report
) -> CauseSearch:
    """Search for causes in what comes before a setpoint that seems to have changed, and then in the whole.

    What one parameter explains to the recording's scatter was no setpoint: a limit of the current that acts from a
    moment on looks like one at first."""
    lag = lag_alone(comparisons)
    if lag is not None:
        return CauseSearch([lag])
    before, whole = ([before_setpoint(x) for x in comparisons], [x.event for x in comparisons])
    kept_before: list[RecordedEvent] | None = None
    kept_whole: list[RecordedEvent] | None = None
    if any(map(loses_step, comparisons)):
        kept = [in_step(one) for one in comparisons]
        kept_before, kept_whole = [before_setpoint(x) for x in kept], [x.event for x in kept]
    found = explain_errors(device, before, report, kept_before)
    same = all(one is other for one, other in zip(before, whole, strict=True))
    if found.explains or not found.finished or same:
        return found
    other = explain_errors(device, whole, report, kept_whole)
    taken = other if other.explains and not other.causes[0].leaves_much else found
    return replace(taken, finished=other.finished)


def _without_explained(
    device: PlayedDevice, comparisons: Sequence[EventComparison], search: CauseSearch
) -> list[EventComparison]:
    """The comparisons without questions about a setpoint that the first cause answers; those that stand are tried.

    A cause answers one if the device with its values explains the whole event, and makes no such question itself. A
    delay, and a limit that no parameter has, are not run, and leave the question."""
    if not search.finished:
        return list(comparisons)
    other = device.with_values(search.causes[0].values) if search.runs_explained else None
    found = []
    for one in comparisons:
        asked = list(one.questions)
        for question in filter(_is_of_setpoint, one.questions):
            asked.remove(question)
            if other is None or not _answers(other, one):
                asked.append(replace(question, figures={**question.figures, "tried": True}))
        found.append(replace(one, questions=tuple(asked)))
    return found


def _is_of_setpoint(question: Question) -> bool:
    return question.kind is QuestionKind.SETPOINT


def _answers(other: PlayedDevice, comparison: EventComparison) -> bool:
    """Return whether a device with other values explains a whole event, and makes no question about a setpoint."""
    anew = compare_with(other, comparison.event)
    errors = [math.hypot(*rms_error(one.played.power, one.event)) for one in (comparison, anew)]
    explained = errors[1] ** 2 <= (1 - EXPLAINS) * errors[0] ** 2
    asked = [one for one in comparison.questions if one.figures.get("within")]
    if asked:  # the step by itself explains the event as well: a cause has to leave less
        event = before_setpoint(comparison)
        explained = errors[1] < math.hypot(*rms_error(comparison.played.power, event))
    return explained and not any(map(_is_of_setpoint, anew.questions))


def _with_fit(result: ValidationResult, report: Report) -> ValidationResult:
    """The result with a fit; if that is interrupted before it has any values, without one."""
    try:
        return add_fit(result, report)
    except KeyboardInterrupt:
        return replace(result, interrupted=True)


def _others(
    request: ValidationRequest, events: Sequence[RecordedEvent], report: Report
) -> list[EventComparison]:
    """The comparisons of the other model of the plant, where there is one."""
    device = request.beside
    if device is None:
        return []
    device.check_port()
    if not math.isclose(device.rating, request.device.rating, rel_tol=1e-9):
        raise InputError(
            Option.BESIDE + f" {device.name}: its rating is {device.rating:g} MVA, and that of "
            f"{request.device.name} is {request.device.rating:g} MVA; give both the "
            "plant's, with " + Option.SET + " S_n=…"
        )
    found = []
    for event in events:
        report(f"{event.recording.label}: driving {device.name}")
        found.append(_compare(device, event, request.bases))
    return found


def _find_wanted(request: ValidationRequest) -> Wanted:
    """Find the parameters that are fitted; refuse a fit that no recording is left to."""
    if all(given.held_back for given in request.recordings):
        raise InputError(
            Option.HOLD_BACK + ": all recordings are kept back from the fit; leave one to it"
        )
    return wanted_parameters(request.device, request.fit, request.bounds)


def add_fit(result: ValidationResult, report: Report) -> ValidationResult:
    """The result with a fit to the events that were not kept back, and what all events say of it."""
    request = result.request
    device = request.device
    kept = [given.held_back for given in request.recordings]
    events = [one.event for one in result.comparisons]
    wanted = _find_wanted(request)
    taken = [event for event, held in zip(events, kept, strict=True) if not held]
    fit = fit_parameters(device, taken, wanted, report)
    other = device.with_values(fit.values)
    confirmations = []
    for one, held in zip(result.comparisons, kept, strict=True):
        event = one.event
        after = other.play(event.recording, event.start).power if fit.values else one.played.power
        was, now = (math.hypot(*rms_error(power, event)) for power in (one.played.power, after))
        scatter = math.hypot(*(one.noise[signal].scatter for signal in ("p", "q")))
        label = event.recording.label
        confirmations.append(FitCheck(label, not held, was, now, scatter))
    return replace(result, fit=fit, confirmations=with_agreement(confirmations))


def _compare(device: PlayedDevice, event: RecordedEvent, bases: PortBases) -> EventComparison:
    """The comparison; where the device refuses to run, what was asked of the recording is said with it."""
    try:
        return with_doubt_between(compare_with(device, event))
    except CosimError as error:
        likeliest = _likeliest_cause(device, event, bases)
        if not likeliest:
            raise
        said = error.said if isinstance(error, StartRefusedError) else str(error)
        raise InputError(f"{event.recording.label}: {likeliest}. {said}") from error


def _likeliest_cause(device: PlayedDevice, event: RecordedEvent, bases: PortBases) -> str:
    """Say what most likely is wrong with a recording that a device does not start from; empty where nothing is known.

    A voltage or a power of another unit makes other questions as well, and goes before them."""
    asked = [one for one in event.questions if one.keeps_open]
    units = [one for one in asked if one.figures.get("remedy")]
    sign = sign_that_starts(device, event, bases)
    return next(iter([*map(sentence, units), *filter(None, [sign]), *map(sentence, asked)]), "")


def add_verdict(result: ValidationResult) -> ValidationResult:
    """The result beside the limits of its request, where there are any."""
    limits = result.request.limits
    if limits is None:
        return result
    comparisons = [*result.comparisons, *result.others]
    criteria = [
        replace(one, device=comparison.device.name)
        for comparison in comparisons
        for one in judge_limits(limits, comparison)
    ]
    return replace(result, criteria=criteria, verdict=verdict_of(criteria, comparisons))

"""A planner's limits of the errors, from the user's TOML file, and whether they are met."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.core.toml_files import Table, fault_of, read_toml
from orchestrator.studies.validation.event import EventComparison, JumpDoubt
from orchestrator.studies.validation.figures import ErrorFigures, ModeLists, modes_apart

Signal = Literal["p", "q", "i_p", "i_q"]
Window = Literal["before", "during", "after"]

EXAMPLE = Path(__file__).with_name("example_limits.toml")
"""Limits that were made up for this project: of no standard and no planner."""


class ErrorLimits(Table):
    """Largest errors of one signal in one window [pu of the rating]; None where nothing is asked."""

    max_error: float | None = Field(None, gt=0)
    mean_error: float | None = Field(None, gt=0)
    mean_abs_error: float | None = Field(None, gt=0)


class RingDownLimits(Table):
    """How far frequency [percent] and damping [points of percent] of the ring-down may be apart."""

    frequency_percent: float | None = Field(None, gt=0)
    damping_points: float | None = Field(None, gt=0)


class LimitTables(Table):
    """A file of limits."""

    source: str = Field(min_length=1)
    windows: dict[Window, dict[Signal, ErrorLimits]] = Field(default_factory=dict)
    delay: dict[Literal["p", "q"], float] = Field(default_factory=dict)
    ring_down: dict[Literal["p", "q"], RingDownLimits] = Field(default_factory=dict)


class LimitVerdict(StrEnum):
    """``open``: a question stands, or the recording's own noise allows no verdict."""

    MET = "met"
    NOT_MET = "not met"
    OPEN = "open"


class OpenCause(StrEnum):
    """Why a figure beside its limit decides nothing."""

    SCATTER = "scatter"
    SAMPLES = "samples"
    STEP = "step"
    FIXED_STEP = "fixed step"
    RING_DOWN = "ring-down"
    NO_FIGURE = "no figure"


@dataclass(frozen=True)
class Criterion:
    """One figure beside its limit; ``noise``: what the recording's scatter alone may make of the figure.

    ``why_open``: None where it is met or not. ``rings``: the strong modes of a ring-down that stays open."""

    recording: str
    name: str
    unit: str
    value: float | None
    limit: float
    noise: float
    verdict: LimitVerdict
    device: str = ""
    why_open: OpenCause | None = None
    rings: ModeLists = ((), ())

    @property
    def place(self) -> str:
        """The recording, and which model was driven by it."""
        return f"{self.recording}, {self.device}"

    def as_json(self) -> dict[str, Any]:
        return {
            "device": self.device,
            "recording": self.recording,
            "name": self.name,
            "unit": self.unit,
            "value": self.value,
            "limit": self.limit,
            "of_noise": self.noise,
            "verdict": str(self.verdict),
            "why_open": None if self.why_open is None else str(self.why_open),
        }


def read_limits(path: Path) -> LimitTables:
    """Read a file of limits.

    Raises an `InputError` if it is no such file, or a key or value in it cannot be used."""
    _, table = read_toml(path, "the file of limits", f"{EXAMPLE} is an example", Option.LIMITS)
    try:
        found = LimitTables.model_validate(table)
    except ValidationError as error:
        said = [f"{'.'.join(map(str, one['loc']))}: {fault_of(one)}" for one in error.errors()]
        raise InputError(Option.LIMITS + f" {path}: {'; '.join(said)}") from error
    if not (found.windows or found.delay or found.ring_down):
        raise InputError(
            Option.LIMITS + f" {path}: it has no limit; write one such as [windows.after.p] with "
            "max_error = 0.1"
        )
    return found


def judge_limits(limits: LimitTables, comparison: EventComparison) -> list[Criterion]:
    """Each limit beside its figure of one event."""
    found = [
        *_of_windows(limits, comparison),
        *_of_delay(limits, comparison),
        *_of_ring_down(limits, comparison),
    ]
    return [replace(one, why_open=one.why_open or _why_open(one, comparison)) for one in found]


def _why_open(one: Criterion, comparison: EventComparison) -> OpenCause | None:
    if one.verdict is not LimitVerdict.OPEN:
        return None
    if one.value is None:
        return OpenCause.NO_FIGURE
    match comparison.doubt:
        case JumpDoubt.STEP:
            return OpenCause.STEP
        case JumpDoubt.FIXED_STEP:
            return OpenCause.FIXED_STEP
        case JumpDoubt.SAMPLES:
            return OpenCause.SAMPLES
    return OpenCause.SCATTER


def verdict_of(
    criteria: Sequence[Criterion], comparisons: Sequence[EventComparison]
) -> LimitVerdict:
    """Return the verdict on all events; a question about a recording or the start keeps it open."""
    if any(one.keeps_open for comparison in comparisons for one in comparison.questions):
        return LimitVerdict.OPEN
    verdicts = {one.verdict for one in criteria}
    for verdict in (LimitVerdict.NOT_MET, LimitVerdict.OPEN):
        if verdict in verdicts:
            return verdict
    return LimitVerdict.MET if verdicts else LimitVerdict.OPEN


def _verdict(value: float, noise: float, limit: float, *, grows: bool) -> LimitVerdict:
    """``grows``: whether scatter can only enlarge the figure, as of magnitudes."""
    if noise > limit:
        return LimitVerdict.OPEN
    if value <= limit:
        return LimitVerdict.MET if grows or value + noise <= limit else LimitVerdict.OPEN
    return LimitVerdict.NOT_MET if value - noise > limit else LimitVerdict.OPEN


def _of_windows(limits: LimitTables, comparison: EventComparison) -> Iterator[Criterion]:
    for window, of_signals in limits.windows.items():
        for signal, limit in of_signals.items():
            figures = comparison.errors.get(window, {}).get(signal)
            if figures is not None:
                yield from _of_errors(limit, figures, comparison, f"{window} {signal}")


def _of_errors(
    limits: ErrorLimits, figures: ErrorFigures, comparison: EventComparison, name: str
) -> Iterator[Criterion]:
    rows = (
        ("max_error", figures.max_error, figures.max_of_noise, True),
        ("mean_error", abs(figures.mean_error), figures.mean_of_noise, False),
        ("mean_abs_error", figures.mean_abs_error, figures.mean_abs_of_noise, True),
    )
    for key, value, noise, grows in rows:
        limit = getattr(limits, key)
        if limit is not None:
            verdict = _verdict(value, noise, limit, grows=grows)
            label = comparison.event.recording.label
            yield Criterion(
                label, f"{name} {key}", "pu", value, limit, noise=noise, verdict=verdict
            )


def _of_delay(limits: LimitTables, comparison: EventComparison) -> Iterator[Criterion]:
    recording = comparison.event.recording
    for signal, limit in limits.delay.items():
        delay = comparison.signals[signal].delay
        value = None if delay is None else abs(delay)
        noise = 0.5 * recording.interval
        verdict = LimitVerdict.OPEN if value is None else _verdict(value, noise, limit, grows=False)
        yield Criterion(
            recording.label, f"delay {signal}", "s", value, limit, noise=noise, verdict=verdict
        )


def _of_ring_down(limits: LimitTables, comparison: EventComparison) -> Iterator[Criterion]:
    label = comparison.event.recording.label
    for signal, limit in limits.ring_down.items():
        figures = comparison.signals[signal]
        apart = modes_apart(figures.modes)
        rows = (
            ("frequency", limit.frequency_percent, "%"),
            ("damping", limit.damping_points, "points"),
        )
        for k, (name, most, unit) in enumerate(rows):
            if most is None:
                continue
            value = None if apart is None else abs(apart[k])
            noise = figures.modes_doubt[k]
            verdict = LimitVerdict.OPEN
            if value is not None:
                verdict = _verdict(value, noise, most, grows=False)
            place = f"ring-down {signal} {name}"
            unclear = value is not None and verdict is LimitVerdict.OPEN
            yield Criterion(
                label,
                place,
                unit,
                value,
                most,
                noise=noise,
                verdict=verdict,
                why_open=OpenCause.RING_DOWN if unclear else None,
                rings=figures.strong_modes if unclear else ((), ()),
            )

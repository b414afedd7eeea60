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
from orchestrator.studies.validation.figures import (
    CURRENTS,
    ComparedMode,
    ErrorFigures,
    ModeLists,
    SignalFigures,
    modes_apart,
)

Signal = Literal["p", "q", "i_p", "i_q"]
Window = Literal["before", "during", "after"]

_NEAR_ZERO = 0.05  # voltage [pu] at which the noise of a current is that of a power twenty times

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
    LOW_VOLTAGE = "low voltage"
    RING_DOWN = "ring-down"
    FEW_PERIODS = "few periods"
    NO_FIGURE = "no figure"
    NO_SUCH_MODE = "no such mode"


@dataclass(frozen=True)
class Criterion:
    """One figure beside its limit; ``noise``: what the recording's scatter alone may make of the figure.

    ``why_open``: None where it is met or not. ``rings``: the strong modes of a ring-down that stays open;
    ``doubts``: those of the mode; ``mode_hz``: the frequency of the plant's mode that is off the most, where several
    are compared."""

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
    doubts: Sequence[str] = ()
    mode_hz: float | None = None

    @property
    def shown_name(self) -> str:
        """The name, with the mode where several are compared."""
        return self.name if self.mode_hz is None else f"{self.name} at {self.mode_hz:.3g} Hz"

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
            "mode_hz": self.mode_hz,
            "doubts": list(self.doubts),
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
                found = _of_errors(limit, figures, comparison, f"{window} {signal}")
                near_zero = signal in CURRENTS and figures.least_voltage < _NEAR_ZERO
                yield from map(_open_by_voltage, found) if near_zero else found


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


def _open_by_voltage(one: Criterion) -> Criterion:
    """The criterion of a current beside a voltage near zero, which is the reason if it is open."""
    return replace(
        one, why_open=OpenCause.LOW_VOLTAGE if one.verdict is LimitVerdict.OPEN else None
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
        rows = (
            ("frequency", limit.frequency_percent, "%"),
            ("damping", limit.damping_points, "points"),
        )
        for k, (name, most, unit) in enumerate(rows):
            if most is None:
                continue
            place = Criterion(
                label,
                f"ring-down {signal} {name}",
                unit,
                None,
                most,
                noise=0.0,
                verdict=LimitVerdict.OPEN,
            )
            yield _of_worst_mode(place, figures, k)


_FROM_WORST = (LimitVerdict.NOT_MET, LimitVerdict.OPEN, LimitVerdict.MET)


def _of_worst_mode(place: Criterion, figures: SignalFigures, k: int) -> Criterion:
    """The criterion of the strong mode that is worst beside its limit; ``k``: 0 for frequency, 1 for damping."""
    several = len(figures.compared_modes) > 1
    found = [
        replace(
            _of_mode(place, one, k),
            mode_hz=one.modes[0].frequency_hz if several else None,
        )
        for one in figures.compared_modes
    ]
    if not found:
        return place
    worst = min(found, key=lambda one: (_FROM_WORST.index(one.verdict), -(one.value or 0.0)))
    return replace(worst, rings=figures.strong_modes) if worst.why_open else worst


def _of_mode(place: Criterion, compared: ComparedMode, k: int) -> Criterion:
    apart = modes_apart(compared.modes)
    if apart is None:
        return replace(place, why_open=OpenCause.NO_SUCH_MODE)
    value, noise = abs(apart[k]), compared.doubt[k]
    if compared.few_periods:
        few = f"{compared.modes[0].frequency_hz:.3g} Hz: {compared.few_periods}"
        place = replace(place, why_open=OpenCause.FEW_PERIODS, doubts=[few])
        return replace(place, value=value, noise=noise)
    verdict = _verdict(value, noise, place.limit, grows=False)
    why = OpenCause.RING_DOWN if verdict is LimitVerdict.OPEN else None
    return replace(place, value=value, noise=noise, verdict=verdict, why_open=why)

"""Which values of a device's parameters bring it to what was recorded, how sure that is, and which cannot be told."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from typing import Any

import numpy as np

from orchestrator.core.arrays import Matrix, Numbers, rms
from orchestrator.core.late import optimize, stats
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import RecordedEvent
from orchestrator.studies.validation.held_by_samples import is_too_fast
from orchestrator.studies.validation.parameters import Adjustable, Wanted
from orchestrator.studies.validation.residuals import (
    Report,
    Residuals,
    covariance,
    gain_errors,
    independent_samples,
    means_over,
    stretches_of,
)

_TELLS = 4.0
"""Least singular value of errors in scatters by parameters in their reach: below it the interval is the reach."""

_TAKES_PART = (
    0.4  # part of a direction that cannot be told, from which on a parameter is named with it
)
_SURE = 0.95  # of an interval
_SWITCH_TELLS = 10.0  # by so much of independent scatter the wrong position of a switch is worse
_TOLERANCE = 1e-5  # relative: less of the sum of squares is far within an interval
_UNTOLD_GAIN = 0.02
"""Independent scatters by which a run of a fit lowers the squares at least: by less, no value moves by a seventh of its
scatter, and the fit ends. Beside a device near its limit, voltages between samples creep on for many runs."""

_NO_SLOPE = float(np.finfo(np.float64).eps)
"""Slope of the squares below which there is none, and nothing to follow: where a device does not run, all errors are
alike. The least that SciPy takes; any other slope is larger by far."""

_REACHED = 3.0  # rms error in scatters: a larger one is the model's, or a fit that ended elsewhere
_MOST_RUNS = 60  # of the residuals in one fit, beside those of the sensitivities
_COARSE = (
    0.1  # mean over so long [s] in which a fast ringing's phase, which has many minima, is not seen
)
_COARSE_TOLERANCE = 1e-3  # relative
_STARTS = 4  # from which a fit begins, one after the other, until the recordings are reached
_DOUBLINGS = (
    5  # up and down, at which a parameter's own curve is looked at where the first fit fails
)
_LEAVES = 0.8  # part of the error at the start which a fit may leave, to have found anything
_NEAR_BOUND = 1e-3  # part of a parameter's reach, from a bound, at which it counts as on it
_FARTHEST = 0.5  # part of a parameter's reach by which a start is off the value in the model


class Untold(StrEnum):
    """Why a parameter cannot be told from the recordings."""

    NO_EFFECT = "no effect"
    ALIKE = "alike"
    TOO_FAST = "too fast"
    AT_BOUND = "at its bound"
    WIDE = "wide"
    NO_BETTER = "no better than the start"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class FittedParameter:
    """One parameter after a fit; ``low`` and ``high`` bound its interval of 95 %, and are None if it is not known."""

    name: str
    unit: str
    start: float | bool
    value: float | bool
    low: float | bool | None
    high: float | bool | None
    untold: Untold | None = None
    alike: tuple[str, ...] = ()  # with which others it cannot be told apart

    @property
    def identifiable(self) -> bool:
        return self.untold is None

    def as_json(self) -> dict[str, Any]:
        return {
            "parameter": self.name,
            "unit": self.unit,
            "start": self.start,
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "identifiable": self.identifiable,
            "why_not": None if self.untold is None else str(self.untold),
            "alike": list(self.alike),
        }


@dataclass(frozen=True)
class Fit:
    """The outcome of a fit; errors are rms values in the recordings' scatter."""

    parameters: Sequence[FittedParameter]
    fitted_to: Sequence[str]
    error_before: float
    error_after: float
    runs: int
    finished: bool = True
    beyond: float | None = None  # error after it that no jump between two samples may have made

    @property
    def reached(self) -> bool:
        """Return whether the device comes near to the recordings with the fitted values."""
        return (self.error_after if self.beyond is None else self.beyond) <= _REACHED

    @property
    def holds(self) -> bool:
        """Return whether intervals hold: the fit ended, and leaves no more than the recordings' scatter."""
        return self.finished and self.reached

    @property
    def values(self) -> dict[str, float | bool]:
        """The fitted values; what cannot be told is left where it is."""
        return {one.name: one.value for one in self.parameters if one.value != one.start}


@dataclass
class _Best:
    """The best values so far, for whoever interrupts the fit."""

    cost: float = float("inf")
    rms: float = float("inf")  # of the errors, in scatters
    values: dict[str, float | bool] = field(default_factory=dict)

    @property
    def exists(self) -> bool:
        """Return whether there are any: of a first part in longer steps they have no cost, and of a fit without a
        parameter that can be told they are empty."""
        return bool(self.values) or self.cost < float("inf")


@dataclass
class _Search:
    """A fit with the switches in one position, from one start after the other."""

    switches: Mapping[str, bool]
    told: Sequence[Adjustable]
    untold: Mapping[str, tuple[Untold, tuple[str, ...]]]
    starts: Iterator[list[Adjustable]]
    best: _Best = field(default_factory=_Best)

    @property
    def reached(self) -> bool:
        return self.best.rms <= _REACHED

    def fit_once(self, residuals: Residuals) -> None:
        """Fit from the next start, if there is one: where no parameter can be told, there is nothing to fit."""
        begin = next(self.starts, None)
        if begin is not None:
            _least_squares(residuals, begin, self.switches, self.best)

    def fit_until_reached(self, residuals: Residuals) -> None:
        """Fit from the starts that are left, until the device comes near to the recordings."""
        for begin in self.starts:
            _least_squares(residuals, begin, self.switches, self.best)
            if self.reached:
                return


@dataclass(frozen=True)
class _Trial:
    """The best fit, with the errors that it leaves; ``slopes``: None if it was interrupted or had nothing to fit."""

    told: Sequence[Adjustable]
    untold: Mapping[str, tuple[Untold, tuple[str, ...]]]
    switches: Mapping[str, bool]
    values: Mapping[str, float | bool]
    errors: Numbers
    slopes: Matrix | None

    @property
    def cost(self) -> float:
        return float(self.errors @ self.errors)


def fit_parameters(
    device: PlayedDevice,
    events: Sequence[RecordedEvent],
    wanted: Wanted,
    report: Report = lambda text: None,
) -> Fit:
    """Least squares over all events; parameters that they cannot tell are left where they are, and named before.

    Raises a `CosimError` if the device does not run with its own values."""
    stretches = stretches_of(device, events)
    residuals = Residuals(device, stretches, report)
    starts = {name: bool(device.value(name)) for name in wanted.switches}
    before = residuals.at({})
    searches: list[_Search] = []
    slopes: Matrix | None = None
    finished = False
    try:
        _search(residuals, wanted, searches)
        slopes = _slopes_of_all(residuals, _best_of(searches))
        finished = True
    except KeyboardInterrupt:
        if not any(one.best.exists for one in searches):
            raise
    found = _best_of(searches)
    values = found.best.values
    errors = residuals.at(values)
    best = _Trial(found.told, found.untold, found.switches, values, errors, slopes)
    numbers = _numbers(best, wanted, residuals)
    if finished and rms(best.errors) > max(_REACHED, _LEAVES * rms(before)):
        numbers = [_left_at_start(one) for one in numbers]
    beyond = None
    if finished and rms(best.errors) > _REACHED:
        beyond = rms(np.maximum(np.abs(best.errors) - residuals.doubt_between(values), 0.0))
    parameters = [*_switches(best, searches, starts, residuals), *numbers]
    if not finished:
        parameters = [_interrupted(one) for one in parameters]
    return Fit(
        parameters=parameters,
        fitted_to=[one.recording.label for one in events],
        error_before=rms(before),
        error_after=rms(best.errors),
        runs=residuals.runs,
        finished=finished,
        beyond=beyond,
    )


def _search(residuals: Residuals, wanted: Wanted, searches: list[_Search]) -> None:
    """Fit once in every position of the switches; from further starts only where none of these fits will do."""
    for position in itertools.product((False, True), repeat=len(wanted.switches)):
        switches = dict(zip(wanted.switches, position, strict=True))
        searches.append(_begun(residuals, wanted.numbers, switches))
        searches[-1].fit_once(residuals)
    for one in sorted(searches, key=lambda one: one.best.cost):
        if any(other.reached for other in searches):
            return
        one.fit_until_reached(residuals)


def _begun(
    residuals: Residuals, numbers: Sequence[Adjustable], switches: Mapping[str, bool]
) -> _Search:
    told, untold = identifiable(residuals, numbers, switches)
    if told:
        return _Search(switches, told, untold, _starts(residuals, told, switches))
    errors = residuals.at(switches)
    best = _Best(float(errors @ errors), rms(errors), dict(switches))
    return _Search(switches, told, untold, iter(()), best)


def _best_of(searches: Sequence[_Search]) -> _Search:
    """The search that leaves the least; one that was interrupted before it had values is none."""
    return min((one for one in searches if one.best.exists), key=lambda one: one.best.cost)


def _slopes_of_all(residuals: Residuals, found: _Search) -> Matrix | None:
    """How the errors move with each parameter and each hidden voltage, at the best values."""
    if not found.told:
        return None
    values = found.best.values
    own = _slopes_inside(residuals, found.told, values)
    return np.column_stack([own, residuals.hidden_slopes(values)])


def _starts(
    residuals: Residuals, told: Sequence[Adjustable], switches: Mapping[str, bool]
) -> Iterator[list[Adjustable]]:
    """The parameters as the model has them; each at the best of its own curve; then points spread evenly around.

    Each is asked for only if the fits from those before it did not reach the recordings."""
    yield list(told)
    yield _best_of_curves(residuals, told, switches)
    points = stats.qmc.Halton(len(told), seed=1).random(_STARTS - 1)
    for point in points:
        yield [
            replace(one, start=one.start + (2 * part - 1) * _FARTHEST * one.reach)
            for one, part in zip(told, map(float, point), strict=True)
        ]


def _best_of_curves(
    residuals: Residuals, told: Sequence[Adjustable], switches: Mapping[str, bool]
) -> list[Adjustable]:
    """One parameter after the other at the doubling or halving of its start that leaves the least in the mean.

    From far away, as a tenth of an inertia, no slope leads to the value: the swing is out of phase all the way."""
    values: dict[str, float | bool] = {**switches, **{one.name: one.inside() for one in told}}
    factors = [2.0**k for k in range(-_DOUBLINGS, _DOUBLINGS + 1)]

    def cost(name: str, value: float) -> float:
        errors = means_over(residuals.stretches, _COARSE, residuals.at({**values, name: value}))
        return float(np.sum(errors**2))

    found = []
    for one in told:
        residuals.report(f"looking along {one.name}")
        curve = {factor * one.start for factor in factors} | {float(values[one.name])}
        inside = sorted(x for x in curve if one.low <= x <= one.high)
        residuals.announce([{**values, one.name: x} for x in inside])
        costs = [cost(one.name, x) for x in inside]
        values[one.name] = inside[int(np.argmin(costs))]
        found.append(replace(one, start=float(values[one.name])))
    return found


def _slopes_inside(
    residuals: Residuals,
    told: Sequence[Adjustable],
    values: Mapping[str, float | bool],
    *,
    both_sides: bool = True,
) -> Matrix:
    """How the errors move with each parameter; next to a bound at a point so far within it that both sides are."""
    at = [replace(one, start=float(values[one.name])) for one in told]
    within = [replace(one, start=one.inside()) for one in at]
    there = {**values, **{one.name: one.start for one in within}}
    steps = {one.name: one.step for one in within}
    return residuals.slopes(there, steps, both_sides=both_sides)


@dataclass(frozen=True)
class _Stage:
    """A part of a fit: means of the errors over a time [s], and the relative gain at which it ends."""

    residuals: Residuals
    mean: float
    tolerance: float
    best: _Best
    both_sides: bool  # of a parameter, by which its slope is found


def _least_squares(
    residuals: Residuals, told: Sequence[Adjustable], switches: Mapping[str, bool], best: _Best
) -> None:
    """From one start: by means over some time first, whose minimum is wide, then by the samples.

    The first part may be in longer steps: it says where the second one begins, and is the answer where it is all."""
    first = _Stage(residuals.rough, _COARSE, _COARSE_TOLERANCE, _Best(), both_sides=False)
    second = _Stage(residuals, 0.0, _TOLERANCE, best, both_sides=True)
    hidden = residuals.hidden
    at = np.array(
        [*(one.inside() / one.reach for one in told), *[0.0] * len(hidden)], dtype=np.float64
    )
    try:
        at = _stage_end(first, told, switches, at)
    except KeyboardInterrupt:
        if not best.values:
            best.values = first.best.values
        raise
    _stage_end(second, told, switches, at)


def _stage_end(
    stage: _Stage, told: Sequence[Adjustable], switches: Mapping[str, bool], at: Numbers
) -> Numbers:
    """Where a part of a fit ends, in units of the reach, as it begins."""
    residuals, best, hidden = stage.residuals, stage.best, stage.residuals.hidden
    names = [*(one.name for one in told), *(one.name for one in hidden)]
    reach = np.array([*(one.reach for one in told), *(one.scale for one in hidden)])
    mean = partial(means_over, residuals.stretches, stage.mean)

    def values(x: Numbers) -> dict[str, float | bool]:
        own = {name: float(v) for name, v in zip(names, x * reach, strict=True)}
        return {**switches, **own}

    def errors(x: Numbers) -> Numbers:
        given = values(x)
        found = residuals.at(given)
        cost = float(found @ found)
        if cost < best.cost:
            best.cost, best.rms, best.values = cost, rms(found), given
            said = ", ".join(f"{one.name} = {given[one.name]:.4g}" for one in told)
            residuals.report(
                f"fit: rms error {rms(found):.4g} times the recording's noise with {said}"
            )
        return mean(found)

    def slopes(x: Numbers) -> Matrix:
        given = values(x)
        own = _slopes_inside(residuals, told, given, both_sides=stage.both_sides)
        return mean(np.asarray(np.column_stack([own, residuals.hidden_slopes(given)]) * reach))

    free = len(hidden)
    low = np.array([*(one.low for one in told), *[-np.inf] * free]) / reach
    high = np.array([*(one.high for one in told), *[np.inf] * free]) / reach
    return np.asarray(
        optimize.least_squares(
            errors,
            at,
            jac=slopes,
            bounds=(low, high),
            xtol=stage.tolerance,
            ftol=max(stage.tolerance, _untold_part(residuals, values(at))),
            gtol=_NO_SLOPE,
            max_nfev=_MOST_RUNS,
        ).x
    )


def _untold_part(residuals: Residuals, values: Mapping[str, float | bool]) -> float:
    """The part of the sum of squares that says nothing: samples that are alike count once."""
    errors = residuals.at(values)
    return _UNTOLD_GAIN / max(independent_samples(errors, residuals.stretches), 1.0)


def identifiable(
    residuals: Residuals, numbers: Sequence[Adjustable], switches: Mapping[str, bool]
) -> tuple[list[Adjustable], dict[str, tuple[Untold, tuple[str, ...]]]]:
    """Which parameters the recordings can tell, and why not the others: by singular values, before anything is fitted.

    The errors' slopes are in scatters, a sample counts as often as it is unlike those beside it, and a parameter is
    moved by its reach. A direction whose singular value is small moves nothing that can be seen: the parameter with the
    largest part in it is left where it is."""
    untold: dict[str, tuple[Untold, tuple[str, ...]]] = {}
    interval = min(one.event.recording.interval for one in residuals.stretches)
    told = []
    for one in numbers:
        if one.unit == "s" and is_too_fast(one.start, interval):
            untold[one.name] = (Untold.TOO_FAST, ())
        else:
            told.append(one)
    if not told:
        return told, untold
    base = {**switches, **{one.name: one.inside() for one in told}}
    at = [replace(one, start=float(base[one.name])) for one in told]
    slopes = residuals.slopes(base, {one.name: one.step for one in at})
    errors = residuals.at(base)
    alike = len(errors) / max(independent_samples(errors, residuals.stretches), 1.0)
    hidden = residuals.hidden_slopes(base)
    slopes = slopes - hidden @ np.linalg.lstsq(hidden, slopes, rcond=None)[0]
    scaled = slopes * np.array([one.reach for one in told]) / np.sqrt(max(alike, 1.0))
    while told:
        _, singular, right = np.linalg.svd(scaled, full_matrices=False)
        if singular[-1] >= _TELLS:
            break
        direction = np.abs(right[-1])
        out = int(direction.argmax())
        names = [one.name for one in told]
        others = [n for n, part in zip(names, direction, strict=True) if part > _TAKES_PART]
        others.remove(names[out])
        why = Untold.ALIKE if others else Untold.NO_EFFECT
        untold[names[out]] = (why, tuple(others))
        told.pop(out)
        scaled = np.delete(scaled, out, axis=1)
    return told, untold


def _numbers(best: _Trial, wanted: Wanted, residuals: Residuals) -> list[FittedParameter]:
    widths = _half_widths(best, residuals)
    found = []
    for one in wanted.numbers:
        if one.name in best.untold:
            why, alike = best.untold[one.name]
            nothing = FittedParameter(one.name, one.unit, one.start, one.start, None, None)
            found.append(replace(nothing, untold=why, alike=alike))
            continue
        value, width = float(best.values[one.name]), widths.get(one.name)
        fitted = FittedParameter(one.name, one.unit, one.start, value, None, None)
        if width is not None:
            doubt = _doubt(one, value, width)
            fitted = replace(fitted, untold=doubt)
            if doubt is not Untold.AT_BOUND and np.isfinite(
                width
            ):  # there the interval ends at no error's minimum
                fitted = replace(fitted, low=value - width, high=value + width)
        found.append(fitted)
    return found


def _left_at_start(one: FittedParameter) -> FittedParameter:
    """A parameter of a fit that found nothing better: where the model has it, without an interval."""
    if one.untold not in (None, Untold.AT_BOUND, Untold.WIDE):
        return one
    return replace(one, value=one.start, low=None, high=None, untold=Untold.NO_BETTER)


def _interrupted(one: FittedParameter) -> FittedParameter:
    """A parameter that an interrupted fit does not tell; a reason of its own stays."""
    return one if one.untold else replace(one, untold=Untold.INTERRUPTED)


def _doubt(one: Adjustable, value: float, width: float) -> Untold | None:
    if width > max(one.reach, abs(value)):
        return Untold.WIDE
    near = max(1e-6 * (one.high - one.low), _NEAR_BOUND * one.reach)  # the solver stays within
    at_bound = min(value - one.low, one.high - value) <= near
    return Untold.AT_BOUND if at_bound else None


def _half_widths(best: _Trial, residuals: Residuals) -> dict[str, float]:
    """Half widths of the intervals of 95 %; the voltage between samples is one of the unknowns, and its moment a doubt.

    So is its way between slow samples: each value may be off by as much as another way would move it.

    None if the fit was interrupted."""
    if best.slopes is None:
        return {}
    if np.linalg.matrix_rank(best.slopes) < best.slopes.shape[1]:
        return {one.name: np.inf for one in best.told}
    spread = np.sqrt(np.diag(covariance(best.slopes, best.errors, residuals.stretches)))
    free = independent_samples(best.errors, residuals.stretches) - len(spread)
    quantile = float(stats.t.ppf(0.5 + _SURE / 2, max(free, 3.0)))
    later = residuals.hidden_later(best.values)
    shift = np.linalg.lstsq(best.slopes, later, rcond=None)[0]
    gains = np.linalg.lstsq(best.slopes, gain_errors(residuals.stretches, len(later)), rcond=None)[
        0
    ]
    widths = quantile * spread + np.abs(shift) + np.abs(gains).sum(axis=1)
    for ways in residuals.of_other_voltages(best.values):
        moved = np.linalg.lstsq(best.slopes, ways, rcond=None)[0]
        widths = widths + np.abs(moved).max(axis=1)
    return {one.name: float(widths[k]) for k, one in enumerate(best.told)}


def _switches(
    best: _Trial, searches: Sequence[_Search], starts: Mapping[str, bool], residuals: Residuals
) -> list[FittedParameter]:
    """Each switch: its position, told where every fit with the other one is clearly worse."""
    count = len(best.errors)
    variance = max(best.cost / count, 1.0)
    alike = count / max(independent_samples(best.errors, residuals.stretches), 1.0)
    found = []
    for name, start in starts.items():
        value = best.switches[name]
        others = [one.best.cost for one in searches if one.switches[name] != value]
        worse = (min(others) - best.cost) / (variance * alike) if others else 0.0
        untold = None if worse > _SWITCH_TELLS else Untold.NO_EFFECT
        kept = value if untold is None else start
        sure = kept if untold is None else None
        found.append(FittedParameter(name, "", start, kept, sure, sure, untold=untold))
    return found

"""Limits of the current as causes: read off the record, or tried at levels while a model is held in step."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.validation.cause_bench import (
    CauseBench,
    Values,
    other_positions,
    squares_of,
)
from orchestrator.studies.validation.cause_numbers import follow, promises_of
from orchestrator.studies.validation.causes import CauseKind, Explanation, cap_of_current, capped

_LIMITS_ARE = (0.9, 2.0)  # times the plant's largest current, as numbers in pu that may be limits
_LEVELS = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7)
"""Times that current, at which they are tried: the current may be nearly all along the limited axis."""

_CLEARLY = 1.3  # times less that two numbers leave, to be named in place of one
_MOST_LIMITS = 12  # values that are tried as a limit, with the kinds that would use them


def limits_of_current(bench: CauseBench) -> Iterator[Explanation]:
    """A current that the plant does not exceed and the model does, and the parameters that would limit it so."""
    voltages = [np.abs(one.recording.voltage) for one in bench.events]
    measured = [one.recording.power for one in bench.events]
    limit = cap_of_current(bench.base, measured, voltages)
    if limit is None:
        return
    left = bench.errors(capped(bench.base, voltages, limit))
    yield bench.explanation(CauseKind.LIMIT, "limit of the current", None, limit, left, unit="pu")
    tried: list[tuple[float, VariableInfo, Values]] = []
    limiters = list(itertools.islice(_limiters(bench, limit), _MOST_LIMITS))
    bench.announce(values for _, values in limiters)
    for info, values in limiters:
        said = " with ".join(f"{name} = {value:.4g}" for name, value in values.items())
        bench.report(f"trying {said}")
        found = bench.responses(values)
        if found is not None:
            error = bench.errors(found)
            tried.append((float(error @ error), info, values))
    for count in (1, 2):  # a number by itself, which is the simpler cause, and one with a kind
        likely = [one for one in tried if len(one[2]) == count]
        if likely:
            _, info, values = min(likely, key=lambda one: one[0])
            yield from _limiter(bench, info, values)


def levels_of_limits(bench: CauseBench, rough: CauseBench) -> Iterator[Explanation]:
    """Numbers that may be limits of the current, at levels below the plant's largest: one of an axis acts below it.

    A model that is held in step far from the plant shows no level by itself, as `cap_of_current` looks for."""
    seen, likely = largest_current(bench), likely_limits(bench)
    best = list(_best_level(bench, rough, [(info,) for info in likely], seen))
    yield from best
    for one in _best_level(bench, rough, _axes(bench, likely), seen):
        if not best or one.left * _CLEARLY < best[0].left:  # a number by itself is simpler
            yield one


def likely_limits(bench: CauseBench) -> list[VariableInfo]:
    """Numbers near the plant's largest current, which may be limits of it or of an axis."""
    seen = largest_current(bench)
    return [info for info in bench.parameters("Real") if _may_limit(bench, info, seen)]


def _may_limit(bench: CauseBench, info: VariableInfo, seen: float) -> bool:
    value = bench.device.value(info.name)
    return info.unit == "pu" and _LIMITS_ARE[0] * seen <= value <= _LIMITS_ARE[1] * seen


def _axes(
    bench: CauseBench, likely: Sequence[VariableInfo]
) -> Iterator[tuple[VariableInfo, VariableInfo]]:
    """Two limits of one part that are alike, as those of both axes are."""
    for one, other in itertools.combinations(likely, 2):
        alike = bench.device.value(one.name) == bench.device.value(other.name)
        if alike and one.name.rpartition(".")[0] == other.name.rpartition(".")[0]:
            yield one, other


def _best_level(
    bench: CauseBench, rough: CauseBench, groups: Iterable[Sequence[VariableInfo]], seen: float
) -> Iterator[Explanation]:
    """The numbers, several at one level or each alone, that leave the least, followed to their best value."""
    tried: list[tuple[float, VariableInfo, Values]] = []
    for group in groups:
        for part in _LEVELS:
            values: Values = {info.name: part * seen for info in group}
            bench.report(f"trying {' and '.join(values)} = {part * seen:.4g}")
            found = rough.responses(values)
            if found is not None:
                tried.append((squares_of(rough.errors(found)), group[0], values))
    if tried:
        _, info, values = min(tried, key=lambda one: one[0])
        yield from _limiter(bench, info, values)


def largest_current(bench: CauseBench) -> float:
    """Largest of the measured currents [pu of the rating]."""
    found = []
    for event in bench.events:
        good = event.recording.good
        current = event.recording.power[good] / event.recording.voltage[good]
        found.append(float(np.abs(current).max()))
    return max(found)


def _limiters(bench: CauseBench, limit: float) -> Iterator[tuple[VariableInfo, Values]]:
    """Numbers that may be limits and are too high, with a kind of the same part that would use them.

    Those that act on nothing come first: a limit that cuts a short peak moves the response a little, and more would."""
    idle = {info.name for info in bench.idle}
    above = [
        info
        for info in bench.parameters("Real")
        if info.unit == "pu" and bench.device.value(info.name) > limit
    ]
    for info in sorted(above, key=lambda one: one.name not in idle):
        yield info, {info.name: limit}
        part = info.name.rpartition(".")[0]
        for kind, value in other_positions(bench):
            if kind.type == "Integer" and kind.name.rpartition(".")[0] == part:
                yield info, {kind.name: value, info.name: limit}


def _limiter(bench: CauseBench, info: VariableInfo, values: Values) -> Iterator[Explanation]:
    """A parameter that limits the current, followed to its best value, with the kind that uses it.

    Numbers beside it keep its value."""
    device = bench.device.with_values(values)
    other = CauseBench(device, bench.events, bench.report, bench.hidden)
    level = float(values[info.name])
    beside = [name for name in values if name != info.name]
    kinds = [name for name in beside if bench.is_kind(name)]
    together = [name for name in beside if name not in kinds]
    best = level, other.error
    for promise in promises_of(other, [info], together):
        best = follow(other, promise, together)
    value, left = best
    if kinds:
        name = kinds[0]
        now = bench.device.value(name)
        found = bench.explanation(CauseKind.POSITION, name, now, values[name], left)
        yield replace(found, beside={info.name: value})
    else:
        now = bench.device.value(info.name)
        found = bench.explanation(
            CauseKind.VALUE, info.name, now, value, left, unit=info.unit or ""
        )
        yield replace(found, beside=dict.fromkeys(together, value))

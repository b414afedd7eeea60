"""Two causes at once: beside the number or the switch that explains the most, another one, and both at their best.

Two limits are tried by themselves, as one that is not reached moves nothing."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.late import optimize
from orchestrator.studies.validation.cause_bench import (
    CauseBench,
    Values,
    other_positions,
    squares_of,
)
from orchestrator.studies.validation.cause_limits import largest_current, likely_limits
from orchestrator.studies.validation.cause_numbers import Promise, promises_of
from orchestrator.studies.validation.causes import EXPLAINS, CauseKind, Explanation
from orchestrator.studies.validation.parameters import Adjustable, adjustable

_LEAST_SHARE = 0.5  # part of the squared error that the first number explains, to look beside it
_FOLLOWED = 3  # numbers that are followed beside the first one, those that promise the most
_FOLLOWED_POSITIONS = 2  # positions beside the first one, those that leave the least
_MOST_STEPS = 8  # of both numbers together, three runs each
_SETTLED = 1e-3  # relative gain at which they are at their best
_LEVELS_BESIDE = (0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5, 0.45, 0.4, 0.35, 0.3)
"""Times the plant's largest current, at which the limit of another axis is tried: that current is mostly along one."""

_REFUSED = 10.0  # error [pu] of values with which the device does not run


def cause_beside(bench: CauseBench, rough: CauseBench, first: Explanation) -> Iterator[Explanation]:
    """The first number or switch with the cause beside it that explains most of what it leaves; nothing if none does.

    The first one's number no longer has the value that it had alone: it held the other one's part as well."""
    if not first.takes_second or first.share < _LEAST_SHARE:
        return
    there = CauseBench(
        rough.device.with_values(first.values), rough.events, rough.report, rough.hidden
    )
    promises = {one.number.name: one for one in promises_of(there, there.parameters("Real"))}
    own = [promises.pop(name) for name in (first.name, *first.beside) if name in promises]
    if first.cause is CauseKind.VALUE and not own:
        return
    kept = [one.number for one in own]
    likely = sorted(promises.values(), key=lambda one: -_gain_beside(own, one, there.error))
    tried = [_best_together(there, (*kept, one.number)) for one in likely[:_FOLLOWED]]
    tried += [
        _best_together(there, kept, position) for position in _positions_beside(there, first.name)
    ]
    found = [_pair(bench, first, values) for values in tried]
    best = min(filter(None, found), key=lambda one: one.left, default=None)
    if best is not None and _explains_rest(best, first):
        yield best


def _positions_beside(bench: CauseBench, first: str) -> Iterator[Values]:
    """The other positions that leave the least beside a first cause, and less than it does by itself."""
    found: list[tuple[float, Values]] = []
    others = [(info.name, value) for info, value in other_positions(bench)]
    bench.announce({name: value} for name, value in others if name != first)
    for info, value in other_positions(bench):
        bench.report(f"trying {info.name} = {str(value).lower()} beside {first}")
        answers = None if info.name == first else bench.responses({info.name: value})
        left = np.inf if answers is None else squares_of(bench.errors(answers))
        if left < squares_of(bench.error):
            found.append((left, {info.name: value}))
    for _, values in sorted(found, key=lambda one: one[0])[:_FOLLOWED_POSITIONS]:
        yield values


def pair_of_limits(
    bench: CauseBench, rough: CauseBench, first: Explanation
) -> Iterator[Explanation]:
    """A limit with another one of its part, each at its own level; nothing where that explains little more.

    Where the model has it, the other one may not be reached, and no slope leads to its level."""
    if first.cause is not CauseKind.VALUE or first.beside or not first.leaves_much:
        return
    seen = largest_current(rough)
    likely = [info.name for info in likely_limits(rough)]
    if first.name not in likely:
        return
    part = first.name.rpartition(".")[0]
    others = [name for name in likely if name != first.name and name.rpartition(".")[0] == part]
    tried: list[tuple[float, Values]] = []
    levels = list(itertools.product(others, _LEVELS_BESIDE))
    each: list[Values] = [{**first.values, name: level * seen} for name, level in levels]
    rough.announce(each)
    for (name, level), values in zip(levels, each, strict=True):
        bench.report(f"trying {name} = {level * seen:.4g} beside {first.name}")
        found = rough.responses(values)
        if found is not None:
            tried.append((squares_of(rough.errors(found)), values))
    if not tried:
        return
    _, values = min(tried, key=lambda one: one[0])
    there = CauseBench(rough.device.with_values(values), rough.events, rough.report, rough.hidden)
    known = there.device.description.variables
    numbers = [adjustable(there.device, known[name], None) for name in values]
    both = _pair(bench, first, _best_together(there, numbers))
    if both is not None and _explains_rest(both, first):
        yield both


def _gain_beside(first: Sequence[Promise], other: Promise, error: Numbers) -> float:
    """The part of the squared error that another number promises, where the first ones move with it [pu²]."""
    if not first:
        return other.gain(error)
    ways = np.column_stack([one.slope for one in first])
    along = np.linalg.lstsq(ways, other.slope, rcond=None)[0]
    return replace(other, slope=other.slope - ways @ along).gain(error)


def _best_together(
    bench: CauseBench, numbers: Sequence[Adjustable], position: Values = MappingProxyType({})
) -> Values:
    """Values of several numbers that leave the least, by least squares from where they are.

    ``position``: another value that the device has all along."""
    if not numbers:
        return position
    names, reach = [one.name for one in numbers], np.array([one.reach for one in numbers])
    bench.report(f"following {' and '.join([*position, *names])}")

    def values(x: Numbers) -> dict[str, float | bool]:
        return {**position, **dict(zip(names, map(float, x * reach), strict=True))}

    def errors(x: Numbers) -> Numbers:
        found = bench.responses(values(x))
        return np.full(len(bench.error), _REFUSED) if found is None else bench.errors(found)

    low, high = (np.array([getattr(one, end) for one in numbers]) for end in ("low", "high"))
    begin = np.array([one.inside() for one in numbers]) / reach
    best = optimize.least_squares(
        errors,
        begin,
        bounds=(low / reach, high / reach),
        diff_step=0.01,
        ftol=_SETTLED,
        xtol=_SETTLED,
        gtol=None,
        max_nfev=_MOST_STEPS,
    )
    return values(best.x)


def _pair(bench: CauseBench, first: Explanation, others: Values) -> Explanation | None:
    """Both causes as one, with what the device leaves in its own steps; None where it does not run so."""
    values = {**first.values, **others}
    found = bench.responses(values)
    if found is None:
        return None
    value = values.pop(first.name)
    left = bench.errors(found)
    both = bench.explanation(CauseKind.PAIR, first.name, first.now, value, left, unit=first.unit)
    now = {name: bench.device.value(name) for name in values}
    return replace(both, beside=values, beside_now=now)


def _explains_rest(pair: Explanation, first: Explanation) -> bool:
    """Return whether most of what the first cause leaves beyond the scatter goes away with the second one."""
    rest, left = (max(one.left**2 - one.noise**2, 0.0) for one in (first, pair))
    return left <= (1 - EXPLAINS) * rest

"""Two numbers that are off at once: beside the number that explains the most, another one, and both at their best.

Two limits are tried by themselves, as one that is not reached moves nothing."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.late import optimize
from orchestrator.studies.validation.cause_bench import CauseBench, Values, squares_of
from orchestrator.studies.validation.cause_limits import largest_current, likely_limits
from orchestrator.studies.validation.cause_numbers import Promise, promises_of
from orchestrator.studies.validation.causes import EXPLAINS, CauseKind, Explanation
from orchestrator.studies.validation.parameters import Adjustable, adjustable

_LEAST_SHARE = 0.5  # part of the squared error that the first number explains, to look beside it
_FOLLOWED = 3  # numbers that are followed beside the first one, those that promise the most
_MOST_STEPS = 8  # of both numbers together, three runs each
_SETTLED = 1e-3  # relative gain at which they are at their best
_LEVELS_BESIDE = (0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5, 0.45, 0.4, 0.35, 0.3)
"""Times the plant's largest current, at which the limit of another axis is tried: that current is mostly along one."""

_REFUSED = 10.0  # error [pu] of values with which the device does not run


def pair_of_numbers(
    bench: CauseBench, rough: CauseBench, first: Explanation
) -> Iterator[Explanation]:
    """The first number with the one beside it that explains most of what it leaves; nothing where none does.

    The first one's value is no longer that which it had alone: it held the other one's part as well."""
    if first.cause is not CauseKind.VALUE or first.beside or first.share < _LEAST_SHARE:
        return
    there = CauseBench(
        rough.device.with_values(first.values), rough.events, rough.report, rough.hidden
    )
    promises = {one.number.name: one for one in promises_of(there, there.parameters("Real"))}
    own = promises.pop(first.name, None)
    if own is None:
        return
    likely = sorted(promises.values(), key=lambda one: -_gain_beside(own, one, there.error))
    found = [
        _pair(bench, first, _best_together(there, (own.number, one.number)))
        for one in likely[:_FOLLOWED]
    ]
    best = min(filter(None, found), key=lambda one: one.left, default=None)
    if best is not None and _explains_rest(best, first):
        yield best


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
    for name, level in itertools.product(others, _LEVELS_BESIDE):
        values: Values = {**first.values, name: level * seen}
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


def _gain_beside(first: Promise, other: Promise, error: Numbers) -> float:
    """The part of the squared error that another number promises, where the first one moves with it [pu²]."""
    along = float(first.slope @ other.slope) / squares_of(first.slope)
    return replace(other, slope=other.slope - along * first.slope).gain(error)


def _best_together(bench: CauseBench, numbers: Sequence[Adjustable]) -> Mapping[str, float]:
    """Values of several numbers that leave the least, by least squares from where they are."""
    names, reach = [one.name for one in numbers], np.array([one.reach for one in numbers])
    bench.report(f"following {' and '.join(names)}")

    def values(x: Numbers) -> dict[str, float]:
        return dict(zip(names, map(float, x * reach), strict=True))

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


def _pair(bench: CauseBench, first: Explanation, values: Mapping[str, float]) -> Explanation | None:
    """Both numbers as one cause, with what the device leaves in its own steps; None where it does not run so."""
    found = bench.responses(values)
    if found is None:
        return None
    beside = {name: value for name, value in values.items() if name != first.name}
    left = bench.errors(found)
    alone = bench.explanation(
        CauseKind.PAIR, first.name, first.now, values[first.name], left, unit=first.unit
    )
    now = {name: float(bench.device.value(name)) for name in beside}
    return replace(alone, beside=beside, beside_now=now)


def _explains_rest(pair: Explanation, first: Explanation) -> bool:
    """Return whether most of what the first number leaves beyond the scatter goes away with the second one."""
    rest, left = (max(one.left**2 - one.noise**2, 0.0) for one in (first, pair))
    return left <= (1 - EXPLAINS) * rest

"""Numbers of a device as causes of its errors: followed along their slopes, and tried at doublings and halvings.

A straight line around the model's value does not lead to one that is off by a factor: half an inertia swings out of
phase all the way."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from orchestrator.core.arrays import Numbers
from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.validation.cause_bench import (
    CauseBench,
    Responses,
    Values,
    squares_of,
)
from orchestrator.studies.validation.causes import CauseKind, Explanation
from orchestrator.studies.validation.parameters import Adjustable, adjustable

_STEP = 0.02  # difference for a sensitivity, as part of a parameter's reach
_FOLLOWED = 5  # numbers that are followed to their best value, those that promise the most
_MOST_STEPS = 5  # runs in which one is followed
_SETTLED = 1e-3  # part of the squared error: a smaller gain ends the following
_FACTORS = (0.5, 2.0)  # by which a number is tried at first, and as long as it leaves less
_MOST_FACTORS = 4  # of one number in one direction: a sixteenth, and sixteen times
_FOLLOWED_FAR = 3  # numbers that are followed from the best of these


@dataclass(frozen=True)
class Promise:
    """A number, and what a small change of it does to the responses and to the errors, both by its unit."""

    number: Adjustable
    moves: Responses
    slope: Numbers

    def gain(self, error: Numbers) -> float:
        """The part that a straight line promises to take of the squared error [pu²]."""
        return float(self.slope @ error) ** 2 / float(self.slope @ self.slope)


def numbers_by_slope(
    bench: CauseBench, rough: CauseBench, promises: Sequence[Promise]
) -> Iterator[Explanation]:
    """The numbers that promise the most, each followed by itself to where it leaves the least."""
    ordered = sorted(promises, key=lambda one: -one.gain(rough.error))[:_FOLLOWED]
    followed = [
        (one.number, _Place(one.number.start, rough.error, one.slope), "") for one in ordered
    ]
    yield from _followed(bench, rough, followed)


def promises_of(
    bench: CauseBench, parameters: Iterable[VariableInfo], others: Sequence[str] = ()
) -> Iterator[Promise]:
    """The numbers among some parameters that move the response at all; ``others``: as in `follow`."""
    numbers = [(info, adjustable(bench.device, info, None)) for info in parameters]
    free = [(info, one, _small_step(one)) for info, one in numbers if one.high > one.low]
    moved = [dict.fromkeys((one.name, *others), one.start + step) for _, one, step in free]
    bench.announce(moved)
    for (info, one, step), values in zip(free, moved, strict=True):
        bench.report(f"sensitivity to {one.name}")
        found = bench.responses(values)
        if found is None:
            continue
        slope = (bench.errors(found) - bench.error) / step
        if float(slope @ slope) * one.reach**2 > _SETTLED**2 * float(bench.error @ bench.error):
            pairs = zip(found, bench.base, strict=True)
            yield Promise(one, [(power - base) / step for power, base in pairs], slope)
        else:
            bench.idle.append(info)


def _small_step(one: Adjustable) -> float:
    """A difference for a sensitivity, to the side at which the number may be."""
    step = _STEP * one.reach
    return step if one.start + step <= one.high else -step


def follow(
    bench: CauseBench, promise: Promise, others: Sequence[str] = ()
) -> tuple[float, Numbers]:
    """The best value of one number, from its start on.

    ``others``: numbers that have the same value all along."""
    begin = _Place(promise.number.start, bench.error, promise.slope)
    (best,) = _ends_of(bench, [_way_to_best(bench, promise.number, begin, others)])
    return best


End = TypeVar("End")
Way = Generator[Values, Responses | None, End]
"""Values of a number, one after the other: each asks for the responses with it, and the last one tells the end."""


def _ends_of(bench: CauseBench, ways: Sequence[Way[End]]) -> list[End]:
    """Where some ways end, which go on side by side: what all of them ask for next may be made at once."""
    ends: dict[int, End] = {}
    asked: dict[int, Values] = {}

    def go_on(number: int, found: Responses | None) -> None:
        """Let a way go on with what it asked for until it asks again; ``None`` lets it begin as well."""
        try:
            asked[number] = ways[number].send(found)
        except StopIteration as end:
            ends[number] = end.value

    for number in range(len(ways)):
        go_on(number, None)
    while asked:
        now = asked.copy()
        asked.clear()
        bench.announce(now.values())
        for number, values in now.items():
            go_on(number, bench.responses(values))
    return [ends[number] for number in range(len(ways))]


@dataclass(frozen=True)
class _Place:
    """A value of a number, with its error and how that moves with the number there."""

    value: float
    error: Numbers
    slope: Numbers


def _way_to_best(
    bench: CauseBench, number: Adjustable, begin: _Place, others: Sequence[str] = ()
) -> Way[tuple[float, Numbers]]:
    """The best value of a number, by Gauss and Newton with secants for slopes."""
    at, error, slope = begin.value, begin.error, begin.slope
    size = squares_of(slope)
    way = -float(slope @ error) / size if size > 0 else 0.0
    for _ in range(_MOST_STEPS):
        value = min(max(at + way, number.low), number.high)
        moved = dict.fromkeys((number.name, *others), value)
        found = (yield moved) if value != at else None
        here = None if found is None else bench.errors(found)
        gained = -1.0 if here is None else float(error @ error - here @ here)
        if here is None or gained < 0:
            way *= 0.4
            continue
        slope = (here - error) / (value - at)
        done = gained < _SETTLED * float(error @ error)
        at, error = value, here
        size = squares_of(slope)
        if done or size == 0:
            break
        way = -float(slope @ error) / size
    return at, error


def numbers_by_factors(
    bench: CauseBench, rough: CauseBench, promises: Sequence[Promise]
) -> Iterator[Explanation]:
    """Positive numbers at doublings and halvings; those that leave the least are followed from there.

    One that moves nothing where it is may be a limit that is not reached: it is tried lower."""
    moving = [(one.number, _FACTORS) for one in promises]
    idle = [(adjustable(bench.device, info, None), _FACTORS[:1]) for info in rough.idle]
    tried = [*moving, *idle]
    ways = [
        _along_factors(rough, number, factor) for number, factors in tried for factor in factors
    ]
    ends = iter(_ends_of(rough, ways))
    found: list[tuple[float, Adjustable, _Place]] = []
    for number, factors in tried:
        places = [place for _ in factors for place in next(ends)]
        if places:
            best = min(places, key=lambda one: squares_of(one.error))
            found.append((squares_of(best.error), number, best))
    likely = sorted(found, key=lambda one: one[0])[:_FOLLOWED_FAR]
    followed = [(number, place, f" from {place.value:.4g}") for _, number, place in likely]
    yield from _followed(bench, rough, followed)


def _may_be(number: Adjustable, value: float) -> bool:
    """Return whether a positive number may have a value at a factor of its own."""
    return number.start > 0 and number.low <= value <= number.high


def _along_factors(rough: CauseBench, number: Adjustable, factor: float) -> Way[list[_Place]]:
    """A number at a factor, at its square and so on, as long as each leaves less than the one before."""
    places: list[_Place] = []
    at, error = number.start, rough.error
    for _ in range(_MOST_FACTORS):
        value = factor * at
        if not _may_be(number, value):
            break
        rough.report(f"trying {number.name} = {value:.4g}")
        found = yield {number.name: value}
        here = None if found is None else rough.errors(found)
        if here is None or squares_of(here) >= squares_of(error):
            break
        places.append(_Place(value, here, (here - error) / (value - at)))
        at, error = value, here
    return places


def _followed(
    bench: CauseBench, rough: CauseBench, followed: Sequence[tuple[Adjustable, _Place, str]]
) -> Iterator[Explanation]:
    """Numbers at their best values, with what the device leaves there in its own steps.

    ``followed``: each with the place from which it is followed, and how that is said."""
    ways = []
    for number, place, said in followed:
        bench.report(f"following {number.name}{said}")
        ways.append(_way_to_best(rough, number, place))
    best = _ends_of(rough, ways)
    if rough is not bench:
        bench.announce(
            {one.name: value} for (one, _, _), (value, _) in zip(followed, best, strict=True)
        )
    for (number, _, _), (value, left) in zip(followed, best, strict=True):
        found = None if rough is bench else bench.responses({number.name: value})
        yield bench.explanation(
            CauseKind.VALUE,
            number.name,
            number.start,
            value,
            left if found is None else bench.errors(found),
            unit=number.unit,
        )

"""How far a number that is a cause may be off with nothing to see: a limit that no recording reaches has no value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.studies.validation.cause_bench import CauseBench, squares_of
from orchestrator.studies.validation.causes import Bound, Explanation
from orchestrator.studies.validation.correlation import correlation_length
from orchestrator.studies.validation.parameters import Adjustable, adjustable
from orchestrator.studies.validation.residuals import LEAST_SCATTER

_NOISE_TAKES = 3.84
"""Squares [independent scatters²] by which two values differ by noise alone, in 19 of 20: chi square, one freedom."""

_BETWEEN = (
    4  # values that are looked at side by side, between one that leaves more and one that does not
)
_ROUNDS = 3  # of these: the bound is known to a hundredth of the way from the model's value
_FEWEST_ALIKE = 2  # values up to the end of a range that leave as little, to tell a bound
_SAME = 1e-9  # rms error [pu of the rating] by which two answers differ that nothing tells apart


@dataclass(frozen=True)
class _Place:
    """A value of a number, with the error that it leaves."""

    value: float
    error: Numbers

    @property
    def squares(self) -> float:
        """The squared error [pu²]."""
        return squares_of(self.error)


def with_bound(bench: CauseBench, cause: Explanation) -> Explanation:
    """A cause of one number, with the value from which on all others leave as little, where there is one.

    The model's own value leaves more, so that the bound lies between it and the cause's value, or beyond that where the
    search ended too early. What is beyond is looked at halfway to the end of the number's range, and there."""
    known = bench.device.description.variables[cause.name]
    number = adjustable(bench.device, known, None)
    own = float(cause.value)
    places = _places_at(bench, number.name, [own, *_beyond(number, own)])
    if not places:
        return cause
    least = min(places, key=lambda one: one.squares)
    most = least.squares + _taken_by_noise(bench, least.error)
    more = [k for k, one in enumerate(places) if one.squares > most]
    alike = places[more[-1] + 1 if more else 0 :]
    if len(alike) < _FEWEST_ALIKE:
        return cause
    first = _first_alike(bench, number, alike[0], most)
    reached = squares_of(alike[-1].error - alike[-2].error) > _SAME**2
    bound = Bound(first.value, is_least=first.value > number.start, is_reached=reached)
    if alike[0].value == own:
        return replace(cause, bound=bound)
    return replace(cause, bound=bound, value=first.value, left=first.squares**0.5)


def _taken_by_noise(bench: CauseBench, error: Numbers) -> float:
    """The squared error by which noise alone moves the best value [pu²].

    An error that is larger than the noise counts as noise: the model is off elsewhere."""
    size = max(bench.noise**2, 2 * LEAST_SCATTER**2, squares_of(error))
    independent = 0.0
    begin = 0
    for event in bench.events:
        count = int(event.recording.good.sum())
        for _ in ("p", "q"):
            independent += count / correlation_length(error[begin : begin + count])
            begin += count
    return _NOISE_TAKES * size / max(independent, 1.0)


def _beyond(number: Adjustable, best: float) -> list[float]:
    """Values on the other side of the best one than the model's: halfway to the end of its range, and the end."""
    end = number.high if best > number.start else number.low
    return [] if end == best else [_way(best, end, 2)[0], end]


def _first_alike(bench: CauseBench, number: Adjustable, alike: _Place, most: float) -> _Place:
    """The value nearest to the model's that leaves no more than this [pu²], from one that does not."""
    off = number.start
    for _ in range(_ROUNDS):
        values = _way(alike.value, off, _BETWEEN + 1)
        places = {one.value: one for one in _places_at(bench, number.name, values)}
        for value in values:
            if value not in places or places[value].squares > most:
                off = value
                break
            alike = places[value]
    return alike


def _way(begin: float, end: float, parts: int) -> list[float]:
    """Values between two, by equal factors where both have one sign."""
    if begin * end > 0:
        return [float(x) for x in np.geomspace(begin, end, parts + 1)[1:-1]]
    return [float(x) for x in np.linspace(begin, end, parts + 1)[1:-1]]


def _places_at(bench: CauseBench, name: str, values: Sequence[float]) -> list[_Place]:
    """The errors with each value with which the device runs."""
    bench.announce({name: value} for value in values)
    found = []
    for value in values:
        bench.report(f"looking whether {name} = {value:.4g} leaves as little")
        answers = bench.responses({name: value})
        if answers is not None:
            found.append(_Place(value, bench.errors(answers)))
    return found

"""Causes of an error that stand in no parameter: a response that comes later, and a current that the plant limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from orchestrator.core.arrays import Complex, Numbers

_TIMES_SCATTER = 3.0  # times the recordings' scatter, above which what a cause leaves is no scatter
_LEAST_LEFT = 0.001  # what samples and steps make of a right model [pu of the rating]
_HARDLY_APART = (
    1.3  # times the error that the best cause leaves, up to which another one is hardly told apart
)
EXPLAINS = 0.75  # part of the squared error beyond the scatter that an explanation takes away
_NOISE_ALONE = 1.7
"""Times the scatter, up to which an error may be scatter alone: a second before the event tells its size to a third.

Of 26 right models beside samples 1 ms apart 21 had 0.78 to 1.57; of 26 with one wrong value one had 1.06, as noise hid
it, and the others had 1.94 and more. Three right ones in dips had 2.2 to 8, and two whose current comes to its limit 14
and 59: there play-back multiplies what the samples do not hold. A voltage turned by 0.001 degrees for 6 ms at the event
moved these two by 75 and 400 times as much at the limit as at once; the second one without its limit by less than at
once."""

_TAKES = (
    1 / 3
)  # part of the rms error that a likely cause takes away at least, whatever the scatter is
_AS_GOOD = 1.1
"""Times the least error left, up to which a position leads: a number has one freedom more, which wins it a little."""

_MOST_DELAY = 0.25  # longest delay that is looked for [s]
_DELAYS = 100  # that are tried at first
_BETWEEN = 5  # between two of these, around the best one
_LEAST_DELAY = 0.002  # [s]
_LEVELS = 200  # limits of the current that are tried
_ABOVE = 1.03  # times a limit which the measured current reaches at its most
_FEWEST = 5  # samples that a limit changes
_STAYS = 0.3  # part of the model's way above a limit that the measured current is off it there
_LEAST_VOLTAGE = 1e-3  # [pu]

Responses = Sequence[Complex]
Errors = Callable[[Responses], Numbers]


class CauseKind(StrEnum):
    """Programs decide by it."""

    VALUE = "value"
    POSITION = "position"
    DELAY = "delay"
    LIMIT = "limit"
    PAIR = "pair"
    LAG = "lag"
    CLOCK = "clock"
    NOISE = "noise"


_WITHOUT_VALUES = {*CauseKind} - {CauseKind.VALUE, CauseKind.POSITION, CauseKind.PAIR}


@dataclass(frozen=True)
class Bound:
    """A value from which on all others leave as little of an error, so that the recordings tell no single one.

    ``is_least``: whether these are above it; ``is_reached``: whether the answer changes beyond it at all."""

    value: float
    is_least: bool
    is_reached: bool


@dataclass(frozen=True)
class Explanation:
    """One cause by itself, and the error that it leaves: rms of P and Q together [pu of the rating].

    ``now`` is None where the model has no such limit; ``noise``: the recordings' own scatter [pu of the rating]."""

    cause: CauseKind
    name: str
    unit: str
    now: float | bool | None
    value: float | bool
    error: float
    left: float
    noise: float = 0.0
    beside: Mapping[str, float | bool] = field(default_factory=dict)  # others with their values
    beside_now: Mapping[str, float | bool] = field(default_factory=dict)  # of a pair, in the model
    outdone: bool = False  # whether another cause leaves clearly less
    stands_in: bool = (
        False  # whether it may only stand for a limit of the current that the model lacks
    )
    bound: Bound | None = None  # of a number with no single value that explains the error
    behind_question: bool = False  # whether a yes to what is asked leaves clearly less

    @property
    def share(self) -> float:
        """Part of the squared error beyond the scatter that goes away with it, 0 to 1."""
        beyond = self.error**2 - self.noise**2
        rest = max(self.left**2 - self.noise**2, 0.0)
        return min(max(1 - rest / beyond, 0.0), 1.0) if beyond > 0 else 0.0

    @property
    def explains(self) -> bool:
        """Return whether most of the error goes away with it, and no other cause leaves clearly less.

        Of an error that is hardly beyond the scatter, none does: a freedom more takes a little of any noise."""
        ruled_out = self.outdone or self.stands_in or self.hardly_beyond
        return self.share >= EXPLAINS and not ruled_out

    @property
    def is_likely(self) -> bool:
        """Return whether it explains most of the error, and no yes to what is asked explains clearly more."""
        return self.explains and not self.behind_question

    @property
    def hardly_beyond(self) -> bool:
        """Return whether the error itself is hardly beyond the scatter, so that there is nothing to explain."""
        little = self.share >= EXPLAINS and self.left > (1 - _TAKES) * self.error
        return little or self.error <= _NOISE_ALONE * self.noise

    @property
    def leaves_much(self) -> bool:
        """Return whether what is left stands far above the scatter: something else is off as well."""
        return leaves_much(self.left, self.noise)

    @property
    def leaves_some(self) -> bool:
        """Return whether what is left stands above the scatter, if only by what samples and steps make."""
        return self.noise > 0 and self.left > _TIMES_SCATTER * self.noise

    @property
    def values(self) -> dict[str, float | bool]:
        """Values with which a device has this cause; empty for what no parameter has."""
        if self.cause in _WITHOUT_VALUES:
            return {}
        return {self.name: self.value, **self.beside}

    @property
    def takes_second(self) -> bool:
        """Return whether another cause is looked for beside it, if it leaves much: of one number, or of a switch."""
        return self.is_number_alone or self.cause is CauseKind.POSITION

    @property
    def is_number_alone(self) -> bool:
        """Return whether it is another value of one number, and nothing beside it."""
        return self.cause is CauseKind.VALUE and not self.beside

    def same_as(self, other: Explanation) -> bool:
        """Return whether another cause, found on another way, is of the same parameters.

        Positions of one kind are different causes, values of one number are not."""
        mine, its = ((x.cause, x.name, *x.beside) for x in (self, other))
        return mine == its and (self.cause is not CauseKind.POSITION or self.value == other.value)

    @property
    def is_position_alone(self) -> bool:
        """Return whether it is another position of a switch or a kind, without a number beside it."""
        return self.cause is CauseKind.POSITION and not self.beside

    def leaves_less_than(self, best: Explanation) -> bool:
        """Return whether it leaves less than the best cause before it: clearly less, where that is a position alone."""
        return self.left < best.left / (_AS_GOOD if best.is_position_alone else 1.0)

    def is_beside(self, best: Explanation) -> bool:
        """Return whether the recordings hardly tell it apart from the cause that leaves the least."""
        return self.left < max(_HARDLY_APART * best.left, best.noise)

    def leaves_clearly_more(self, left: float) -> bool:
        """Return whether it leaves clearly more than this [pu of the rating], and more than the scatter."""
        return self.left >= max(_HARDLY_APART * left, self.noise)

    def as_json(self) -> dict[str, Any]:
        return {
            "cause": str(self.cause),
            "parameter": self.name,
            "unit": self.unit,
            "now": self.now,
            "value": self.value,
            **self._bound_json(),
            "with": dict(self.beside),
            "with_now": dict(self.beside_now),
            "rms_now_pu": self.error,
            "rms_left_pu": self.left,
            "share": self.share,
            "explains": self.is_likely,
            "behind_question": self.behind_question,
            "leaves_much": self.leaves_much,
            "noise_pu": self.noise,
            "hardly_beyond_noise": self.hardly_beyond,
        }

    def _bound_json(self) -> dict[str, Any]:
        """The bound of its value; nulls where the value itself is told."""
        if self.bound is None:
            return {"at_least": None, "at_most": None, "bound_is_reached": None}
        told, other = ("at_least", "at_most") if self.bound.is_least else ("at_most", "at_least")
        return {told: self.bound.value, other: None, "bound_is_reached": self.bound.is_reached}


@dataclass(frozen=True)
class CauseSearch:
    """Causes that were found, the one that leaves the least first.

    ``finished``: whether all were tried; ``held``: whether the model was held in step for it."""

    causes: Sequence[Explanation]
    finished: bool = True
    held: bool = False

    @property
    def explains(self) -> bool:
        """Return whether the first of them takes most of the error away."""
        return bool(self.causes) and self.causes[0].explains

    @property
    def runs_explained(self) -> bool:
        """Return whether a device can be run with the first cause, and so explains most of the error."""
        return self.explains and not self.held and bool(self.causes[0].values)


def nothing_to_explain(causes: Sequence[Explanation]) -> bool:
    """Return whether the error is hardly beyond the scatter, so that no cause of it is likely."""
    return bool(causes) and causes[0].hardly_beyond


def leaves_much(left: float, noise: float) -> bool:
    """Return whether an error stands far above what the recordings scatter [pu of the rating]."""
    return left > max(_TIMES_SCATTER * noise, _LEAST_LEFT)


def without_worse_ways(causes: Sequence[Explanation]) -> list[Explanation]:
    """Each cause once, of those that leave the least first; one that leaves clearly more than the first is outdone.

    Where the first leaves the recordings' scatter, what leaves more is off; where it does not, as well: the data
    speak for the first. A position that leaves as little goes before it: `pod_p.enabled = false`, and not a gain of
    nearly nothing."""
    found: list[Explanation] = []
    for one in _simplest_first(causes):
        if not any(one.same_as(other) for other in found):
            found.append(replace(one, outdone=bool(found) and not one.is_beside(found[0])))
    return found


def _simplest_first(causes: Sequence[Explanation]) -> list[Explanation]:
    """The causes, and first of them the position alone that leaves as little as the best does, where there is one."""
    for one in causes:
        if one.is_position_alone and one.left <= _AS_GOOD * causes[0].left:
            return [one, *(other for other in causes if other is not one)]
    return list(causes)


def later(
    responses: Responses, without: Responses, intervals: Sequence[float], delay: float
) -> list[Complex]:
    """Responses of which the part that stands above others comes later by a time [s]."""
    return [
        rest + _shifted(whole - rest, delay / interval)
        for whole, rest, interval in zip(responses, without, intervals, strict=True)
    ]


def _shifted(values: Complex, samples: float) -> Complex:
    at = np.arange(len(values))
    found: Complex = np.interp(at - samples, at, values)
    return found


def delay_of(
    responses: Responses, without: Responses, intervals: Sequence[float], errors: Errors
) -> float | None:
    """The time by which a part of the responses comes later in the recordings [s]; None where none explains them."""

    def cost(delay: float) -> float:
        return _squares(errors(later(responses, without, intervals, delay)))

    coarse = np.linspace(-_MOST_DELAY, _MOST_DELAY, _DELAYS + 1)
    best = int(np.argmin([cost(one) for one in coarse]))
    if best in (0, _DELAYS):
        return None
    fine = np.linspace(coarse[best - 1], coarse[best + 1], 2 * _BETWEEN + 1)
    delay = float(fine[int(np.argmin([cost(one) for one in fine]))])
    return delay if abs(delay) >= _LEAST_DELAY else None


def capped(responses: Responses, voltages: Sequence[Numbers], limit: float) -> list[Complex]:
    """Responses that are cut where their current is above a limit [pu of the rating], at their own angle.

    The measured angle would be a freedom for each sample, which no other cause has."""
    found = []
    for own, voltage in zip(responses, voltages, strict=True):
        found.append(own / np.maximum(_current(own, voltage) / limit, 1.0))
    return found


def cap_of_current(
    responses: Responses, measured: Responses, voltages: Sequence[Numbers]
) -> float | None:
    """The limit at which the measured current stays while the model's is above it [pu of the rating].

    None where the plant shows none: its current is not still while the model's moves."""
    own, seen = (
        np.concatenate([_current(x, v) for x, v in zip(powers, voltages, strict=True)])
        for powers in (responses, measured)
    )
    levels = np.linspace(float(seen.max()) / _ABOVE, float(own.max()), _LEVELS)
    costs = [_squares(np.minimum(own, level) - seen) for level in levels]
    limit = float(levels[int(np.argmin(costs))])
    above = own > limit
    if above.sum() < _FEWEST:
        return None
    stays = _squares(seen[above] - limit) <= _STAYS**2 * _squares(own[above] - limit)
    return limit if stays else None


def _current(power: Complex, voltage: Numbers) -> Numbers:
    return np.asarray(np.abs(power) / np.maximum(voltage, _LEAST_VOLTAGE))


def _squares(error: Numbers) -> float:
    return float(error @ error)

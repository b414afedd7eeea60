"""The verdict on a design over operating points, from modes that were computed anew at every point."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ, damping_ratio
from orchestrator.studies.coordinated_design.following import origin
from orchestrator.studies.coordinated_design.objective import (
    UNMOVED,
    Aim,
    Watched,
    Worth,
    floors_of,
    growth,
    kept_as_they_are,
    nearest,
    split,
    worth_of,
)
from orchestrator.studies.coordinated_design.open_loops import Setting
from orchestrator.studies.coordinated_design.point import PointModes
from orchestrator.studies.operating_points.outages import Outage
from orchestrator.studies.operating_points.points_file import OperatingCase

MORE = 1.2  # of all gains: a setting that is not good enough with them has no margin
# from this difference of damping ratios on, the search's models and the modes anew disagree
ASTRAY = 1e-3
# controllers move a mode out of 0.1 to 2 Hz by less than this factor of its frequency
_BESIDE = 1.5

# damping ratios that differ by no more are the same: what a perturbation leaves open
_SAME = 1e-4


@dataclass(frozen=True)
class PlacedMode:
    """A mode [rad/s] with who takes part most; "" where that is not known."""

    value: complex
    who: str

    @property
    def damping_ratio(self) -> float:
        return damping_ratio(self.value)

    @property
    def frequency_hz(self) -> float:
        return self.value.imag / (2 * np.pi)

    @property
    def words(self) -> str:
        return f"{self.frequency_hz:.3f} Hz, {100 * self.damping_ratio:.2f} %" + (
            f" ({self.who})" if self.who else ""
        )


@dataclass(frozen=True)
class JudgedPoint:
    point: OperatingCase
    outage: Outage
    before: PointModes
    after: PointModes
    # target_before, target: the least damped of the modes that the design damps; None where there is none
    target_before: PlacedMode | None = None
    target: PlacedMode | None = None
    # the other mode that is farthest below its floor, or nearest to it; None where there is none
    other: PlacedMode | None = None
    # least damping and breach with the controllers; None where nothing is known
    worth: Worth | None = None
    # the same worth from the search's linear models; None where they were not asked
    predicted: Worth | None = None
    # whether a name that is asked for is borne by no mode here, so that all electromechanical ones count
    unnamed: bool = False
    # least_before, least: the least damped of all modes from 0.1 to 2 Hz, whatever the design damps
    least_before: PlacedMode | None = None
    least: PlacedMode | None = None
    # modes from 0.1 to 2 Hz with the controllers that these do not move, and that the design leaves as they are
    apart: tuple[PlacedMode, ...] = ()
    # modes that the controllers move out of 0.1 to 2 Hz; the design damps them as before
    left: tuple[PlacedMode, ...] = ()

    @property
    def computed(self) -> bool:
        return self.before.computed and self.after.computed

    @property
    def grows(self) -> bool:
        return growth(self.after.values) > 0

    @property
    def stable(self) -> bool | None:
        """Return whether it is stable with the controllers; None where that is not known."""
        if self.grows:
            return False
        return True if self.after.computed and not self.after.doubtful else None

    @property
    def where(self) -> str:
        return f"{self.point.name}, {self.outage.name}"

    @property
    def unmoved(self) -> bool:
        """True if the controllers move the mode by less than 0.2 points of damping: a tenth of what a search passes.

        The least damped mode before may be another one; so the mode is sought among all that there were."""
        if self.target is None:
            return False
        value = self.target.value
        apart = np.abs(self.before.values - value).min(initial=np.inf)
        return bool(apart < 0.1 * UNMOVED * abs(value))

    @property
    def lower(self) -> float:
        """By how much the least damping ratio of what the design damps is lower than before; negative if higher."""
        if self.target_before is None or self.target is None:
            return 0.0
        return self.target_before.damping_ratio - self.target.damping_ratio

    @property
    def why_not(self) -> str:
        failed = self.before if not self.before.computed else self.after
        with_it = "" if not self.before.computed else " with the controllers"
        return "" if self.computed else f"{failed.status}{with_it}: {failed.text}"

    @property
    def astray(self) -> float:
        """By how much the search's models were wrong on the least damping ratio."""
        if self.predicted is None or self.worth is None or self.left:
            return 0.0
        return abs(self.predicted.worst - self.worth.worst)

    @property
    def unforeseen(self) -> bool:
        """Return whether a mode grows or falls below its floor, and the search's models did not show it."""
        return bool(
            self.worth and self.predicted and not self.worth.allowed and self.predicted.allowed
        )


def judge_points(
    where: Sequence[tuple[OperatingCase, Outage]],
    before: Sequence[PointModes],
    after: Sequence[PointModes],
    aim: Aim,
    predicted: Mapping[int, Worth],
    apart: Mapping[int, Sequence[complex]] = MappingProxyType({}),
    *,
    setting: Setting | None = None,
) -> Iterator[JudgedPoint]:
    """The points with their modes anew.

    ``predicted``, ``apart``: by number of the point, the search's worth, and the modes without the controllers [rad/s]
    that stand apart.
    ``setting``: of the controllers, to tell which modes these move out of the range; None if that is not asked."""
    for k, here in enumerate(where):
        origins = None if setting is None else partial(_origin, before[k], setting)
        point = _judge_point(here, before[k], after[k], aim, apart.get(k, ()), origins)
        yield replace(point, predicted=predicted.get(k))


def _judge_point(
    where: tuple[OperatingCase, Outage],
    before: PointModes,
    after: PointModes,
    aim: Aim,
    apart: Sequence[complex],
    origins: Callable[[complex], complex | None] | None = None,
) -> JudgedPoint:
    if not (before.computed and after.computed):
        return JudgedPoint(*where, before, after)
    first = _watched(before, aim, floors_of((), 0.0), apart)
    floors = floors_of((mode.value for mode in first if mode.floor is not None), aim.least)
    second = _watched(after, aim, floors, apart)
    left = [] if origins is None or _targets(after, aim) is not None else _departed(second, origins)
    second = [replace(mode, floor=None) if mode.place in left else mode for mode in second]
    others = [mode for mode in second if mode.floor is not None]
    closest = min(others, key=lambda mode: mode.damping - (mode.floor or 0.0), default=None)
    beside = [k for value in apart if (k := nearest(second, value)) is not None]
    other = None if closest is None else _placed_mode(closest, after)
    left_modes = tuple(_placed_mode(mode, after) for mode in second if mode.place in left)
    return JudgedPoint(
        *where,
        before,
        after,
        target_before=_least(first, before),
        target=_least(second, after),
        other=other,
        worth=worth_of(second, growth(after.values), growth(before.values)),
        unnamed=any(name not in point.named for point in (before, after) for name in aim.names),
        least_before=_least_of_all(before),
        least=_least_of_all(after),
        apart=tuple(_placed_mode(second[k], after) for k in dict.fromkeys(beside)),
        left=left_modes,
    )


def _departed(
    watched: Sequence[Watched], origins: Callable[[complex], complex | None]
) -> list[int]:
    """Places of the modes beside 0.1 to 2 Hz that come from there and have less damping than all that are there.

    Only those would change what a point comes to."""
    least = min((mode.damping for mode in watched if mode.floor is None), default=np.inf)
    low, high = (2 * np.pi * hertz for hertz in ELECTROMECHANICAL_HZ)
    found = []
    for mode in watched:
        beside = low / _BESIDE < mode.value.imag < _BESIDE * high
        if mode.floor is None or not beside or mode.damping >= least:
            continue
        origin = None if low <= mode.value.imag <= high else origins(mode.value)
        if origin is not None and low <= origin.imag <= high:
            found.append(mode.place)
    return found


def _origin(before: PointModes, setting: Setting, value: complex) -> complex | None:
    """The mode without the controllers [rad/s] from which one with them comes; None if that cannot be told."""
    if before.loops is None:
        return None
    try:
        return origin(before.loops, setting, value)
    except AnalysisError:
        return None


def _watched(
    point: PointModes, aim: Aim, floors: Mapping[int, float], apart: Sequence[complex]
) -> list[Watched]:
    return kept_as_they_are(split(point.values, _targets(point, aim), floors), apart)


def least_of(
    points: Sequence[PointModes],
    aim: Aim,
    apart: Mapping[int, Sequence[complex]] = MappingProxyType({}),
) -> float | None:
    """Least damping ratio of all modes that a design damps at all points; None where a point has no modes or grows."""
    if not all(point.computed and growth(point.values) == 0 for point in points):
        return None
    every = (
        _least(_watched(point, aim, floors_of((), 0.0), apart.get(k, ())), point)
        for k, point in enumerate(points)
    )
    return min((mode.damping_ratio for mode in every if mode is not None), default=None)


def _least_of_all(point: PointModes) -> PlacedMode | None:
    return _least(split(point.values, None, floors_of((), 0.0)), point)


def _targets(point: PointModes, aim: Aim) -> list[int] | None:
    """Places of the named modes; None where all count."""
    if not aim.names or any(name not in point.named for name in aim.names):
        return None
    return [point.named[name] for name in aim.names]


def _least(watched: Sequence[Watched], point: PointModes) -> PlacedMode | None:
    found = min(
        (mode for mode in watched if mode.floor is None),
        key=lambda mode: mode.damping,
        default=None,
    )
    return None if found is None else _placed_mode(found, point)


def _placed_mode(mode: Watched, point: PointModes) -> PlacedMode:
    who = dict(zip(point.swinging, point.who, strict=True)).get(mode.place, "")
    return PlacedMode(mode.value, who)


class PointsVerdict:
    """Verdict on a design over all points.

    ``wanted``: damping ratio that is wanted everywhere; None for the best that there is.
    ``largest``: the largest gain that the search was allowed [pu].
    ``compared``: number of settings of an exhaustive grid none of which was better; 0 without one.
    ``thin``: least damping ratio with `MORE` of the gains, where that is too much for it or other modes; else None.
    ``names``: the modes that were asked for; none where all count."""

    def __init__(
        self,
        points: Sequence[JudgedPoint],
        wanted: float | None,
        largest: float = 0.0,
        compared: int = 0,
        thin: float | None = None,
        *,
        names: Sequence[str] = (),
    ) -> None:
        self.points, self.wanted, self.largest = tuple(points), wanted, largest
        self.names = tuple(names)
        self.compared, self.thin = compared, thin
        self.known = [point for point in points if point.computed]
        self.failed = [point for point in points if not point.computed]
        self.unstable = [point for point in self.known if point.grows]
        self.harmed = [
            point for point in self.known if point.worth is not None and not point.worth.allowed
        ]
        self.doubtful = [point for point in self.known if point.after.doubtful]

    @property
    def limiting(self) -> JudgedPoint | None:
        """The point with the least damping; None where no point has a mode to be damped."""
        having = [point for point in self.known if point.target is not None]
        return min(having, key=lambda point: _damping(point.target), default=None)

    @property
    def some_apart(self) -> bool:
        """Return whether modes stand apart anywhere, however well they are damped."""
        return any(point.apart for point in self.known)

    @property
    def least_before(self) -> JudgedPoint | None:
        """The point with the least damped of all modes from 0.1 to 2 Hz without the controllers."""
        having = [point for point in self.known if point.least_before is not None]
        return min(having, key=lambda point: _damping(point.least_before), default=None)

    @property
    def least(self) -> JudgedPoint | None:
        """The point with the least damped of all modes from 0.1 to 2 Hz, whatever the design damps."""
        having = [point for point in self.known if point.least is not None]
        return min(having, key=lambda point: _damping(point.least), default=None)

    @property
    def apart(self) -> list[tuple[JudgedPoint, PlacedMode]]:
        """The modes that stand apart with less damping than is wanted, or than the design's own; least damped first."""
        limit = self.wanted if self.wanted is not None else _or_one(self.worst)
        every = ((point, mode) for point in self.known for mode in point.apart)
        below = [one for one in every if one[1].damping_ratio < limit]
        return sorted(below, key=lambda one: one[1].damping_ratio)

    @property
    def below(self) -> tuple[JudgedPoint, PlacedMode] | None:
        """The least damped of all modes from 0.1 to 2 Hz, with its point, if it has less than is wanted."""
        point = self.least
        if self.wanted is None or point is None or point.least is None:
            return None
        return (point, point.least) if point.least.damping_ratio < self.wanted else None

    @property
    def worst(self) -> float | None:
        limiting = self.limiting
        return None if limiting is None else _damping(limiting.target)

    @property
    def limiting_before(self) -> JudgedPoint | None:
        """The point with the least damping without the controllers; None where no point has a mode to be damped."""
        having = [point for point in self.known if point.target_before is not None]
        return min(having, key=lambda point: _damping(point.target_before), default=None)

    @property
    def worst_before(self) -> float | None:
        before = self.limiting_before
        return None if before is None else _damping(before.target_before)

    @property
    def lowered(self) -> list[JudgedPoint]:
        """Points whose least damping is lower with the controllers, that with the greatest loss first."""
        found = [point for point in self.known if point.lower > _SAME]
        return sorted(found, key=lambda point: -point.lower)

    @property
    def stable(self) -> bool | None:
        """True if every point is stable with the controllers; None where that is not known of all and none grows."""
        if self.unstable:
            return False
        return None if self.failed or self.doubtful else True

    @property
    def met(self) -> bool | None:
        """True if the wanted damping is reached everywhere, or, where none is wanted, the least one is better than
        before; None where points have no modes or a limit is near, and no other point says no."""
        wanted, worst, before = self.wanted, self.worst, self.worst_before
        enough = worst is None or (
            worst >= wanted if wanted is not None else before is None or worst > before
        )
        if self.unstable or self.harmed or not enough:
            return False
        return None if self.failed or self.doubtful else True

    @property
    def astray(self) -> list[JudgedPoint]:
        """Points at which the search's models were wrong, the worst first."""
        return sorted((p for p in self.known if p.astray > ASTRAY), key=lambda point: -point.astray)

    @property
    def unforeseen(self) -> list[JudgedPoint]:
        return [point for point in self.known if point.unforeseen]


def _or_one(damping: float | None) -> float:
    return 1.0 if damping is None else damping


def _damping(mode: PlacedMode | None) -> float:
    return 1.0 if mode is None else mode.damping_ratio

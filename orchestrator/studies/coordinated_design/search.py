"""The search for the setting with the best worst damping: a sequence of linear programs on real closed loops.

Each step takes the eigenvalues of all operating points with their sensitivities to all settings, and asks a linear
program for the change that raises the least damping ratio most, without other modes falling below their floors. The
change counts only if the eigenvalues that it really gives are better."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.bisection import halve_towards
from orchestrator.core.late import optimize
from orchestrator.studies.coordinated_design.objective import RatedPoint, Watched, Worth, together
from orchestrator.studies.coordinated_design.open_loops import PodPlace, Setting
from orchestrator.studies.coordinated_design.settings import PodGroup, SettingSpace
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import angle_deg, compensation_deg
from orchestrator.studies.points.under_way import tell_doing
from orchestrator.studies.sensitivities.sensitivities import damping_change

# of where the sensitivities are trusted, as parts of the ranges
_RADIUS = 0.15  # at the start
_SMALLEST = 2e-4
_LARGEST = 0.4
_STEPS = 60
_PRICE = 10.0  # what a breach costs, in damping ratio
# weight of the least damping of those modes that are moved more than hardly, beside that of all
_BESIDE = 1e-3
# modes whose damping ratio is farther than this above the least one, or above their floor, are
# left out of a linear program
_NEAR = 0.3
_NEAR_FLOOR = 0.1
_APART = 0.2
_EDGE = 0.1  # edge of the first simplex of the polishing, as a part of the ranges
_POLISHING = 40  # evaluations of the polishing for each value that is searched
_DIFFERENCE = 1e-6
_HALVINGS_OF_GAINS = 12  # of the part of all gains that is enough: to 0.02 %
_WORTH = 1e-6
_IDLE = 1e-4  # merit (damping ratio) that a controller must bring to be kept
_TURNS, _CENTRES, _GAINS = (-90.0, -45.0, 0.0, 45.0, 90.0), (0.7, 1.0, 1.8), (0.05, 0.15, 0.4, 1.0)
_STARTS = 4  # searches besides the chosen starts, for one controller
_STARTS_OF_SEVERAL = 6  # the same for several controllers
_GRID, _LEAST_SHARE = (13, 6, 9), 0.025
"""Turns, centres and gains of an exhaustive grid, and its smallest gain as a part of the largest."""
# sum of the cubes of all points' numbers of states up to which a grid is computed
_MOST_CUBED = 4e6
_SPREAD = 64  # vectors that are spread over all ranges for each of several groups
_MOST_SPREAD = 256  # such vectors at most


IsBetter = Callable[["Tried", "Tried"], bool]
"""Whether a vector is better than another one."""


@dataclass(frozen=True)
class Tried:
    """A vector, its worth, and the number of linear programs that led there."""

    x: Numbers
    worth: Worth
    steps: int = 0

    @property
    def merit(self) -> float:
        """One number: larger is better."""
        worst = (1 - _BESIDE) * self.worth.worst + _BESIDE * self.worth.rest
        return worst - _PRICE * max(0.0, self.worth.breach)


class SettingSearch:
    def __init__(
        self, space: SettingSpace, points: Sequence[RatedPoint], name: str = "search"
    ) -> None:
        """``name``: in words, for whoever waits."""
        self._space, self._points, self._name = space, tuple(points), name
        self.evaluations = 0

    def tried(self, x: Numbers, steps: int = 0) -> Tried:
        setting = self._begin(x)
        return Tried(x, together(point.worth(setting) for point in self._points), steps)

    def _begin(self, x: Numbers) -> Setting:
        self.evaluations += 1
        tell_doing(f"{self._name}, {self.evaluations} settings tried")
        return self._space.setting(x)

    def _above(self, x: Numbers, other: Tried, is_better: IsBetter, steps: int = 0) -> Tried | None:
        """A vector as `tried` has it, if it is better than another one.

        A further point makes no vector better, so that the first ones may decide. The point that limits the other
        vector is asked first."""
        setting, worths = self._begin(x), dict[int, Worth]()
        places = range(len(self._points))
        one = None
        for k in sorted(places, key=lambda k: self._points[k].number != other.worth.point):
            worths[k] = self._points[k].worth(setting)
            one = Tried(x, together(worths[k] for k in places if k in worths), steps)
            if not is_better(one, other):
                return None
        return one

    def best(self, starts: int | None = None, *, polish: bool = True) -> Tried:
        """The best vector that the search finds; it harms no other mode, unless every vector does.

        ``starts``: number of vectors of the coarse scan that are improved; by default 4, for several groups 6.
        ``polish``: whether the best is improved without sensitivities as well."""
        several = len(self._space.groups) > 1
        scanned = sorted((self.tried(x) for x in self._coarse()), key=lambda one: -one.merit)
        chosen = self._alone() if several else []
        most = len(chosen) + (starts or (_STARTS_OF_SEVERAL if several else _STARTS))
        for part, number in (
            (slice(None), most if several else most // 2),
            (slice(1), most),
        ):  # then with other turns
            for one in scanned:
                if len(chosen) < number and all(
                    np.abs(one.x - other.x)[part].max() > _APART for other in chosen
                ):
                    chosen.append(one)
        found = max(
            [scanned[0], *map(self.improved, chosen)],
            key=lambda one: (one.worth.allowed, one.merit),
        )
        return self.improved(self._polished(found)) if polish else found

    def over_grid(self, found: Tried) -> tuple[Tried, int]:
        """The better of a vector and what an exhaustive grid of settings leads to, and the number of its settings.

        There is none for several groups, and where the eigenvalues of so many settings would take too long."""
        cost = sum(len(point.loops.A) ** 3 for point in self._points)
        if len(self._space.groups) > 1 or cost > _MOST_CUBED:
            return found, 0
        low, high = self._space.lowest, self._space.highest
        ends = [
            np.unique(np.linspace(low[k], high[k], number)) for k, number in enumerate(_GRID[:2])
        ]
        gains = np.unique(np.geomspace(max(low[2], _LEAST_SHARE * high[2]), high[2], _GRID[2]))
        grid, best = [np.array(x) for x in product(*ends, gains)], found
        for x in grid:
            best = self._above(x, best, _does_less_harm_or_damps_more) or best
        if best is not found:
            found = self.improved(self._polished(best))
        return found, len(grid)

    def without_idle(self, found: Tried, least: float | None) -> Tried:
        """The vector without the gains that bring less than a hundredth of a point; the smallest go first, and one
        stays.

        ``least``: damping ratio that a vector which has it must keep; None where none is wanted."""
        for k in sorted(range(len(self._space.groups)), key=lambda k: found.x[3 * k + 2]):
            x = found.x.copy()
            x[3 * k + 2] = 0.0
            if not x[2::3].any() or self._space.lowest[3 * k + 2] > 0:
                continue
            one = self.tried(x, found.steps)
            kept = least is None or one.worth.worst >= min(least, found.worth.worst)
            if one.worth.allowed and kept and one.merit >= found.merit - _IDLE:
                found = one
        return found

    def _alone(self) -> list[Tried]:
        """The best setting of each group alone, with the others at their smallest gain."""
        found = []
        for k, group in enumerate(self._space.groups):
            space = self._space.of_group(group)
            search = SettingSearch(space, self._points)
            one, x = search.best(), self._space.clipped(np.zeros(len(self._space.lowest)))
            x[3 * k : 3 * k + 3] = one.x
            self.evaluations += search.evaluations
            found.append(self.tried(x))
        return found

    def _coarse(self) -> Iterator[Numbers]:
        """Vectors around the turns that the residues ask for, with common offsets, centres and gains."""
        turns, count = self._wanted_turns(), len(self._space.groups)
        yield self._space.clipped(np.zeros(3 * count))
        for offset, centre, share in product(_TURNS, _CENTRES, _GAINS):
            # of 200° and −160°, one can be had
            angles = [(turn + offset + 180.0) % 360.0 - 180.0 for turn in turns]
            x = self._space.vector(angles, [centre] * count, [0.0] * count)
            x[2::3] = share
            yield self._space.clipped(x)
        if count > 1:
            from scipy.stats.qmc import Sobol  # noqa: PLC0415 - a second to import

            spread = Sobol(3 * count, seed=0).random(min(_SPREAD * count, _MOST_SPREAD))
            yield from self._space.lowest + spread * (self._space.highest - self._space.lowest)

    def _wanted_turns(self) -> list[float]:
        """For each group, the angle [°] that turns the residues of the worst modes of all points to 180° on average."""
        sums = np.zeros(len(self._space.groups), dtype=complex)
        for point in self._points:
            shares = point.residues()
            sums += [
                sum(shares.get(place, 0j) for place in group.places) for group in self._space.groups
            ]
        return [
            compensation_deg(angle_deg(complex(total))) if total else 0.0 for total in sums.tolist()
        ]

    def improved(self, start: Tried) -> Tried:
        here, radius, steps = start, _RADIUS, 0
        program = self._program(here.x)
        while radius > _SMALLEST and steps < _STEPS:
            steps += 1
            change = program.change(radius)
            there = (
                None
                if change is None
                else self._above(self._space.clipped(here.x + change), here, _has_more_merit, steps)
            )
            if there is not None:
                here, radius = there, min(1.5 * radius, _LARGEST)
                program = self._program(here.x)
            else:
                radius /= 3
        return Tried(here.x, here.worth, start.steps + steps)

    def _polished(self, start: Tried) -> Tried:
        """A better vector nearby without sensitivities, which do not exist where two eigenvalues meet."""
        size = len(start.x)
        simplex = np.vstack(
            [
                start.x,
                start.x + np.diag(np.where(start.x > 0.5 * self._space.highest, -_EDGE, _EDGE)),
            ]
        )
        best = start

        def cost(x: Numbers) -> float:
            nonlocal best
            one = self.tried(self._space.clipped(x), start.steps)
            best = max(best, one, key=lambda each: each.merit)
            return -one.merit

        ends = {"maxfev": _POLISHING * size, "xatol": 1e-4, "fatol": 1e-6}
        options = {"initial_simplex": simplex, "adaptive": size > 3, **ends}
        optimize.minimize(cost, start.x, method="Nelder-Mead", options=options)
        return best

    def _program(self, x: Numbers) -> "_Program":
        rows = [row for point in self._points for row in self._rows(point, x)]
        return _Program(rows, self._space.lowest - x, self._space.highest - x)

    def _rows(self, point: RatedPoint, x: Numbers) -> Iterator[tuple[Watched, Numbers]]:
        """The modes of one point that count, with the sensitivities of their damping ratios to all numbers of x."""
        setting = self._space.setting(x, searching=True)
        watched, closed = point.watched(setting)
        damped = [mode for mode in watched if mode.floor is None]
        worst = min((mode.damping for mode in damped), default=1.0)
        rest = min((mode.damping for mode in damped if not mode.hardly_moved), default=worst)
        base = point.loops.closed(setting)
        slopes = []
        for k in range(len(x)):
            step = _DIFFERENCE if x[k] + _DIFFERENCE <= self._space.highest[k] else -_DIFFERENCE
            moved = x.copy()
            moved[k] += step
            slopes.append(
                (point.loops.closed(self._space.setting(moved, searching=True)) - base) / step
            )
        near = [mode for mode in watched if mode.place < closed.own and _is_near(mode, worst, rest)]
        left, right = closed.vectors([mode.place for mode in near])
        rows = left.conj().T
        lengths = np.sum(rows * right.T, axis=1)
        shifts = np.array([np.sum((rows @ slope) * right.T, axis=1) / lengths for slope in slopes])
        for mode, own in zip(near, shifts.T.tolist(), strict=True):
            yield mode, np.array([damping_change(mode.value, shift) for shift in own])

    def with_least_gain(self, found: Tried, wanted: float) -> Tried:
        """The smallest part of all gains that still gives a wanted damping ratio at every point."""
        best = found

        def holds(part: float) -> bool:
            nonlocal best
            x = found.x.copy()
            x[2::3] *= part
            one = self.tried(self._space.clipped(x), found.steps)
            is_enough = one.worth.worst >= wanted and one.worth.allowed
            best = one if is_enough else best
            return is_enough

        halve_towards(1.0, 0.0, holds, most=_HALVINGS_OF_GAINS)
        return best


def _has_more_merit(one: Tried, other: Tried) -> bool:
    return one.merit > other.merit + _WORTH


def _does_less_harm_or_damps_more(one: Tried, other: Tried) -> bool:
    return (one.worth.allowed, one.merit) > (other.worth.allowed, other.merit)


def _is_near(mode: Watched, worst: float, rest: float) -> bool:
    """Tell whether a mode counts in a linear program.

    ``worst``, ``rest``: least damping ratio of all modes to be damped, and of those that are moved more than hardly."""
    least = worst if mode.hardly_moved else rest
    return mode.damping < (least + _NEAR if mode.floor is None else mode.floor + _NEAR_FLOOR)


class _Program:
    """A linear program: the change within a radius that raises the least damping ratio most.

    Behind the change stand the least damping ratio of all modes, that of the modes that are moved more than hardly, and
    the breach."""

    def __init__(
        self, rows: Sequence[tuple[Watched, Numbers]], lowest: Numbers, highest: Numbers
    ) -> None:
        self._lowest, self._highest = lowest, highest
        matrix, right = [], []
        for mode, slopes in rows:
            if mode.floor is None:  # t − slopes·d ≤ ζ
                matrix.append([*(-slopes), 1.0, 0.0, 0.0])
                right.append(mode.damping)
                if not mode.hardly_moved:
                    matrix.append([*(-slopes), 0.0, 1.0, 0.0])
                    right.append(mode.damping)
            else:  # −slopes·d − s ≤ ζ − floor
                matrix.append([*(-slopes), 0.0, 0.0, -1.0])
                right.append(mode.damping - mode.floor)
        self._matrix, self._right = (
            np.array(matrix).reshape(len(right), len(lowest) + 3),
            np.array(right),
        )

    def change(self, radius: float) -> Numbers | None:
        limits = [
            (max(-radius, low), min(radius, high))
            for low, high in zip(self._lowest, self._highest, strict=True)
        ]
        cost = np.zeros(len(limits) + 3)
        cost[-3:] = _BESIDE - 1.0, -_BESIDE, _PRICE
        solved = optimize.linprog(
            cost,
            self._matrix,
            self._right,
            bounds=[*limits, (None, 1.0), (None, 1.0), (0.0, None)],
            method="highs",
        )
        return None if solved.x is None else np.asarray(solved.x[: len(limits)])


@dataclass(frozen=True)
class RankedConverter:
    place: PodPlace
    # how far it moves the least damped mode of each point by 1 pu of gain, as long as the gain is small: the mean of
    # the residues' sizes over all points [rad/s per pu]
    shift: float
    # the best setting that a search finds for it alone; None where none was searched
    setting: PodSetting | None = None
    # least damping ratio with that setting, of all points and all modes to be damped; None where it is not known
    worst: float | None = None
    # least damping ratio with it of all modes from 0.1 to 2 Hz; None where it is not known
    least: float | None = None
    stages: int = 0  # N_S of its lead/lag


def ranked(
    places: Sequence[PodPlace],
    stages: Mapping[PodPlace, int],
    points: Sequence[RatedPoint],
    largest: float,
    frequency: float,
    most: int,
    known: tuple[PodPlace, PodSetting] | None = None,
) -> tuple[RankedConverter, ...]:
    """The controllers by the size of their residues; for the first a controller alone is designed."""
    shifts = (
        (float(np.mean([abs(p.residues().get(place, 0j)) for p in points])), place)
        for place in places
    )
    by_shift = sorted(shifts, key=lambda one: (-one[0], one[1]))
    found = []
    for k, (shift, place) in enumerate(by_shift):
        if k >= most:
            found.append(RankedConverter(place, shift))
            continue
        if known is not None and place == known[0]:
            found.append(RankedConverter(place, shift, known[1], stages=stages[place]))
            continue
        group = PodGroup(place.controller, (place.component,), (place.component,), stages[place])
        space = SettingSpace([group], (0.0, largest), frequency)
        search = SettingSearch(space, points, f"ranking, {place.name}")
        best = search.best(starts=1, polish=False)
        found.append(
            RankedConverter(place, shift, space.group_settings(best.x)[0], stages=stages[place])
        )
    return tuple(found)


def best_first(found: Sequence[RankedConverter]) -> tuple[RankedConverter, ...]:
    """The converters in the order of their least damping, those without one by how far they move the modes."""
    return tuple(
        sorted(found, key=lambda one: (one.worst is None, -(one.worst or 0.0), -one.shift))
    )

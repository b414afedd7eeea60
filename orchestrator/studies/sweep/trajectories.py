"""The trajectories of a scenario's modes over a grid of points, with the names that the case gives."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from orchestrator.linear.spectra.mode_tracking import (
    Followed,
    ModeSet,
    near_an_end,
    number_trajectories,
)
from orchestrator.studies.sweep.point import PointRecord

# indices of a point on all axes; refining points have a fractional one on the last axis
GridPlace = tuple[float, ...]


class Beginning(IntEnum):
    START = 0  # the first point of the grid, or the first after points that failed
    FOLLOWED = 1
    REFINED = 2  # the mode was recognised only with refining points in between
    ENTERED = 3  # the mode entered the range of frequencies here
    BROKEN = 4  # the mode was not recognised in the previous point, and begins a new trajectory


@dataclass(frozen=True)
class TrajectoryPoint:
    mode: int
    similarity: float
    beginning: Beginning
    named: bool


@dataclass
class Trajectory:
    # the case's name for the mode, with a number if several trajectories carry this name in turn; otherwise "mode" and
    # a number
    name: str = ""
    case_name: str | None = None  # of the mode; None if the case names no such mode
    points: dict[GridPlace, TrajectoryPoint] = field(default_factory=dict)


def find_trajectories(
    points: Mapping[GridPlace, PointRecord],
    names: Sequence[str],
    frequency_range: tuple[float, float],
) -> list[Trajectory]:
    """Follow the modes of a scenario along the last axis, row by row.

    The first point of a row is linked to the first point of the previous row. A mode without predecessor in its own row
    is linked to the previous row as well.

    ``points``: points by place; failed points are skipped.
    ``names``: of the modes that the case looks for, most important first."""
    modes = {place: record.modes for place, record in points.items() if record.modes is not None}
    route = list(_route(modes))
    followed = number_trajectories(modes, route)
    first = {place for place, origins in route if not origins}
    trajectories: dict[int, Trajectory] = {}
    for place, _ in route:
        if not _on_grid(place):
            continue
        record = points[place]
        for i, number in enumerate(followed.trajectory[place]):
            alike, beginning = _history(followed, modes, first, place, i, frequency_range)
            trajectory = trajectories.setdefault(number, Trajectory())
            trajectory.points[place] = TrajectoryPoint(
                i, alike, beginning, i in record.named.values()
            )
    return _with_names(list(trajectories.values()), points, names)


def _on_grid(place: GridPlace) -> bool:
    return place[-1] == int(place[-1])


def _route(modes: Iterable[GridPlace]) -> Iterator[tuple[GridPlace, list[GridPlace]]]:
    """Places row by row. Each place comes with the previous place of its row and the same place of the previous row,
    where these have modes."""
    seen: set[GridPlace] = set()
    before: GridPlace | None = None
    for place in sorted(modes):
        origins = [before] if before is not None and before[:-1] == place[:-1] else []
        above = next(
            (
                (*place[:axis], place[axis] - 1, *place[axis + 1 :])
                for axis in reversed(range(len(place) - 1))
                if place[axis] > 0
            ),
            None,
        )
        if above in seen:
            origins.append(above)
        yield place, origins
        seen.add(place)
        before = place


def _history(
    followed: Followed[GridPlace],
    modes: Mapping[GridPlace, ModeSet],
    first: set[GridPlace],
    place: GridPlace,
    index: int,
    frequency_range: tuple[float, float],
) -> tuple[float, Beginning]:
    """Return how alike a mode is to the same mode at the point before, and how its trajectory came to it.

    Between two points of the grid there may be refining ones. The walk goes back through them, to the next point of the
    grid or to where the trajectory begins, and the least similarity on the way counts."""
    number, refined, alike = followed.trajectory[place][index], False, 1.0
    while True:
        origin = followed.origin[place][index]
        if origin is None:
            frequency = float(modes[place].frequencies[index])
            entered = near_an_end(frequency, frequency_range)
            later = Beginning.ENTERED if entered else Beginning.BROKEN
            return np.nan, Beginning.START if place in first else later
        alike = min(alike, followed.similarity[place][index])
        if _on_grid(origin):
            return alike, Beginning.REFINED if refined else Beginning.FOLLOWED
        refined = True
        place, index = origin, followed.trajectory[origin].index(number)


def _with_names(
    trajectories: list[Trajectory], points: Mapping[GridPlace, PointRecord], names: Sequence[str]
) -> list[Trajectory]:
    """Trajectories sorted: first those with a name in the order in which they first carry it, then the others by
    frequency."""
    carriers: dict[str, list[Trajectory]] = {name: [] for name in names}
    for place in sorted(
        p for p, record in points.items() if record.modes is not None and _on_grid(p)
    ):
        for name, i in points[place].named.items():
            owner = next(t for t in trajectories if place in t.points and t.points[place].mode == i)
            if owner.case_name is None:
                owner.case_name = name
                carriers[name].append(owner)
    ordered = []
    for name, owners in carriers.items():
        for k, owner in enumerate(owners, start=1):
            owner.name = f"{name} {k}" if len(owners) > 1 else name
            ordered.append(owner)

    def first_frequency(trajectory: Trajectory) -> float:
        place, point = next(iter(trajectory.points.items()))
        modes = points[place].modes
        return float(modes.frequencies[point.mode]) if modes else 0.0

    others = sorted((t for t in trajectories if t.case_name is None), key=first_frequency)
    for k, trajectory in enumerate(others, start=len(ordered) + 1):
        trajectory.name = f"mode {k}"
    return [*ordered, *others]

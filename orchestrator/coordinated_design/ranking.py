"""Converters by what a POD there alone would give over all operating points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.coordinated_design.objective import RatedPoint
from orchestrator.coordinated_design.open_loops import PodPlace
from orchestrator.coordinated_design.search import SettingSearch
from orchestrator.coordinated_design.settings import PodGroup, SettingSpace
from orchestrator.pod_design.closed_loop import PodSetting


@dataclass(frozen=True)
class RankedConverter:
    place: PodPlace
    # how far it moves the least damped mode of each point by 1 pu of gain, as long as the gain is small: the mean of
    # the residues' sizes over all points [rad/s per pu]
    shift: float
    setting: PodSetting | None = None  # the best setting that a search finds for it alone; None where none was searched
    # least damping ratio with that setting, of all points and all modes to be damped; None where it is not known
    worst: float | None = None
    stages: int = 0  # N_S of its lead/lag


def ranked(
    places: Sequence[PodPlace], stages: Mapping[PodPlace, int], points: Sequence[RatedPoint], largest: float,
    frequency: float, most: int, known: tuple[PodPlace, PodSetting] | None = None,
) -> tuple[RankedConverter, ...]:  # fmt: skip
    """The controllers by the size of their residues; for the first a controller alone is designed."""
    by_shift = sorted(((_shift(place, points), place) for place in places), key=lambda one: (-one[0], one[1]))
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
        best = SettingSearch(space, points).best(starts=1, polish=False)
        found.append(RankedConverter(place, shift, space.group_settings(best.x)[0], stages=stages[place]))
    return tuple(found)


def best_first(found: Sequence[RankedConverter]) -> tuple[RankedConverter, ...]:
    """The converters in the order of their least damping, those without one by how far they move the modes."""
    return tuple(sorted(found, key=lambda one: (one.worst is None, -(one.worst or 0.0), -one.shift)))


def _shift(place: PodPlace, points: Sequence[RatedPoint]) -> float:
    return float(np.mean([abs(point.residues().get(place, 0j)) for point in points]))

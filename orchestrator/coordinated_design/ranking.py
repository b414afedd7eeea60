"""Converters by what a POD there alone would give over all operating points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.coordinated_design.objective import RatedPoint
from orchestrator.coordinated_design.open_loops import PodPlace
from orchestrator.coordinated_design.search import SettingSearch, Tried
from orchestrator.coordinated_design.settings import PodGroup, SettingSpace
from orchestrator.pod_design.closed_loop import PodSetting


@dataclass(frozen=True)
class RankedConverter:
    """What a controller at one converter can do, with all others that are designed off.

    Attributes
    ----------
    place
        The controller.
    shift
        How far it moves the least damped mode of each point by 1 pu of gain, as long as the gain is small: the mean of
        the residues' sizes over all points [rad/s per pu].
    found
        The best setting that a search finds for it alone, on the linear models; None where none was searched.
    setting
        That setting.
    """

    place: PodPlace
    shift: float
    found: Tried | None = None
    setting: PodSetting | None = None

    @property
    def worst(self) -> float | None:
        """Least damping ratio of all points with that setting."""
        return None if self.found is None else self.found.worth.worst


def ranked(
    places: Sequence[PodPlace],
    stages: Mapping[PodPlace, int],
    points: Sequence[RatedPoint],
    largest: float,
    frequency: float,
    most: int,
) -> tuple[RankedConverter, ...]:
    """The ranking; for the first by the size of their residues a controller alone is designed.

    Parameters
    ----------
    places
        The controllers.
    stages
        N_S of each.
    points
        The operating points.
    largest
        The largest gain [pu].
    frequency
        ω that the centres relate to [rad/s].
    most
        For how many a controller is designed.
    """
    by_shift = sorted(((_shift(place, points), place) for place in places), key=lambda one: (-one[0], one[1]))
    found = []
    for k, (shift, place) in enumerate(by_shift):
        if k >= most:
            found.append(RankedConverter(place, shift))
            continue
        group = PodGroup(place.controller, (place.component,), (place.component,), stages[place])
        space = SettingSpace([group], (0.0, largest), frequency)
        best = SettingSearch(space, points).best(starts=1, polish=False)
        found.append(RankedConverter(place, shift, best, space.group_settings(best.x)[0]))
    return tuple(sorted(found, key=lambda one: (one.found is None, -(one.worst or 0.0), -one.shift)))


def _shift(place: PodPlace, points: Sequence[RatedPoint]) -> float:
    return float(np.mean([abs(point.residues().get(place, 0j)) for point in points]))

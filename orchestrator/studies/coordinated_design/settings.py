"""Settings of several POD controllers as one vector of numbers, which a search moves."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import few
from orchestrator.studies.coordinated_design.open_loops import PodPlace, Setting
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import (
    LARGEST_STAGE_ANGLE,
    NO_COMPENSATION,
    lead_lag_turning,
)
from orchestrator.studies.pod_design.stages import GAIN_ALONE

CENTRES = (0.5, 4.0)  # range of the lead/lag's centre, as parts of the modes' frequency
# part of the largest gain that stands for a gain of 0 in a search, where a loop must keep its
# states
_OFF = 1e-9


@dataclass(frozen=True)
class PodGroup:
    controller: str  # ``pod_p`` or ``pod_q``
    components: tuple[str, ...]
    key: tuple[str, ...]  # their names in a parameter file
    stages: int  # of the lead/lag
    neutral: float | None = None  # as `Target` has it
    remarks: tuple[str, ...] = ()  # the same

    @property
    def name(self) -> str:
        """For people: ``gfor*.pod_p``."""
        return f"{few(self.key, 3)}: {self.controller}"

    @property
    def has_gain_alone(self) -> bool:
        return self.neutral == GAIN_ALONE

    @property
    def places(self) -> tuple[PodPlace, ...]:
        return tuple(PodPlace(component, self.controller) for component in self.components)


class SettingSpace:
    """Vectors x with three numbers for each group: turn and gain as parts of their ranges, logarithm of the centre."""

    def __init__(
        self, groups: Sequence[PodGroup], gain_bounds: tuple[float, float], frequency: float
    ) -> None:
        self.groups, self.frequency = tuple(groups), frequency
        self._gain_bounds, self._largest = gain_bounds, gain_bounds[1]
        low, high = (math.log(centre) for centre in CENTRES)
        least = gain_bounds[0] / gain_bounds[1]
        turns = [1.0 if group.stages else 0.0 for group in groups]
        self.lowest = np.array([x for turn in turns for x in (-turn, low * turn, least)])
        self.highest = np.array([x for turn in turns for x in (turn, high * turn, 1.0)])

    def of_group(self, group: PodGroup) -> "SettingSpace":
        return SettingSpace([group], self._gain_bounds, self.frequency)

    def clipped(self, x: Numbers) -> Numbers:
        return np.clip(x, self.lowest, self.highest)

    def vector(
        self, turns_deg: Sequence[float], centres: Sequence[float], gains: Sequence[float]
    ) -> Numbers:
        """The vector of angles of all stages together [°], centres as parts of ω, and gains [pu], by group."""
        x = np.zeros(3 * len(self.groups))
        for k, group in enumerate(self.groups):
            x[3 * k] = turns_deg[k] / (LARGEST_STAGE_ANGLE * max(1, group.stages))
            x[3 * k + 1], x[3 * k + 2] = math.log(centres[k]), gains[k] / self._largest
        return self.clipped(x)

    def group_settings(self, x: Numbers, *, searching: bool = False) -> list[PodSetting]:
        found = []
        for group, (turn, centre, gain) in zip(self.groups, x.reshape(-1, 3).tolist(), strict=True):
            angle = turn * LARGEST_STAGE_ANGLE * group.stages
            filters = lead_lag_turning(angle, math.exp(centre) * self.frequency, group.stages)
            size = max(gain, _OFF if searching else 0.0) * self._largest
            found.append(PodSetting(size, filters if group.stages else NO_COMPENSATION))
        return found

    def setting(self, x: Numbers, *, searching: bool = False) -> Setting:
        """The setting of each loop; arguments as for `group_settings`."""
        settings = self.group_settings(x, searching=searching)
        return {
            place: one
            for group, one in zip(self.groups, settings, strict=True)
            for place in group.places
        }

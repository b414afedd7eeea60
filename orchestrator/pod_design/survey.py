"""A survey of all settings of a POD. It is made if the search that begins at the design does not meet the requirement.

With one lead/lag the state matrix is A(K) = A_0 + K·D, so two linearisations of the converters give every gain. The
best settings of a coarse grid are polished by Nelder and Mead's method. The survey does not identify the target: it
rates a setting by the least damped mode that the setting moves. The caller follows the target."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.analysis.modes import damping_ratio
from orchestrator.analysis.stability import grows
from orchestrator.errors import AnalysisError
from orchestrator.late import optimize
from orchestrator.pod_design.closed_loop import PodLoop, PodSetting
from orchestrator.pod_design.guard import guarded
from orchestrator.pod_design.kept import digest
from orchestrator.pod_design.lead_lag import LARGEST_TURN, LeadLag, lead_lag_turning
from orchestrator.points.store import Arrays

MOST_STATES = 500  # systems with more states are not surveyed, because a survey would take too long
CENTRES = (0.5, 4.0)  # range of the lead/lag's centre, as parts of the mode's frequency
_TURNS, _CENTRES, _GAINS = 17, 7, 10
_POLISHED = 3
_EVALUATIONS = 150
_UNMOVED = 0.02  # the survey ignores a mode that the controller moves by less than this fraction of its size
_HOPELESS = 1.0


@dataclass(frozen=True)
class Survey:
    best: tuple[PodSetting, ...]
    damping: float
    settings: int


def survey(
    loop: PodLoop, initial: complex, others: Sequence[complex], stages: int, bounds: tuple[float, float]
) -> Survey:
    """Rate settings over the whole range of gain, angle and centre."""
    ground = _Ground(loop, initial, np.array(others, dtype=complex), stages, bounds)
    turns = np.linspace(-0.95, 0.95, _TURNS).tolist()
    centres = np.linspace(math.log(CENTRES[0]), math.log(CENTRES[1]), _CENTRES).tolist()
    gains = np.linspace(bounds[0], bounds[1], _GAINS + 1)[1:].tolist()
    found = [
        (value, (turn, centre, gain))
        for turn in turns
        for centre in centres
        for gain, value in zip(gains, ground.over_gains((turn, centre), gains), strict=True)
    ]
    found.sort()
    starts: list[tuple[float, float, float]] = []
    for _, place in found:
        if len(starts) < _POLISHED and all(place[:2] != start[:2] for start in starts):
            starts.append(place)
    polished = sorted(ground.polished(start) for start in starts)
    if polished[0][0] >= _HOPELESS:
        raise AnalysisError("no setting leaves the system stable")
    different = [polished[0]]
    for value, place in polished[1:]:
        if value < _HOPELESS and not any(np.allclose(place, other, rtol=0.02, atol=0.02) for _, other in different):
            different.append((value, place))
    best = tuple(PodSetting(place[2], ground.filters(place)) for _, place in different)
    return Survey(best, -polished[0][0], ground.settings)


class _Ground:
    """Settings as (turn, log of the centre, gain), with their worth; a smaller worth is better."""

    def __init__(
        self, loop: PodLoop, initial: complex, others: NDArray[np.complex128], stages: int, bounds: tuple[float, float]
    ) -> None:
        self._loop, self._initial, self._others = loop, initial, others
        self._stages, self._bounds, self.settings = stages, bounds, 0

    def filters(self, place: Sequence[float]) -> LeadLag:
        """The lead/lag at a place. Its turn is given as a part of the largest angle that its stages can give."""
        turn = place[0] * LARGEST_TURN * self._stages
        return lead_lag_turning(turn, math.exp(place[1]) * self._initial.imag, self._stages)

    def over_gains(self, place: Sequence[float], gains: Sequence[float]) -> list[float]:
        what = {"place": list(place), "gains": list(gains), "bounds": self._bounds, "stages": self._stages,
                "initial": digest(np.array(self._initial)), "others": digest(self._others)}  # fmt: skip
        worths: list[float] = self._loop.figures("worth", what, lambda: self._worths(place, gains))["worths"].tolist()
        self.settings += len(gains)
        return worths

    def _worths(self, place: Sequence[float], gains: Sequence[float]) -> Arrays:
        high = self._bounds[1]
        half, full = (model.A for model in self._loop.continuous_models(PodSetting(high, self.filters(place))))
        slope = (full - half) / (high / 2)
        found = [self._worth(np.linalg.eigvals(full + (gain - high) * slope).astype(complex)) for gain in gains]
        return {"worths": np.array(found)}

    def _worth(self, values: NDArray[np.complex128]) -> float:
        if grows(values).any():
            return _HOPELESS
        moved = [v for v in guarded(values) if not np.any(np.abs(v - self._others) < _UNMOVED * abs(v))]
        return -min((damping_ratio(complex(v)) for v in moved), default=1.0)

    def polished(self, start: tuple[float, float, float]) -> tuple[float, tuple[float, float, float]]:
        """A better place nearby, and its worth."""
        low, high = self._bounds
        scale = np.array([1.0, 1.0, high])

        def worth(x: NDArray[np.float64]) -> float:
            turn, centre, gain = x * scale
            if abs(turn) > 1 or not math.log(CENTRES[0]) <= centre <= math.log(CENTRES[1]):
                return _HOPELESS
            return self.over_gains((turn, centre), [min(max(gain, low), high)])[0]

        first = np.array(start) / scale
        simplex = [first, *(first + step for step in np.diag([-0.1 * np.sign(first[0] or 1), -0.3, -0.1]))]
        result = optimize.minimize(
            worth, first, method="Nelder-Mead", options={"maxfev": _EVALUATIONS, "initial_simplex": simplex}
        )
        turn, centre, gain = (result.x * scale).tolist()
        return float(result.fun), (turn, centre, min(max(gain, low), high))

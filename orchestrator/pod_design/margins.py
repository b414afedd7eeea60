"""Robustness of a POD setting: margins of its loop, and the effect of small errors in its values on the target."""

from collections.abc import Callable
from dataclasses import astuple, dataclass, replace

import numpy as np

from orchestrator.analysis.modes import damping_ratio
from orchestrator.errors import AnalysisError
from orchestrator.pod_design.closed_loop import Placed, PodLoop, PodSetting
from orchestrator.pod_design.guard import extremes
from orchestrator.pod_design.lead_lag import LeadLag
from orchestrator.pod_design.loop_margins import LoopMargins, loop_margins
from orchestrator.points.store import Arrays

_STRIDE = 2**0.5
_REACH = 8.0  # gains from 1/8 to 8 times the designed one are tried, a factor √2 apart
_HALVINGS = 4
VARIATION = 0.2  # relative change of K, T_S1 and T_S2, one at a time


@dataclass(frozen=True)
class Margins:
    limit: float  # damping ratio below which a mode from 0.1 to 2 Hz, the target included, counts as lost
    # up, down: factor on the gain up to which no mode is lost and no eigenvalue turns unstable; None where that happens
    # neither up to ``reach`` (up) nor down to a gain of 0 (down)
    up: float | None
    down: float | None
    # lost_up, lost_down: the eigenvalue [rad/s] that is lost just beyond ``up`` or ``down``
    lost_up: complex | None
    lost_down: complex | None
    # Phase and delay margin of the loop, broken where the gain acts in all components at once. None if there is no such
    # margin; ``no_loop`` says why.
    loop: LoopMargins | None
    no_loop: str
    # damping ratio of the target by name of the variation, such as ``T_S1 +20 %``; None where it cannot be followed
    variations: dict[str, float]
    reach: float = _REACH


def compute_margins(loop: PodLoop, off: Placed, nominal: Placed, least: float) -> Margins:
    weakest, fastest = _extremes(loop, nominal.setting)
    limit, growth = min(least, damping_ratio(weakest)), fastest.real if fastest else 0.0

    def lost(factor: float) -> complex | None:
        setting = replace(nominal.setting, gain=nominal.setting.gain * factor)
        weakest, fastest = _extremes(loop, setting)
        if fastest and fastest.real > growth:
            return fastest
        return weakest if damping_ratio(weakest) < limit - 1e-9 else None

    (up, lost_up), (down, lost_down) = (_edge(lost, stride) for stride in (_STRIDE, 1 / _STRIDE))
    found, why = _of_loop(loop, nominal.setting)
    return Margins(limit, up, down, lost_up, lost_down, found, why, _variations(loop, off, nominal.setting))


def _extremes(loop: PodLoop, setting: PodSetting) -> tuple[complex, complex | None]:
    def computed() -> Arrays:
        weakest, fastest = extremes(loop.model(setting))
        return {"weakest": np.array(weakest), "fastest": np.array([] if fastest is None else [fastest], dtype=complex)}

    found = loop.figures("extremes", {"setting": astuple(setting)}, computed)
    return complex(found["weakest"]), next(iter(found["fastest"].tolist()), None)


def _of_loop(loop: PodLoop, setting: PodSetting) -> tuple[LoopMargins | None, str]:
    try:
        return loop_margins(*loop.continuous_models(setting)), ""
    except AnalysisError as error:
        return None, str(error)


def _edge(lost: Callable[[float], complex | None], stride: float) -> tuple[float | None, complex | None]:
    """The last factor on the gain with which no mode is lost, on the way from 1 to 8, or to 1/8 and then 0; and the
    eigenvalue that is lost beyond it."""
    good, bad = 1.0, stride
    while (what := lost(bad)) is None:
        good = bad
        if not 1.01 / _REACH < good < 0.99 * _REACH:
            bad = 0.0
            if stride > 1 or (what := lost(bad)) is None:
                return None, None
            break
        bad *= stride
    for _ in range(_HALVINGS):
        middle = (good + bad) / 2
        if (found := lost(middle)) is None:
            good = middle
        else:
            bad, what = middle, found
    return good, what


def _variations(loop: PodLoop, off: Placed, setting: PodSetting) -> dict[str, float]:
    gain, filters = setting.gain, setting.filters
    found = {}
    for sign in (-1, 1):
        factor = 1 + sign * VARIATION
        changed: dict[str, tuple[float, LeadLag]] = {"K": (gain * factor, filters)}
        if filters.T_S1:
            changed["T_S1"] = (gain, replace(filters, T_S1=filters.T_S1 * factor))
            changed["T_S2"] = (gain, replace(filters, T_S2=filters.T_S2 * factor))
        for name, (value, varied) in changed.items():
            found[f"{name} {100 * sign * VARIATION:+.0f} %"] = loop.place(off, value, varied).damping_ratio
    return dict(sorted(found.items()))

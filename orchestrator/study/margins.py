"""How far a POD setting is from trouble: margins of the gain, and what small errors of its values do to the target."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from orchestrator.analysis.pod_design import LeadLag
from orchestrator.study.closed_loop import Placed, PodLoop, PodSetting
from orchestrator.study.guard import least_damping

_STRIDE = 2**0.5
_REACH = 8.0
"""Gains from 1/8 to 8 times the designed one are tried, a factor √2 apart."""
_HALVINGS = 4
VARIATION = 0.2
"""Relative change of K, T_S1 and T_S2, one at a time."""

_GROWTH = 1e-3


@dataclass(frozen=True)
class Margins:
    """Gain margins and variations.

    Attributes
    ----------
    limit
        Damping ratio below which a mode from 0.1 to 2 Hz, the target included, counts as lost.
    up, down
        Factor on the gain up to which no mode is lost and no eigenvalue turns unstable; None where that
        happens neither up to ``reach`` (up) nor down to a gain of 0 (down).
    variations
        Damping ratio of the target by name of the variation, such as ``T_S1 +20 %``; None where it cannot be followed.
    """

    limit: float
    up: float | None
    down: float | None
    variations: dict[str, float]
    reach: float = _REACH


def compute_margins(loop: PodLoop, off: Placed, nominal: Placed, least: float) -> Margins:
    """Margins of a setting; see `Margins`.

    Parameters
    ----------
    off
        The target with the controller off.
    nominal
        The target with the setting.
    least
        Least damping ratio; the limit is lower where a mode is already below it.
    """
    damping, growth = least_damping(loop.model(nominal.setting))
    limit = min(least, damping)

    def holds(factor: float) -> bool:
        setting = replace(nominal.setting, gain=nominal.setting.gain * factor)
        now, real = least_damping(loop.model(setting))
        return now >= limit - 1e-9 and real <= max(_GROWTH, growth)

    return Margins(limit, _edge(holds, _STRIDE), _edge(holds, 1 / _STRIDE), _variations(loop, off, nominal.setting))


def _edge(holds: Callable[[float], bool], stride: float) -> float | None:
    """The factor up to which all holds, on the way from 1 to 8, or to 1/8 and then 0."""
    good, bad = 1.0, stride
    while holds(bad):
        good = bad
        if not 1.01 / _REACH < good < 0.99 * _REACH:
            if stride > 1 or holds(0.0):
                return None
            bad = 0.0
            break
        bad *= stride
    for _ in range(_HALVINGS):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good


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

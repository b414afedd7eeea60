"""Powers of a record whose sign is turned, beside what the case's units feed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from orchestrator.oscillations.measurements import Measurements, Site

if TYPE_CHECKING:
    from orchestrator.cases.prepare import PreparedScenario

_ALIKE = 0.25
"""A mean power that is the case's with its sign turned differs from it by less than this part; a record is of another
hour than the case."""

_LEAST_MW = 10.0  # a smaller power may have either sign


def turned_signs(measured: Measurements, prepared: PreparedScenario) -> list[str]:
    """A remark on each unit whose P is the case's own with its sign turned."""
    return list(_turned(measured, prepared))


def _turned(measured: Measurements, prepared: PreparedScenario) -> Iterator[str]:
    if prepared.power_flow is None:
        return
    plans = prepared.system.components
    fed = {
        name.casefold(): power.real * plans[name].number("S_n")
        for name, power in prepared.power_flow.powers.items()
        if name in plans
    }
    for place in measured.places:
        own = fed.get(place.name.casefold()) if place.kind == "unit" else None
        seen = _megawatts(place, measured.base)
        if own is not None and abs(own) >= _LEAST_MW and abs(seen + own) < _ALIKE * abs(own):
            yield (
                f"{place.name}: its P is {seen:+.4g} MW in the record and {own:+.4g} MW in the case: is the sign of "
                "its P and Q turned? P and Q count into the grid; the energy that flows from it counts with this sign"
            )


def _megawatts(place: Site, base: float) -> float:
    return float(place.p.mean()) * 100 / base

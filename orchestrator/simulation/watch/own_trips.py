"""Trips inside models: motors by their undervoltage relay, and shares of distributed generation."""

from collections.abc import Iterator

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.simulation.watch.finding import TRIP, Finding
from orchestrator.simulation.watch.seen import Seen
from orchestrator.simulation.watch.settings import Settings
from orchestrator.systems.coupling.system import ComponentPlan, System

LATCH = "relay.latch"
"""Variable of a motor: the decision of its relay, which holds above 0.5."""

SHARE = "share"
"""Variable of distributed generation: the share that trips leave."""

OWN_TRIPS = frozenset((LATCH, SHARE))
"""Variables of the findings of trips inside models."""

_DECIDED = 0.5  # value of a latch from which it holds
_WHOLE = 0.99  # share below which a part is off: the lag of the share ends far above


def _watched(plan: ComponentPlan) -> str | None:
    """Return the variable that tells of a model's own trips; None for a model without any."""
    known = plan.description.variables
    if LATCH in known:
        return LATCH
    return SHARE if SHARE in plan.description.outputs and plan.kind == "converter" else None


def own_trip_signals(system: System) -> list[str]:
    """Return the signals that tell of trips inside models."""
    found = {name: _watched(plan) for name, plan in system.components.items()}
    return [f"{name}.{variable}" for name, variable in found.items() if variable]


def own_trips(seen: Seen, system: System, settings: Settings) -> Iterator[Finding]:
    """Yield what tripped inside models that are on the grid: who, when, and how many MW of the start."""
    for name, plan in system.components.items():
        variable = _watched(plan)
        if variable is None:
            continue
        signal = seen.values[f"{name}.{variable}"]
        power = abs(plan.number("P_0") * plan.number("S_n"))
        off = signal > _DECIDED if variable == LATCH else signal < _WHOLE
        off = off & (settings.connected(name) > 0)
        if not off.any():
            continue
        begin = seen.moment(np.flatnonzero(off)[0])
        if variable == LATCH:
            yield _of_motor(name, plan, begin, power)
        else:
            yield _of_share(name, begin, power, np.where(off, signal, 1.0), seen)


def _of_motor(name: str, plan: ComponentPlan, begin: float, power: float) -> Finding:
    opens = begin + plan.number("TB") / plan.number("f_n")
    message = (
        f"{name} trips at t = {opens:.6g} s by its undervoltage relay, which decided at t = {begin:.6g} s: "
        f"{power:.4g} MW of the start are off for good"
    )
    figures = {"decided": begin, "power_mw": power}
    return Finding(TRIP, opens, name, LATCH, message, figures=figures)


def _of_share(name: str, begin: float, power: float, share: Numbers, seen: Seen) -> Finding:
    least, left = float(share.min()), float(share[-1])
    worst = float(seen.times[int(share.argmin())])
    most, stays = power * (1 - least), power * (1 - left)
    back = "all of it is back" if left >= _WHOLE else f"{stays:.4g} MW are off"
    message = (
        f"{name} loses {100 * (1 - least):.3g} % of its generation by its own trips, from t = {begin:.6g} s on: "
        f"{most:.4g} MW of the start at t = {worst:.6g} s; at the end {back}"
    )
    return Finding(
        TRIP, begin, name, SHARE, message, figures={"power_mw": most, "off_at_the_end_mw": stays}
    )

"""Stretches that are too short to tell a lasting motion from one that still decays, or a growth from a slow course."""

from collections.abc import Sequence

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.coupling.system import System
from orchestrator.watch.finding import Finding
from orchestrator.watch.response import resting_signals
from orchestrator.watch.seen import Seen, unit
from orchestrator.watch.stretches import Stretch

SETTLING = 2.0
"""Shortest stretch in which a swing that goes on is a fault [s]. In a shorter one it may be what an event excites in
the network, such as a current's offset, which takes up to a second to decay; growth is a fault in any."""

SHORTEST_BETWEEN = 1.0
"""Shortest stretch between two events of which a departure is told [s]: a fault that is cleared is shorter."""

LEAST_DEPARTURE, LEAST_SHARE = 1e-3, 0.1
"""Least motion that is told, as a part of 1 or of the signal's start, and as a part of all its motion."""

MORE = 1.2  # A signal departs if it moves by this factor more in the last quarter than in each quarter before
_FEWEST = 40  # least number of looks by which a departure is judged


def is_short(stretch: Stretch) -> bool:
    return stretch.end - stretch.begin < SETTLING * (1 - 1e-9)


def too_short(stretches: Sequence[Stretch]) -> list[Finding]:
    """One remark on stretches whose end shows a motion, or has too few looks to show any, and which are too short."""
    if not stretches:
        return []
    spans = " and ".join(
        f"between t = {s.begin:.4g} s and {'the end' if s.last else 'the event'} at t = {s.end:.4g} s"
        for s in stretches
    )
    last = stretches[-1]
    remedy = f"let the run go on to t = {last.begin + SETTLING:.4g} s" if last.last else "give the events more distance"
    message = (
        f"whether the response settles is not judged {spans}: what an event excites may still decay after less than "
        f"{SETTLING:g} s; {remedy}"
    )
    return [Finding("not_judged", stretches[0].begin, "", "", message, None if last.last else last.end)]


def still_departing(seen: Seen, system: System, stretches: Sequence[Stretch]) -> list[Finding]:
    """One remark on the first stretch at whose end a signal moves more than before, whatever its motion is.

    A growth that shows fewer than two periods, or none, has no frequency, so that no other check tells it."""
    for stretch in stretches:
        if not stretch.last and stretch.end - stretch.begin < SHORTEST_BETWEEN:
            continue
        shown = seen.until(stretch.end)
        rows = shown.times > stretch.begin
        if rows.sum() < _FEWEST:
            continue
        times = shown.times[rows]
        parts = {name: _departure(y[rows]) for name, y in resting_signals(shown, system).items()}
        name, most = max(parts.items(), key=lambda item: item[1], default=("", 0.0))
        if most <= 0:
            continue
        component, _, variable = name.partition(".")
        where = "the end" if stretch.last else f"the event at t = {stretch.end:.4g} s"
        message = (
            f"whether the response to t = {stretch.begin:.4g} s settles is not judged: from t = "
            f"{float(times[-(len(times) // 4)]):.4g} s to {where} {name} moves more than before, by {most:.3g} "
            f"{unit(name, system)}; let the run go on until it comes to rest, and look at it"
        )
        return [
            Finding("not_judged", stretch.begin, component, variable, message, None if stretch.last else stretch.end)
        ]
    return []


def _departure(signal: Numbers) -> float:
    """How far a signal moves in its last quarter, if that is more than in each quarter before; else 0.

    The first look is that before the event, and what moves at once is no departure."""
    *before, last = (float(np.ptp(part)) for part in np.array_split(signal, 4))
    large = last > max(LEAST_DEPARTURE * max(1.0, abs(float(signal[0]))), LEAST_SHARE * float(np.ptp(signal)))
    return last if large and last > MORE * max(before) else 0.0

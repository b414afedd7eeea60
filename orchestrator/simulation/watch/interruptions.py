"""DC lines that are blocked, or bypassed at their inverter: from when on, until when, and how many MW."""

from collections.abc import Iterator

import numpy as np

from orchestrator.simulation.watch.finding import INTERRUPTION, Finding
from orchestrator.simulation.watch.seen import Seen
from orchestrator.systems.coupling.system import ComponentPlan, System

_INTERRUPTED = {"blocked": "is blocked", "bypassed": "is bypassed at its inverter"}
"""Outputs that a DC line's control has, by what each says above 0.5."""

_HOLDS = 0.5


def _controls_a_line(plan: ComponentPlan) -> bool:
    return set(plan.description.outputs).issuperset(_INTERRUPTED)


def interruption_signals(system: System) -> list[str]:
    """Return the signals that tell if a DC line is interrupted."""
    lines = [name for name, plan in system.components.items() if _controls_a_line(plan)]
    return [f"{name}.{variable}" for name in lines for variable in _INTERRUPTED]


def interruptions(seen: Seen, system: System) -> Iterator[Finding]:
    """Yield how each DC line was interrupted: the first time of each kind, and its last end."""
    for name, plan in system.components.items():
        if not _controls_a_line(plan):
            continue
        power = abs(plan.number("P_0") * plan.number("S_n"))
        for variable, what in _INTERRUPTED.items():
            acting = np.flatnonzero(seen.values[f"{name}.{variable}"] > _HOLDS)
            if not len(acting):
                continue
            begin = seen.moment(acting[0])
            last = int(acting[-1]) + 1
            until = seen.moment(last) if last < len(seen.times) else None
            ends = "to the end" if until is None else f"until t = {until:.6g} s"
            message = (
                f"the DC line of {name} {what} from t = {begin:.6g} s {ends}: it carried "
                f"{power:.4g} MW at the start"
            )
            figures = {"power_mw": power}
            yield Finding(
                INTERRUPTION, begin, name, variable, message, until=until, figures=figures
            )

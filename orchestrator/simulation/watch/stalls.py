"""Motors that stall: at the end of a run they turn far below their pull-out speed, and do not come back."""

from collections.abc import Iterator

import numpy as np

from orchestrator.simulation.watch.finding import STALL, Finding
from orchestrator.simulation.watch.own_trips import LATCH
from orchestrator.simulation.watch.seen import Seen
from orchestrator.simulation.watch.settings import Settings
from orchestrator.systems.coupling.system import ComponentPlan, System

_SPEED = "speed"
_START = "slip_0"
"""Variable that induction machines alone have."""

_STALLED = 0.5
"""Speed [pu] below which a motor has stalled: half of the rated one, where the pull-out slip of a usual motor is below
0.3."""

_HOLDS = 0.5  # value of a relay's latch from which it holds


def _is_motor(plan: ComponentPlan) -> bool:
    known = plan.description
    return _START in known.variables and _SPEED in known.outputs and plan.number("P_0") < 0


def stall_signals(system: System) -> list[str]:
    """Return the speeds of motors, which tell if they stall."""
    motors = (name for name, plan in system.components.items() if _is_motor(plan))
    return [f"{name}.{_SPEED}" for name in motors]


def stalls(seen: Seen, system: System, settings: Settings) -> Iterator[Finding]:
    """Yield the motors on the grid that have stalled at the end of the run: who, from when on, and how many MW."""
    for name, plan in system.components.items():
        if not _is_motor(plan):
            continue
        speed = seen.values[f"{name}.{_SPEED}"]
        latch = seen.values.get(f"{name}.{LATCH}")
        is_off = settings.connected(name)[-1] <= 0 or (latch is not None and latch[-1] > _HOLDS)
        if is_off or speed[-1] >= _STALLED or speed[0] < _STALLED:
            continue
        begin = seen.moment(np.flatnonzero(speed >= _STALLED)[-1] + 1)
        power = abs(plan.number("P_0") * plan.number("S_n"))
        message = (
            f"{name} stalls: its speed falls below {_STALLED:g} pu at t = {begin:.6g} s and is {speed[-1]:.3g} pu at "
            f"the end, where {power:.4g} MW of the start draw a motor's starting current"
        )
        figures = {"power_mw": power, "speed_at_the_end_pu": float(speed[-1])}
        yield Finding(STALL, begin, name, _SPEED, message, figures=figures)

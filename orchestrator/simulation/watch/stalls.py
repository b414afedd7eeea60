"""Motors that stall: at the end of a run they turn below their pull-out speed, and do not come back."""

from collections.abc import Iterator

import numpy as np

from orchestrator.core.arrays import Numbers
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

_PULLED_OUT = 0.7
"""Speed [pu] below which a motor is beyond the pull-out slip of a usual one, 0.3: there its torque falls with the
speed."""

_AT_THE_END = 1.0  # time over which a motor that stalls loses speed to the end of the run [s]
_SLOWS = 0.01  # speed that it loses in this time at least [pu]

_HOLDS = 0.5  # value of a relay's latch from which it holds


def _is_motor(plan: ComponentPlan) -> bool:
    known = plan.description
    return _START in known.variables and _SPEED in known.outputs and plan.number("P_0") < 0


def stall_signals(system: System) -> list[str]:
    """Return the speeds of motors, which tell if they stall."""
    motors = (name for name, plan in system.components.items() if _is_motor(plan))
    return [f"{name}.{_SPEED}" for name in motors]


def _slows(times: Numbers, speed: Numbers) -> bool:
    """Tell whether a motor loses speed all the time to the end of the run."""
    late = speed[times >= times[-1] - _AT_THE_END]
    halves = late[0] - late[len(late) // 2], late[len(late) // 2] - late[-1]
    return bool(min(halves) >= _SLOWS / 2)


def stalls(seen: Seen, system: System, settings: Settings) -> Iterator[Finding]:
    """Yield the motors on the grid that have stalled at the end of the run: who, from when on, and how many MW."""
    for name, plan in system.components.items():
        if not _is_motor(plan):
            continue
        speed = seen.values[f"{name}.{_SPEED}"]
        latch = seen.values.get(f"{name}.{LATCH}")
        is_off = settings.connected(name)[-1] <= 0 or (latch is not None and latch[-1] > _HOLDS)
        bound = _STALLED if speed[-1] < _STALLED else _PULLED_OUT
        slows = speed[-1] < _STALLED or _slows(seen.times, speed)
        if is_off or not slows or speed[-1] >= bound or speed[0] < bound:
            continue
        begin = seen.moment(np.flatnonzero(speed >= bound)[-1] + 1)
        falling = "" if speed[-1] < _STALLED else " and falling"
        power = abs(plan.number("P_0") * plan.number("S_n"))
        message = (
            f"{name} stalls: its speed falls below {bound:g} pu at t = {begin:.6g} s and is {speed[-1]:.3g} pu"
            f"{falling} at the end, where {power:.4g} MW of the start draw a motor's starting current"
        )
        figures = {"power_mw": power, "speed_at_the_end_pu": float(speed[-1])}
        yield Finding(STALL, begin, name, _SPEED, message, figures=figures)

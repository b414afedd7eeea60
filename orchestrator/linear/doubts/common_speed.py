"""The drift of the speed that all machines have in common, told where a verdict of growth rests on it.

Where no governor acts, nothing holds the frequency: its eigenvalue is zero if mechanical and electrical torque do not
change with speed, and slightly beside zero if they do. No machine leaves another in such a mode."""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.linear.spectra.modes import Mode
from orchestrator.linear.spectra.stability import Stability

_SLOWEST = 0.5
"""Largest |λ| [rad/s] of a drift. Machines that lose each other without oscillation do so within a second or two."""

_ALIKE = 0.2
"""Largest difference of any speed's element in the mode's shape from their mean, as a part of it."""

_APART = 10.0
"""Largest movement of two angles against each other [rad] beside one per unit of the common speed: 6° while it moves
1 %. A drift with constant torque moves them by 1 to 2 rad. Where the synchronising torque is lost they move by
hundreds, and the speeds still look alike, as the drift is slow."""

_ANGLES = frozenset({"delta", "theta"})
"""Last parts of the names of states that are the angle of a rotor, or that of a converter's voltage [rad]."""

_GOVERNOR = ".governor."
_ANSWERS = 2.0
"""Least movement of a governor's state beside the speed [pu/pu], from which on it acts. A droop of 5 % moves its gate
by 20. One that is off, or within its dead band, moves nothing but its measurement of the power, by less than 1."""


def is_common_speed(mode: Mode, speeds: Sequence[str]) -> bool:
    """Return whether a mode is a slow drift of all ``speeds``, two at least, that no governor answers.

    The angles of machines and converters keep their distances from each other in it."""
    moves = [mode.shape.get(state, 0j).real for state in speeds]
    if len(moves) < 2 or mode.is_oscillation or abs(mode.eigenvalue) > _SLOWEST:
        return False
    mean = sum(moves) / len(moves)
    common = abs(mean)
    angles = [move.real for state, move in mode.shape.items() if _last(state) in _ANGLES]
    governors = [abs(move) for state, move in mode.shape.items() if _GOVERNOR in state]
    alike = mean != 0 and all(abs(move - mean) <= _ALIKE * common for move in moves)
    together = max(angles, default=0.0) - min(angles, default=0.0) <= _APART * common
    return alike and together and max(governors, default=0.0) <= _ANSWERS * common


def _last(state: str) -> str:
    return state.rpartition(".")[2]


def name_common_speed(stability: Stability, speeds: Sequence[str]) -> Stability:
    """Return a verdict with the machines' ``speeds`` where the fastest growing mode is their common drift."""
    mode = stability.mode
    if stability.stable is not False or mode is None or not is_common_speed(mode, speeds):
        return stability
    return replace(stability, common_speed=tuple(speeds))


def tell_common_speed(stability: Stability) -> tuple[str, ...]:
    """Return a sentence where a verdict has the name of the common speed; see `name_common_speed`."""
    mode = stability.mode
    if mode is None or not stability.common_speed:
        return ()
    others = stability.growing - 1
    beside = f"{others} more grow, more slowly" if others else "nothing else grows"
    return (
        f"what grows at {mode.eigenvalue.real:+.3g} 1/s is the common speed: all machines drift alike, none loses "
        f"another, and {beside}. No governor acts here; the drift is expected without one",
    )

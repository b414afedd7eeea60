"""The drift of the speed that all machines have in common, told where a verdict of growth rests on it.

Where no governor acts, nothing holds the frequency: its eigenvalue is zero if mechanical and electrical torque do not
change with speed, and slightly beside zero if they do. No machine leaves another in such a mode."""

from collections.abc import Sequence

from orchestrator.linear.spectra.modes import Mode
from orchestrator.linear.spectra.stability import Stability

_SLOWEST = 0.5
"""Largest |λ| [rad/s] of a drift. Machines that lose each other without oscillation do so within a second or two."""

_ALIKE = 0.2
"""Largest difference of any speed's element in the mode's shape from their mean, as a part of it."""


def is_common_speed(mode: Mode, speeds: Sequence[str]) -> bool:
    """Return whether a mode is a slow drift without oscillation in which all ``speeds``, two at least, move alike."""
    moves = [mode.shape.get(state, 0j).real for state in speeds]
    if len(moves) < 2 or mode.is_oscillation or abs(mode.eigenvalue) > _SLOWEST:
        return False
    mean = sum(moves) / len(moves)
    return mean != 0 and all(abs(move - mean) <= _ALIKE * abs(mean) for move in moves)


def tell_common_speed(stability: Stability, speeds: Sequence[str]) -> tuple[str, ...]:
    """Return a sentence where the fastest growing mode is the drift of the common speed.

    Parameters
    ----------
    stability
        The verdict with its mode.
    speeds
        States that are the machines' speeds.
    """
    mode = stability.mode
    if stability.stable is not False or mode is None or not is_common_speed(mode, speeds):
        return ()
    others = stability.growing - 1
    beside = f"{others} more grow, more slowly" if others else "nothing else grows"
    return (
        f"what grows at {mode.eigenvalue.real:+.3g} 1/s is the common speed: all machines drift alike, none loses "
        f"another, and {beside}. No governor holds the frequency here; the drift is expected without one",
    )

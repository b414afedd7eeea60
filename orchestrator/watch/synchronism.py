"""Loss of synchronism: a unit's angle runs away from the others'."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.arrays import Numbers
from orchestrator.coupling.system import System
from orchestrator.watch.finding import Finding
from orchestrator.watch.seen import Seen
from orchestrator.watch.settings import Settings

ANGLES = ("delta", "droop.theta", "source.theta")
"""Variables [rad] with a unit's angle in the network frame: rotor, converter's frame, a stiff source."""

_SPEED = "omega"
"""Frequency [pu of f_n] that a unit of others has instead; the angle is its integral."""

_OUT_OF_STEP = np.pi
_NAMED = 4
"""How many of the others are named."""


def angle_signals(system: System) -> list[str]:
    """Signals that have to be read to know every unit's angle."""
    found = ((name, _angle_variable(system, name)) for name in system.components)
    return [f"{name}.{variable}" for name, variable in found if variable is not None]


def _angle_variable(system: System, name: str) -> str | None:
    variables = system.components[name].description.variables
    outputs = system.components[name].description.outputs
    angle = next((v for v in ANGLES if v in variables), None)
    return angle or (_SPEED if _SPEED in outputs else None)


def lost_synchronism(seen: Seen, system: System, settings: Settings) -> Iterator[Finding]:
    """Units that are left by the others' angles by more than half a turn, each told once.

    The units on the grid are sorted by angle. Where two neighbours are more than half a turn apart, the system has
    fallen into two groups: the one with less rating is out of step with the other.
    """
    names = [name for name in system.components if _angle_variable(system, name) is not None]
    if len(names) < 2:
        return
    on = np.array([settings.connected(name) > 0 for name in names])
    angles = np.array([_angle(seen, system, settings, name) for name in names])
    _forget_turns_off_the_grid(angles, on)
    rating = {name: _rating(system, settings, name) for name in names}
    told: set[str] = set()
    for row in np.flatnonzero(_largest_gap(angles, on) > _OUT_OF_STEP):
        order = [k for k in np.argsort(angles[:, row]) if on[k, row]]
        cut = int(np.argmax(np.diff(angles[order, row]))) + 1
        sides = [names[k] for k in order[:cut]], [names[k] for k in order[cut:]]
        lost, kept = sorted(sides, key=lambda side: (sum(rating[n] for n in side), len(side)))
        for name in lost:
            if name not in told:
                relative = angles[names.index(name)] - np.mean([angles[names.index(n)] for n in kept], axis=0)
                yield _finding(seen.times, _angle_variable(system, name) or "", name, kept, relative, int(row))
        told |= {*lost, *kept}


def _largest_gap(angles: Numbers, on: NDArray[np.bool_]) -> Numbers:
    """Between neighbours among the angles of the units on the grid [rad], shape (n,)."""
    gaps = np.diff(np.sort(np.where(on, angles, np.nan), axis=0), axis=0)  # those off the grid come last
    largest: Numbers = np.where(np.isfinite(gaps), gaps, 0.0).max(axis=0)
    return largest


def _angle(seen: Seen, system: System, settings: Settings, name: str) -> Numbers:
    """Angle in the network frame [rad], shape (n,)."""
    variable = _angle_variable(system, name)
    signal = seen.values[f"{name}.{variable}"].copy()
    if variable == _SPEED:
        steps = 2 * np.pi * _start(system, settings, name, "f_n", 50.0) * seen.interval * (signal - 1.0)
        turned = np.concatenate([[0.0], np.cumsum((steps[1:] + steps[:-1]) / 2)])
        signal = _start(system, settings, name, "theta_0", 0.0) + turned
    return signal


def _forget_turns_off_the_grid(angles: Numbers, on: NDArray[np.bool_]) -> None:
    """Take away the whole turns by which a unit differs from the others when it comes back to the grid."""
    for unit, row in np.argwhere(on[:, 1:] & ~on[:, :-1]):
        others = [k for k in range(len(on)) if k != unit and on[k, row + 1]]
        if others:
            ahead = angles[unit, row + 1] - np.mean(angles[others, row + 1])
            angles[unit, row + 1 :] -= 2 * np.pi * np.round(ahead / (2 * np.pi))


def _rating(system: System, settings: Settings, name: str) -> float:
    """[MVA]; a stiff source is stronger than everything."""
    return np.inf if _angle_variable(system, name) == "source.theta" else _start(system, settings, name, "S_n", 0.0)


def _start(system: System, settings: Settings, name: str, parameter: str, default: float) -> float:
    known = parameter in system.components[name].description.variables
    return float(settings.values(name, parameter)[0]) if known else default


def _finding(times: Numbers, variable: str, name: str, kept: Sequence[str], relative: Numbers, row: int) -> Finding:
    time, turns = float(times[row]), abs(float(relative[-1] - relative[0])) / (2 * np.pi)
    still = slips_at_the_end(relative)
    others = ", ".join(kept[:_NAMED]) + (f" and {len(kept) - _NAMED} more" if len(kept) > _NAMED else "")
    message = (
        f"{name} loses synchronism with {others}: from t = {time:.4g} s its angle is more than 180 degrees from "
        f"theirs; at the end it has moved by {turns:.2f} turns against them and {'still slips' if still else 'holds'}"
    )
    figures = {"turns": turns, "slips_at_the_end": float(still)}
    return Finding("loss_of_synchronism", time, name, variable, message, None, figures)


def slips_at_the_end(relative: Numbers) -> bool:
    """Whether an angle [rad] moves by more than half a turn in the last tenth of the run."""
    last = relative[-max(2, len(relative) // 10) :]
    return float(np.ptp(last)) > _OUT_OF_STEP

"""Loss of synchronism: a unit's angle runs away from the others'."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import few
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.simulation.watch.finding import Finding
from orchestrator.simulation.watch.seen import Seen
from orchestrator.simulation.watch.settings import Settings
from orchestrator.systems.coupling.system import System

ANGLES = ("delta", "droop.theta", "source.theta")
"""Variables with a unit's angle in the network frame [rad]: of a rotor, of a converter's frame, of a stiff source."""

_SPEED = "omega"  # output with a foreign unit's frequency [pu of f_n]; its integral is the angle

_OUT_OF_STEP = np.pi
_NAMED = 4  # largest number of a group's units that a message names


def angle_signals(system: System) -> list[str]:
    found = ((name, _angle_variable(system, name)) for name in system.components)
    return [f"{name}.{variable}" for name, variable in found if variable is not None]


def _angle_variable(system: System, name: str) -> str | None:
    variables = system.components[name].description.variables
    outputs = system.components[name].description.outputs
    angle = next((v for v in ANGLES if v in variables), None)
    return angle or (_SPEED if _SPEED in outputs else None)


def lost_synchronism(seen: Seen, system: System, settings: Settings) -> Iterator[Finding]:
    """Groups of units whose angles differ from the others' by more than half a turn; each pair of groups is reported
    once.

    The units on the grid are sorted by angle. Where two neighbours are more than half a turn apart, the system has
    fallen apart there. Units that are never parted belong to one group. Of two groups, the one with the smaller rating
    counts as the one that lost synchronism."""
    names = [name for name in system.components if _angle_variable(system, name) is not None]
    if len(names) < 2:
        return
    on = np.array([_on_the_grid(system, settings, name) for name in names])
    angles = np.array([_angle(seen, system, settings, name) for name in names])
    _forget_turns_off_the_grid(angles, on)
    sides = _sides(angles, on)
    rating = [_rating(system, settings, name) for name in names]
    groups = sorted(_groups(sides), key=lambda group: (sum(rating[k] for k in group), len(group)))
    means = [_mean(angles[group], on[group]) for group in groups]
    for number, group in enumerate(groups[:-1]):
        apart = [
            pair
            for other, mean in zip(groups[number + 1 :], means[number + 1 :], strict=True)
            if (pair := _pair(sides, group, other, means[number] - mean)) is not None
        ]
        if apart:
            variable = _angle_variable(system, names[group[0]]) or ""
            yield _finding(seen.times, variable, [names[k] for k in group], apart, names)


def _on_the_grid(system: System, settings: Settings, name: str) -> NDArray[np.bool_]:
    """Tell if a unit is on the grid, shape (n,). A source inside a grid has a breaker of its own beside its angle."""
    on = settings.connected(name) > 0
    scope = (_angle_variable(system, name) or "").rpartition(".")[0]
    breaker = f"{scope}.connected"
    if scope and breaker in system.components[name].description.variables:
        on &= settings.values(name, breaker) > 0
    return on


@dataclass(frozen=True)
class _Pair:
    """Two groups that lost each other: their units, the first row apart, and the angle between them [rad]."""

    other: Sequence[int]
    row: int
    relative: Numbers
    lasts: bool

    @property
    def turns(self) -> float:
        """Number of turns between the groups from the start to the last look with both groups on the grid."""
        return abs(float(self.relative[-1] - self.relative[0])) / (2 * np.pi)

    @property
    def slips(self) -> bool:
        return self.lasts and slips_at_the_end(self.relative)


def _sides(angles: Numbers, on: NDArray[np.bool_]) -> NDArray[np.int_]:
    """Number of the part of the system that holds each unit, counted by angle; −1 for a unit off the grid. Shape
    (units, n)."""
    order = np.argsort(np.where(on, angles, np.inf), axis=0)
    in_order = np.take_along_axis(angles, order, axis=0)
    part = np.zeros(angles.shape, dtype=np.int_)
    part[1:] = np.cumsum(np.diff(in_order, axis=0) > _OUT_OF_STEP, axis=0)
    sides = np.empty_like(part)
    np.put_along_axis(sides, order, part, axis=0)
    sides[~on] = -1
    return sides


def _groups(sides: NDArray[np.int_]) -> list[list[int]]:
    groups: list[list[int]] = []
    for unit, side in enumerate(sides):
        for group in groups:
            if all(_row_apart(side, sides[k]) is None for k in group):
                group.append(unit)
                break
        else:
            groups.append([unit])
    return groups


def _row_apart(one: NDArray[np.int_], other: NDArray[np.int_]) -> int | None:
    rows = np.flatnonzero((one != other) & (one >= 0) & (other >= 0))
    return int(rows[0]) if len(rows) else None


def _mean(angles: Numbers, on: NDArray[np.bool_]) -> Numbers:
    count = on.sum(axis=0)
    total = np.where(on, angles, 0.0).sum(axis=0)
    mean: Numbers = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
    return mean


def _pair(
    sides: NDArray[np.int_], group: Sequence[int], other: Sequence[int], relative: Numbers
) -> _Pair | None:
    rows = [
        row for a in group for b in other if (row := _row_apart(sides[a], sides[b])) is not None
    ]
    if not rows:
        return None
    both = np.isfinite(relative)
    return _Pair(other, min(rows), relative[both], bool(both[-1]))


def _angle(seen: Seen, system: System, settings: Settings, name: str) -> Numbers:
    variable = _angle_variable(system, name)
    signal = seen.values[f"{name}.{variable}"].copy()
    if variable == _SPEED:
        described = system.components[name].description
        f_n = described.port.f_n if isinstance(described, BoundDescription) else 50.0
        steps = (
            2 * np.pi * _start(system, settings, name, "f_n", f_n) * seen.interval * (signal - 1.0)
        )
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
    """Rating of a unit [MVA]; that of a stiff source is infinite."""
    return (
        np.inf
        if _angle_variable(system, name) == "source.theta"
        else _start(system, settings, name, "S_n", 0.0)
    )


def _start(system: System, settings: Settings, name: str, parameter: str, default: float) -> float:
    known = parameter in system.components[name].description.variables
    return float(settings.values(name, parameter)[0]) if known else default


def _finding(
    times: Numbers,
    variable: str,
    group: Sequence[str],
    apart: Sequence[_Pair],
    names: Sequence[str],
) -> Finding:
    pairs = sorted(apart, key=lambda pair: pair.row)
    time = float(times[pairs[0].row])
    others = [[names[k] for k in pair.other] for pair in pairs]
    verb, whose = ("loses", "its angle is") if len(group) == 1 else ("lose", "their angle is")
    parts = []
    for pair, other in zip(pairs, others, strict=True):
        text = _moved_against(pair, other)
        later = f" (apart from t = {times[pair.row]:.4g} s on)"
        parts.append(text if pair is pairs[0] else text + later)
    moved = "; ".join(parts)
    message = (
        f"{few(group, _NAMED)} {verb} synchronism with {few(chain(*others), _NAMED)}: from "
        f"t = {time:.4g} s {whose} more than 180 degrees from theirs; at the end it has moved by {moved}"
    )
    figures = {
        "turns": max(pair.turns for pair in pairs),
        "slips_at_the_end": float(any(pair.slips for pair in pairs)),
    }
    if len(pairs) > 1:
        against = zip(pairs, others, strict=True)
        figures |= {f"turns_against_{other[0]}": pair.turns for pair, other in against}
    return Finding(
        "loss_of_synchronism",
        time,
        component=group[0],
        variable=variable,
        message=message,
        until=None,
        figures=figures,
    )


def _moved_against(pair: _Pair, others: Sequence[str]) -> str:
    """Tell by how much a group has moved against others at the end, and if it still slips."""
    state = "still slips" if pair.slips else "holds"
    end = "" if pair.lasts else " when one of both leaves the grid"
    return f"{pair.turns:.2f} turns against {few(others, _NAMED)}, and {state}{end}"


def slips_at_the_end(relative: Numbers) -> bool:
    """Return whether an angle [rad] moves by more than half a turn in the last tenth of the run."""
    last = relative[-max(2, len(relative) // 10) :]
    return float(np.ptp(last)) > _OUT_OF_STEP

"""The values that move a mode most: which are looked at, and how far a round step of each moves it."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from orchestrator.cases.questions.idle_values import why_idle
from orchestrator.core.errors import InputError
from orchestrator.face.api.scenario import Scenario
from orchestrator.studies.sensitivities.sensitivities import CRITICAL, Sensitivity

MOST = 5  # values that the page has sliders for
_LOOKED_AT = 40  # values whose effect is computed, at most
_OF_NETWORK = (
    12  # of these, the network's, of a large case: the case is started anew several times for each
)
_LARGE = 600  # states from which on the network's values are left out
_RATIO = 5.0  # a slider goes up to so many times the value, and down to such a part of it
_GAIN = ".K"  # end of the name of a controller's gain
_NO_EFFECT = 1e-6  # |Δλ| for one percent of a value, as a part of |λ|, below which it moves nothing

Say = Callable[[dict[str, Any]], None]


def movers(
    scenario: Scenario,
    shares: Mapping[str, float],
    frequencies: tuple[float, float],
    names: Sequence[str],
    say: Say,
) -> dict[str, Any]:
    """Which values move the least damped mode of a range most, by ∂λ/∂p of the running FMUs.

    Parameters
    ----------
    scenario
        The case at the values at which the derivatives are taken.
    shares
        Participation of each component in the mode, which tells where to look in a large case.
    frequencies
        Range in which the mode is looked for [Hz].
    names
        Values to look at, by ``component.variable``; empty for those that `candidates` gives.
    say
        Told of the progress.

    Returns
    -------
    dict
        ``movers`` (see `_as_json`; at most `MOST`, those that move the mode furthest for the same percentage; first
        the one whose step moves damping most, those with doubts last), ``frequency_hz`` and ``damping_percent`` of the
        mode, ``looked_at`` and ``of``: how many values were looked at, and how many could be; ``gains``: see `_gains`.

    Raises
    ------
    AnalysisError
        If there is no steady state.
    InputError
        If the range has no oscillation, or nothing that could move it.
    """
    known, of = candidates(scenario, shares)
    wanted = [name for name in names if name in of] or known
    if not wanted:
        raise InputError("no value can be changed while the system runs, so that none moves a mode")
    found = scenario.sensitivities(
        CRITICAL,
        wanted,
        frequencies=frequencies,
        report=lambda done, all_: say({"progress": f"{done} of {all_} values"}),
    ).result
    least = _NO_EFFECT * abs(found.mode.eigenvalue)
    acting = [row for row in found.rows if row.derivative is not None and row.effect > least]
    by_name = sorted(acting, key=lambda row: row.parameter.name)  # which ends what is alike
    trusted = sorted(by_name, key=lambda row: (bool(row.doubts), -_rounded(row.effect)))
    shown = [_as_json(row) for row in sorted(trusted[:MOST], key=lambda row: row.parameter.name)]
    return {
        "movers": sorted(shown, key=lambda one: (bool(one["doubts"]), -_rounded(one["points"]))),
        "frequency_hz": found.mode.frequency_hz,
        "damping_percent": found.mode.damping_percent,
        "looked_at": len(wanted),
        "of": len(of),
        "gains": _gains(found.rows),
    }


def _gains(rows: Sequence[Sensitivity]) -> dict[str, float]:
    """By how many points of damping the mode would move without each gain that was looked at, to first order.

    Which controller the page asks about follows from it: the first by name may have no part in the mode."""
    return {
        row.parameter.name: abs(row.parameter.value * row.damping_per_unit)
        for row in rows
        if row.parameter.name.endswith(_GAIN) and row.damping_per_unit is not None
    }


def _rounded(x: float) -> float:
    """The size of a figure in the digits that its error leaves: two alike are not ordered by chance."""
    return float(f"{abs(x):.3g}")


def candidates(scenario: Scenario, shares: Mapping[str, float]) -> tuple[list[str], list[str]]:
    """The values to look at, and all that could be: tunable ones that are not 0 and whose part is switched on.

    All of them in a small case; in a larger one those of the devices that take part most, and some of the network
    beside them."""
    system, grid = scenario.prepared.system, scenario.prepared.grid
    by_device: dict[str, list[str]] = {}
    for device, plan in system.components.items():
        for info in plan.description.variables.values():
            if info.causality != "parameter" or info.variability != "tunable":
                continue
            if info.type != "Real" or not plan.number(info.name):
                continue
            if not why_idle(system, device, info.name):
                by_device.setdefault(device, []).append(f"{device}.{info.name}")
    of = [name for values in by_device.values() for name in values]
    if len(of) <= _LOOKED_AT:
        return of, of
    states = sum(len(plan.description.states) for plan in system.components.values())
    room = 0 if states > _LARGE else _OF_NETWORK
    near = _near(scenario, shares, by_device.pop(grid, []))[:room]
    ordered = sorted(by_device, key=lambda device: -shares.get(device, 0.0))
    of_devices = [name for device in ordered for name in by_device[device]]
    return [*of_devices[: _LOOKED_AT - len(near)], *near], of


def _near(scenario: Scenario, shares: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """The network's values, those of branches and loads beside the devices that take part most first."""
    network = scenario.prepared.network
    if network is None:
        return list(names)
    weight = dict.fromkeys(network.buses, 0.0)
    for port in network.ports:
        weight[port.bus] = weight.get(port.bus, 0.0) + shares.get(port.name, 0.0)
    beside: dict[str, float] = {}
    for line in network.lines:
        beside[line.variable("X")] = weight[line.from_bus] + weight[line.to_bus]
    for load in network.loads:
        beside[f"{load.name}.scale"] = weight[load.bus]
    return sorted(names, key=lambda name: -beside.get(name.partition(".")[2], -1.0))


def _as_json(row: Sensitivity) -> dict[str, Any]:
    """``parameter``, its ``value`` and ``unit``, a round ``step`` within its bounds with the ``points`` of damping and
    the ``hertz`` that this step moves the mode by to first order, the declared bounds, and ``doubts``."""
    parameter, points, hertz = row.parameter, row.points, row.frequency_per_unit
    assert points is not None
    assert hertz is not None
    return {
        "parameter": parameter.name,
        "value": parameter.value,
        "unit": parameter.unit,
        "step": parameter.step,
        "points": points,
        "hertz": hertz * parameter.step,
        "minimum": parameter.minimum,
        "maximum": parameter.maximum,
        "doubts": list(row.doubts),
    }


def grid_of(mover: Mapping[str, Any], count: int) -> list[float]:
    """Values that a slider steps through: the value itself, some below and some above, up to a few times it and down to
    such a part of it, within the declared bounds; its double and its half are among them where they lie within."""
    value, minimum, maximum = mover["value"], mover["minimum"], mover["maximum"]
    size = abs(value) or 1.0
    low, high = (value / _RATIO, value * _RATIO) if value > 0 else (value - size, value + size)
    low = low if minimum is None else max(low, minimum)
    high = high if maximum is None else min(high, maximum)
    sides = [np.linspace(end, value, count // 2 + 1) for end in (low, high)]
    if low > 0:
        sides = [np.geomspace(end, value, count // 2 + 1) for end in (low, high)]
    for inside in (side[1:-1] for side in sides):
        for wanted in (value / 2, 2 * value):
            if len(inside) and inside.min() <= wanted <= inside.max():
                inside[np.abs(inside - wanted).argmin()] = wanted
    others = (float(f"{x:.4g}") for x in np.concatenate(sides) if x != value)
    return sorted({value, *others})

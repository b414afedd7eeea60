"""Power flow of a case: voltages of all buses and the powers of all units."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import (
    FlowLine,
    FlowLoad,
    FlowShunt,
    check_connected,
    nodal_powers,
)
from orchestrator.cases.flow.equations import FlowEquations
from orchestrator.cases.flow.limits import (
    Excess,
    Limits,
    exceeded,
    solve_with_limits,
    worth_telling,
)
from orchestrator.cases.flow.newton import CONVERGED, NewtonResult, grow, solve, solve_once
from orchestrator.core.errors import InputError, PowerFlowError, few
from orchestrator.core.options import Option
from orchestrator.core.units import whole_percent

__all__ = ["FlowLine", "FlowLoad", "FlowShunt", "FlowUnit", "PowerFlow", "solve_power_flow"]

_TOLERANCE = 1e-9  # largest power mismatch of a bus that is accepted [pu, 100 MVA]


@dataclass(frozen=True, slots=True)
class FlowUnit:
    """A unit that feeds P_0 [pu, S_n] and holds v_0 [pu] together with the others at its bus; or, where Q_0 [pu, S_n]
    is given, feeds that as well and holds nothing. An unconnected unit does neither."""

    name: str
    bus: str
    S_n: float
    P_0: float
    v_0: float
    connected: bool = True
    Q_0: float | None = None

    @property
    def fed(self) -> complex:
        """P + jQ of a unit that holds no voltage [pu, 100 MVA]."""
        return complex(self.P_0, self.Q_0 or 0.0) * self.S_n / SYSTEM_BASE_MVA


@dataclass(frozen=True)
class PowerFlow:
    voltages: dict[str, complex]  # complex bus voltages [pu]
    powers: dict[str, complex]  # P + jQ of every unit on its own rating [pu, S_n]
    residual: float  # largest power mismatch of a bus [pu, 100 MVA], recomputed from the voltages
    # buses that feed a limit of reactive power instead of holding their voltage
    at_limits: tuple[Excess, ...] = ()
    # buses that hold their voltage beyond a limit, because the limits are not kept or the bus is the slack; the
    # furthest beyond first
    beyond_limits: tuple[Excess, ...] = ()
    # what it was solved with; a transformer of three windings is three of them
    lines: tuple[FlowLine, ...] = ()
    loads: tuple[
        FlowLoad, ...
    ] = ()  # with units of given reactive power, which draw less than zero
    shunts: tuple[FlowShunt, ...] = ()
    holding: tuple[str, ...] = ()  # buses whose units hold a voltage
    slack: str = ""  # bus that feeds what is left
    balancing: tuple[str, ...] = ()  # units there that do, whatever their P_0


def solve_power_flow(
    buses: Sequence[str],
    lines: Sequence[FlowLine],
    loads: Sequence[FlowLoad],
    units: Sequence[FlowUnit],
    slack_bus: str,
    shunts: Sequence[FlowShunt] = (),
    limits: Limits | None = None,
    *,
    keep_limits: bool = False,
) -> PowerFlow:
    """Solve the power flow.

    Units at one bus hold its voltage together. They share its reactive power in proportion to their ratings; at the
    slack bus they share the remaining active power in the same way. Units with a given reactive power feed it and their
    active power, at any bus.

    ``keep_limits``: whether a bus gives its voltage up at a limit; otherwise the limits that are exceeded are only
    named."""
    at_bus: dict[str, list[FlowUnit]] = {}
    fixed: dict[str, complex] = {}
    for unit in (unit for unit in units if unit.connected):
        if unit.Q_0 is None:
            at_bus.setdefault(unit.bus, []).append(unit)
        else:
            fixed[unit.bus] = fixed.get(unit.bus, 0j) + unit.fed
    for bus, members in at_bus.items():
        if len({u.v_0 for u in members}) > 1:
            wanted = ", ".join(f"{u.name} wants {u.v_0:g}" for u in members)
            raise InputError(
                f"power flow: bus {bus!r} cannot have two voltages ({wanted}); give its units the same v_0"
            )
    if slack_bus not in at_bus:
        raise InputError(
            f"power flow: no unit {'that holds a voltage ' if slack_bus in fixed else ''}is connected at the slack bus "
            f"{slack_bus!r}, so nothing feeds what is left; choose another slack in [power_flow]"
        )
    check_connected(buses, lines, slack_bus)
    active = {
        bus: sum(u.P_0 * u.S_n for u in members) / SYSTEM_BASE_MVA
        for bus, members in at_bus.items()
    }
    held = {bus: members[0].v_0 for bus, members in at_bus.items()}
    drawn = [
        *loads,
        *(
            FlowLoad(b, -SYSTEM_BASE_MVA * s.real, -SYSTEM_BASE_MVA * s.imag)
            for b, s in fixed.items()
        ),
    ]
    equations = FlowEquations.of(
        buses, lines, drawn, shunts=shunts, active=active, held=held, slack_bus=slack_bus
    )
    known = _limits_beside(limits or {}, fixed)
    if keep_limits:
        final, result, at_limits = solve_with_limits(equations, known)
    else:
        final, result, at_limits = equations, solve_once(equations), []
    if not result.converged and keep_limits:
        _refuse_for_limits(equations, known, final, result)
    if not result.converged:
        _refuse(equations, result, shunts)
    voltages = dict(zip(equations.buses, map(complex, result.voltages), strict=True))
    flow = _shares(voltages, nodal_powers(voltages, lines, drawn, shunts), at_bus, slack_bus)
    if not flow.residual <= _TOLERANCE:
        raise PowerFlowError(
            f"power flow: the solution leaves {flow.residual:.3g} pu of 100 MVA unbalanced, more than {_TOLERANCE:g}; "
            "check for very small reactances"
        )
    powers = flow.powers | {
        u.name: complex(u.P_0, u.Q_0) for u in units if u.connected and u.Q_0 is not None
    }
    powers |= {unit.name: 0j for unit in units if not unit.connected}
    beyond = worth_telling(
        [
            *exceeded(final, result.voltages, known),
            *_fed_beyond(fixed, at_bus, limits or {}, voltages),
        ]
    )
    left = tuple(u.name for u in at_bus[slack_bus])
    return PowerFlow(
        flow.voltages,
        powers,
        flow.residual,
        tuple(at_limits),
        beyond,
        lines=tuple(lines),
        loads=tuple(drawn),
        shunts=tuple(shunts),
        holding=tuple(at_bus),
        slack=slack_bus,
        balancing=left,
    )


def _limits_beside(limits: Limits, fixed: Mapping[str, complex]) -> Limits:
    """Return what the limits of a bus leave to the units that hold its voltage."""
    fed = {bus: fixed.get(bus, 0j).imag for bus in limits}
    return {bus: (least - fed[bus], most - fed[bus]) for bus, (least, most) in limits.items()}


def _fed_beyond(
    fixed: Mapping[str, complex],
    held: Mapping[str, object],
    limits: Limits,
    voltages: Mapping[str, complex],
) -> list[Excess]:
    """Buses of given reactive power that exceeds their limits."""
    found = []
    for bus in (bus for bus in fixed if bus in limits and bus not in held):
        q, (least, most) = fixed[bus].imag, limits[bus]
        if not least <= q <= most:
            found.append(
                Excess(bus, q, most if q > most else least, abs(voltages[bus]), abs(voltages[bus]))
            )
    return found


def _shares(
    voltages: dict[str, complex],
    needed: Mapping[str, complex],
    at_bus: Mapping[str, Sequence[FlowUnit]],
    slack_bus: str,
) -> PowerFlow:
    """Power that every unit must feed to give these voltages, and the largest mismatch of a bus."""
    powers: dict[str, complex] = {}
    residual = 0.0
    for bus, power in needed.items():
        members = at_bus.get(bus, ())
        if not members:
            residual = max(residual, abs(power))
            continue
        rating = sum(u.S_n for u in members)
        fed = (
            power.real
            if bus == slack_bus
            else sum(u.P_0 * u.S_n for u in members) / SYSTEM_BASE_MVA
        )
        residual = max(residual, abs(power.real - fed))
        q = power.imag * SYSTEM_BASE_MVA / rating
        for unit in members:
            p = power.real * SYSTEM_BASE_MVA / rating if bus == slack_bus else unit.P_0
            powers[unit.name] = complex(p, q)
    return PowerFlow(voltages, powers, residual)


_SHARES = (0.9, 0.75, 0.5, 0.25, 0.0)  # parts of the stray capacitance that are tried
_SHOWN = 6  # iterations whose mismatch is told
_EXCEEDING = 5  # buses beyond their limits that are told
_LITTLE = 0.01  # part of all powers below which they are likely of another unit


def explain(
    equations: FlowEquations,
    failed: NewtonResult,
    with_stray: Callable[[float], FlowEquations] | None,
) -> str:
    return (
        f"{_no_solution(equations, failed)}{_helps(equations, with_stray)}{widest_angle(equations)}"
    )


def _refuse_for_limits(
    equations: FlowEquations, limits: Limits, final: FlowEquations, failed: NewtonResult
) -> None:
    """Refuse limits of reactive power that leave no solution, and tell whose they are, the most exceeded first.

    Nothing is refused where there is none without limits either."""
    free = solve_once(equations)
    if not free.converged:
        return
    exceeding = exceeded(equations, free.voltages, limits)
    most = sorted(exceeding, key=lambda one: -abs(one.q - one.limit))
    told = few([one.text(kept=False) for one in most], _EXCEEDING)
    raise PowerFlowError(
        f"{_no_solution(final, failed)}Without limits of reactive power it has a solution, so these are the "
        f"cause: in it {told}; correct limits that are not meant, or write "
        "reactive_limits = false in [power_flow] (`gfor new` without "
        + Option.REACTIVE_LIMITS
        + ")"
    )


def _refuse(
    equations: FlowEquations, failed: NewtonResult, shunts: Sequence[FlowShunt]
) -> NoReturn:
    """Refuse a network without a solution, with what would give it one."""
    stray = [one for one in shunts if one.stray]

    def with_stray(share: float) -> FlowEquations:
        return equations.with_shunts([replace(one, b=(share - 1) * one.b) for one in stray])

    raise PowerFlowError(explain(equations, failed, with_stray if stray else None))


def _no_solution(equations: FlowEquations, failed: NewtonResult) -> str:
    """Return how the iterations end."""
    mismatch, bus = failed.history[-1]
    told = [f"{size * SYSTEM_BASE_MVA:.3g}" for size, _ in failed.history]
    left_out = [] if len(told) <= _SHOWN else ["…"]
    shown = ", ".join(told[: _SHOWN - 1] + left_out + told[-1:] if left_out else told)
    ends = f"{mismatch * SYSTEM_BASE_MVA:.3g} MW or Mvar unbalanced at bus {bus!r}"
    if mismatch <= CONVERGED:
        lowest = int(np.argmin(np.abs(failed.voltages)))
        ends = f"collapsed voltages, {abs(failed.voltages[lowest]):.3g} pu at bus {equations.buses[lowest]!r}"
    return (
        f"power flow: no solution found. The iterations end with {ends} "
        f"(largest mismatch by iteration: {shown}). "
    )


def _helps(equations: FlowEquations, with_stray: Callable[[float], FlowEquations] | None) -> str:
    """Return what makes it solvable: less stray capacitance, or less power."""
    share, found = grow(equations)
    if with_stray is not None:
        for part in _SHARES:
            if solve(with_stray(part)).converged:
                return (
                    f"It has a solution with {whole_percent(part)} of stray_B: stray capacitances raise the voltage "
                    "behind large reactances; lower stray_B. "
                )
    if found is not None:
        return (
            f"With all loads and all units' power at {whole_percent(min(share, 0.99))} it has a solution: the lines "
            f"cannot carry the power asked of them. {'Is a power in kW? ' * (share < _LITTLE)}"
            "Lower P_0 or the loads, or the line reactances. "
        )
    return (
        "There is none without load and generation either: check line charging, shunts and reactances, which raise "
        "or lower voltages beyond what is possible. "
    )


def widest_angle(equations: FlowEquations) -> str:
    """A sentence that names the line with the largest angle in the DC solution."""
    closed = [line for line in equations.lines if line.closed]
    angles = equations.dc_angles()
    if not closed or not np.isfinite(angles).all():
        return ""
    position = {bus: k for k, bus in enumerate(equations.buses)}
    across = [angles[position[x.from_bus]] - angles[position[x.to_bus]] - x.shift for x in closed]
    worst = int(np.argmax(np.abs(across)))
    line, angle = closed[worst], across[worst]
    ends = (
        f"{bus!r} ({math.degrees(angles[position[bus]]):.1f} deg)"
        for bus in (line.from_bus, line.to_bus)
    )
    carried = abs(angle) / abs(line.X * line.tap) * SYSTEM_BASE_MVA
    return (
        f"In the DC solution the largest angle, {abs(math.degrees(angle)):.1f} deg, is across {line.name!r} between "
        f"{' and '.join(ends)}, X = {line.X:g} pu, which would carry {carried:.0f} MW"
    )

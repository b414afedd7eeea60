"""Power flow of a case: voltages of all buses and the powers of all units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow_balance import FlowLine, FlowLoad, FlowShunt, check_connected, nodal_powers
from orchestrator.cases.flow_equations import FlowEquations
from orchestrator.cases.flow_failure import explain
from orchestrator.cases.flow_limits import Excess, Limits, exceeded, solve_with_limits
from orchestrator.cases.flow_newton import solve
from orchestrator.errors import InputError

__all__ = ["FlowLine", "FlowLoad", "FlowShunt", "FlowUnit", "PowerFlow", "solve_power_flow"]

_TOLERANCE = 1e-9
"""Largest power mismatch of a bus that is accepted [pu, 100 MVA]."""


@dataclass(frozen=True, slots=True)
class FlowUnit:
    """A unit that feeds P_0 [pu, S_n] and holds v_0 [pu] together with the others at its bus. An unconnected unit does
    neither.
    """

    name: str
    bus: str
    S_n: float
    P_0: float
    v_0: float
    connected: bool = True


@dataclass(frozen=True)
class PowerFlow:
    """A solved power flow.

    Attributes
    ----------
    voltages
        Complex bus voltages [pu].
    powers
        P + jQ of every unit on its own rating [pu, S_n].
    residual
        Largest power mismatch of a bus [pu, 100 MVA], recomputed from the voltages.
    at_limits
        Buses that feed a limit of reactive power instead of holding their voltage.
    beyond_limits
        Buses that hold their voltage beyond a limit, because the limits are not kept or the bus is the slack.
    """

    voltages: dict[str, complex]
    powers: dict[str, complex]
    residual: float
    at_limits: tuple[Excess, ...] = ()
    beyond_limits: tuple[Excess, ...] = ()


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
    slack bus they share the remaining active power in the same way.

    Parameters
    ----------
    buses
        Names of all buses.
    lines, loads, shunts
        Elements of the network [pu, 100 MVA; loads in MW and Mvar].
    units
        Units that feed the network, each with its bus, power and voltage.
    slack_bus
        The bus whose units feed the remaining power; its angle is zero.
    limits
        Limits of reactive power, by bus.
    keep_limits
        Whether a bus gives its voltage up at a limit; otherwise the limits that are exceeded are only named.

    Raises
    ------
    InputError
        If the units at a bus disagree about its voltage, no unit is connected at the slack bus, buses have no way
        to it, or no solution is found.
    """
    at_bus: dict[str, list[FlowUnit]] = {}
    for unit in units:
        if unit.connected:
            at_bus.setdefault(unit.bus, []).append(unit)
    for bus, members in at_bus.items():
        if len({u.v_0 for u in members}) > 1:
            wanted = ", ".join(f"{u.name} wants {u.v_0:g}" for u in members)
            raise InputError(
                f"power flow: bus {bus!r} cannot have two voltages ({wanted}); give its units the same v_0"
            )
    if slack_bus not in at_bus:
        raise InputError(
            f"power flow: no unit is connected at the slack bus {slack_bus!r}, so nothing feeds what is left; "
            "choose another slack in [power_flow]"
        )
    check_connected(buses, lines, slack_bus)
    active = {bus: sum(u.P_0 * u.S_n for u in members) / SYSTEM_BASE_MVA for bus, members in at_bus.items()}
    held = {bus: members[0].v_0 for bus, members in at_bus.items()}
    equations = FlowEquations.of(buses, lines, loads, shunts, active, held, slack_bus)
    known = limits or {}
    if keep_limits:
        final, result, at_limits = solve_with_limits(equations, known)
    else:
        final, result, at_limits = equations, solve(equations), []
    if not result.converged:

        def with_stray(share: float) -> FlowEquations:
            fewer = [replace(s, b=share * s.b) if s.stray else s for s in shunts]
            return FlowEquations.of(buses, lines, loads, fewer, active, held, slack_bus)

        raise InputError(explain(equations, result, with_stray if any(s.stray for s in shunts) else None))
    voltages = dict(zip(equations.buses, map(complex, result.voltages), strict=True))
    flow = _shares(voltages, nodal_powers(voltages, lines, loads, shunts), at_bus, slack_bus)
    if not flow.residual <= _TOLERANCE:
        raise InputError(
            f"power flow: the solution leaves {flow.residual:.3g} pu of 100 MVA unbalanced, more than {_TOLERANCE:g}; "
            "check for very small reactances"
        )
    powers = flow.powers | {unit.name: 0j for unit in units if not unit.connected}
    beyond = tuple(exceeded(final, result.voltages, known))
    return PowerFlow(flow.voltages, powers, flow.residual, tuple(at_limits), beyond)


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
        fed = power.real if bus == slack_bus else sum(u.P_0 * u.S_n for u in members) / SYSTEM_BASE_MVA
        residual = max(residual, abs(power.real - fed))
        q = power.imag * SYSTEM_BASE_MVA / rating
        for unit in members:
            p = power.real * SYSTEM_BASE_MVA / rating if bus == slack_bus else unit.P_0
            powers[unit.name] = complex(p, q)
    return PowerFlow(voltages, powers, residual)

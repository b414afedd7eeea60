"""Power flow of a case with pandapower: voltages of all buses and the powers of all units."""

import cmath
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.errors import InputError

BASE_MVA = 100.0
_TOLERANCE = 1e-8
"""Largest power mismatch of a bus that is accepted [pu, 100 MVA]."""


@dataclass(frozen=True, slots=True)
class FlowLine:
    """A π section [pu, 100 MVA]."""

    name: str
    from_bus: str
    to_bus: str
    R: float
    X: float
    B: float


@dataclass(frozen=True, slots=True)
class FlowLoad:
    """A load [MW, Mvar]."""

    bus: str
    p_mw: float
    q_mvar: float


@dataclass(frozen=True, slots=True)
class FlowUnit:
    """A unit that feeds P_0 [pu, S_n] and, with the others at its bus, holds v_0 [pu]."""

    name: str
    bus: str
    S_n: float
    P_0: float
    v_0: float


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
    """

    voltages: dict[str, complex]
    powers: dict[str, complex]
    residual: float


def solve_power_flow(
    buses: Sequence[str],
    lines: Sequence[FlowLine],
    loads: Sequence[FlowLoad],
    units: Sequence[FlowUnit],
    slack_bus: str,
) -> PowerFlow:
    """Solve the power flow.

    Units at one bus hold its voltage together; they share its reactive power, and at the slack
    bus what is left of the active power, in proportion to their ratings.

    Raises
    ------
    InputError
        If the units at a bus disagree about its voltage, or no solution is found.
    """
    at_bus: dict[str, list[FlowUnit]] = {}
    for unit in units:
        at_bus.setdefault(unit.bus, []).append(unit)
    for bus, members in at_bus.items():
        if len({u.v_0 for u in members}) > 1:
            wanted = ", ".join(f"{u.name} wants {u.v_0:g}" for u in members)
            raise InputError(
                f"power flow: bus {bus!r} cannot have two voltages ({wanted}); give its units the same v_0"
            )
    _check_connected(buses, lines, slack_bus)
    voltages = _pandapower_voltages(buses, lines, loads, at_bus, slack_bus)
    flow = _shares(voltages, lines, loads, at_bus, slack_bus)
    if not flow.residual <= _TOLERANCE:
        raise InputError(
            f"power flow: the solution leaves {flow.residual:.3g} pu of 100 MVA unbalanced, more than {_TOLERANCE:g}; "
            "check for very small reactances"
        )
    return flow


def _check_connected(buses: Sequence[str], lines: Sequence[FlowLine], slack_bus: str) -> None:
    """Every bus needs a way to the slack bus."""
    neighbours: dict[str, set[str]] = {bus: set() for bus in buses}
    for line in lines:
        neighbours[line.from_bus].add(line.to_bus)
        neighbours[line.to_bus].add(line.from_bus)
    reached, waiting = {slack_bus}, [slack_bus]
    while waiting:
        found = neighbours[waiting.pop()] - reached
        waiting += found
        reached |= found
    islands = [bus for bus in buses if bus not in reached]
    if islands:
        raise InputError(
            f"power flow: no way leads to the slack bus {slack_bus!r} from: {', '.join(map(repr, islands[:10]))}; "
            "connect them with a line, or remove them"
        )


def _pandapower_voltages(
    buses: Sequence[str],
    lines: Sequence[FlowLine],
    loads: Sequence[FlowLoad],
    at_bus: Mapping[str, Sequence[FlowUnit]],
    slack_bus: str,
) -> dict[str, complex]:
    import pandapower as pp  # noqa: PLC0415 - seconds to import, and needed only here

    logging.getLogger("pandapower").setLevel(logging.ERROR)
    kv = 230.0
    impedance = kv**2 / BASE_MVA
    net = pp.create_empty_network(f_hz=50.0, sn_mva=BASE_MVA)
    index = {bus: pp.create_bus(net, vn_kv=kv, name=bus) for bus in buses}
    for line in lines:
        pp.create_line_from_parameters(
            net,
            index[line.from_bus],
            index[line.to_bus],
            length_km=1.0,
            r_ohm_per_km=line.R * impedance,
            x_ohm_per_km=line.X * impedance,
            c_nf_per_km=line.B / impedance / (2 * np.pi * 50.0) * 1e9,
            max_i_ka=1e3,
            name=line.name,
        )
    for load in loads:
        pp.create_load(net, index[load.bus], p_mw=load.p_mw, q_mvar=load.q_mvar)
    for bus, members in at_bus.items():
        if bus == slack_bus:
            pp.create_ext_grid(net, index[bus], vm_pu=members[0].v_0)
        else:
            pp.create_gen(net, index[bus], p_mw=sum(u.P_0 * u.S_n for u in members), vm_pu=members[0].v_0)
    try:
        pp.runpp(net, tolerance_mva=1e-10, max_iteration=50, numba=False, init="dc")
    except pp.LoadflowNotConverged as error:
        raise InputError(
            "power flow: no solution found; the lines cannot carry the power asked of them. "
            "Lower P_0 or the loads, or the line reactances"
        ) from error
    result = net.res_bus
    return {bus: cmath.rect(float(result.vm_pu[i]), float(np.deg2rad(result.va_degree[i]))) for bus, i in index.items()}


def _shares(
    voltages: dict[str, complex],
    lines: Sequence[FlowLine],
    loads: Sequence[FlowLoad],
    at_bus: Mapping[str, Sequence[FlowUnit]],
    slack_bus: str,
) -> PowerFlow:
    """Power that every unit must feed for the voltages to hold, and what is left over."""
    needed = dict.fromkeys(voltages, 0j)
    for line in lines:
        v_from, v_to = voltages[line.from_bus], voltages[line.to_bus]
        current = (v_from - v_to) / complex(line.R, line.X)
        needed[line.from_bus] += v_from * (current + 0.5j * line.B * v_from).conjugate()
        needed[line.to_bus] += v_to * (-current + 0.5j * line.B * v_to).conjugate()
    for load in loads:
        needed[load.bus] += complex(load.p_mw, load.q_mvar) / BASE_MVA
    powers: dict[str, complex] = {}
    residual = 0.0
    for bus, power in needed.items():
        members = at_bus.get(bus, ())
        if not members:
            residual = max(residual, abs(power))
            continue
        rating = sum(u.S_n for u in members)
        fed = power.real if bus == slack_bus else sum(u.P_0 * u.S_n for u in members) / BASE_MVA
        residual = max(residual, abs(power.real - fed))
        q = power.imag * BASE_MVA / rating
        for unit in members:
            p = power.real * BASE_MVA / rating if bus == slack_bus else unit.P_0
            powers[unit.name] = complex(p, q)
    return PowerFlow(voltages, powers, residual)

"""Power flow of a case with pandapower: voltages of all buses and the powers of all units."""

import cmath
import copy
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from fmus.toolchain.extras import require
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow_balance import FlowLine, FlowLoad, FlowShunt, check_connected, nodal_powers, widest_angle
from orchestrator.errors import InputError

__all__ = ["FlowLine", "FlowLoad", "FlowShunt", "FlowUnit", "PowerFlow", "solve_power_flow"]

_TOLERANCE = 1e-9
"""Largest power mismatch of a bus that is accepted [pu, 100 MVA]."""
_KV = 230.0
"""Nominal voltage for conversion to pandapower's units [kV]; it cancels in the results."""


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
    shunts: Sequence[FlowShunt] = (),
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
    voltages = _pandapower_voltages(buses, lines, loads, shunts, at_bus, slack_bus)
    flow = _shares(voltages, nodal_powers(voltages, lines, loads, shunts), at_bus, slack_bus)
    powers = flow.powers | {unit.name: 0j for unit in units if not unit.connected}
    if not flow.residual <= _TOLERANCE:
        raise InputError(
            f"power flow: the solution leaves {flow.residual:.3g} pu of 100 MVA unbalanced, more than {_TOLERANCE:g}; "
            "check for very small reactances"
        )
    return PowerFlow(flow.voltages, powers, flow.residual)


def _pandapower_voltages(
    buses: Sequence[str],
    lines: Sequence[FlowLine],
    loads: Sequence[FlowLoad],
    shunts: Sequence[FlowShunt],
    at_bus: Mapping[str, Sequence[FlowUnit]],
    slack_bus: str,
) -> dict[str, complex]:
    require("the power flow from which a network starts", "pandapower")
    import pandapower as pp  # noqa: PLC0415 - seconds to import, and needed only here

    logging.getLogger("pandapower").setLevel(logging.ERROR)
    net = copy.deepcopy(empty_network())
    index = {bus: pp.create_bus(net, vn_kv=_KV, name=bus) for bus in buses}
    for line in lines:
        _add_line(pp, net, line, index)
    for load in loads:
        pp.create_load(net, index[load.bus], p_mw=load.p_mw, q_mvar=load.q_mvar)
    for shunt in shunts:
        pp.create_shunt(net, index[shunt.bus], p_mw=shunt.g * SYSTEM_BASE_MVA, q_mvar=-shunt.b * SYSTEM_BASE_MVA)
    for bus, members in at_bus.items():
        if bus == slack_bus:
            pp.create_ext_grid(net, index[bus], vm_pu=members[0].v_0)
        else:
            pp.create_gen(net, index[bus], p_mw=sum(u.P_0 * u.S_n for u in members), vm_pu=members[0].v_0)
    try:
        pp.runpp(
            net, tolerance_mva=1e-10, max_iteration=50, numba=False, init="dc", calculate_voltage_angles=True,
            trafo_model="pi",
        )  # fmt: skip
    except pp.LoadflowNotConverged as error:
        injected = {bus: sum(u.P_0 * u.S_n for u in members) / SYSTEM_BASE_MVA for bus, members in at_bus.items()}
        raise InputError(
            "power flow: no solution found; the lines cannot carry the power asked of them. "
            f"{widest_angle(buses, lines, loads, injected, slack_bus)}Lower P_0 or the loads, or the line reactances"
        ) from error
    result = net.res_bus
    return {bus: cmath.rect(float(result.vm_pu[i]), float(np.deg2rad(result.va_degree[i]))) for bus, i in index.items()}


@cache
def empty_network() -> Any:
    """An empty network of pandapower, to be copied.

    Making its eighty empty tables takes ten times as long as copying them, and longer than the power flow of a small
    system.
    """
    import pandapower as pp  # noqa: PLC0415 - as above

    return pp.create_empty_network(f_hz=50.0, sn_mva=SYSTEM_BASE_MVA)


def _add_line(pp: Any, net: Any, line: FlowLine, index: Mapping[str, int]) -> None:
    """Add a line, or a transformer if the line has a ratio; only its shunts if it is open."""
    impedance = _KV**2 / SYSTEM_BASE_MVA
    ends = index[line.from_bus], index[line.to_bus]
    if line.closed and not line.has_ratio:
        pp.create_line_from_parameters(
            net,
            *ends,
            length_km=1.0,
            r_ohm_per_km=line.R * impedance,
            x_ohm_per_km=line.X * impedance,
            c_nf_per_km=line.B / impedance / (2 * np.pi * 50.0) * 1e9,
            max_i_ka=1e3,
            name=line.name,
        )
        return
    for end, b in zip(ends, line.charging, strict=True):
        if b:
            pp.create_shunt(net, end, p_mw=0.0, q_mvar=-b * SYSTEM_BASE_MVA)
    if line.closed:
        pp.create_transformer_from_parameters(
            net,
            *ends,
            sn_mva=SYSTEM_BASE_MVA,
            vn_hv_kv=line.tap * _KV,
            vn_lv_kv=_KV,
            vkr_percent=100 * line.R,
            vk_percent=100 * abs(complex(line.R, line.X)),
            pfe_kw=0.0,
            i0_percent=0.0,
            shift_degree=float(np.rad2deg(line.shift)),
            name=line.name,
        )


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

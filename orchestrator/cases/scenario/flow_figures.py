"""The power flow of a scenario in figures: buses, branches and machines, for JSON, tables and pages."""

import cmath
import math
from typing import Any

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import FlowLine
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.scenario.prepare import PreparedScenario


def power_flow_json(prepared: PreparedScenario) -> dict[str, Any] | None:
    """Voltages, flows [MW, Mvar, positive into the branch], what each unit feeds, and the losses; None without one."""
    flow = prepared.power_flow
    if flow is None:
        return None
    places = {port.name: port.bus for port in prepared.network.ports} if prepared.network else {}
    branches = [_branch(prepared, flow, line) for line in flow.lines]
    machines = [
        _machine(prepared, name, places[name], power) for name, power in flow.powers.items()
    ]
    total = sum(machine["p_mw"] for machine in machines)
    slack = [machine for machine in machines if machine["bus"] == flow.slack]
    fed = sum(machine["p_mw"] for machine in slack)
    losses = sum(branch["losses_mw"] for branch in branches)
    share = 100 * fed / total if total else None
    return {
        "residual_pu": flow.residual,
        "slack": {
            "bus": flow.slack,
            "units": [machine["name"] for machine in slack],
            "p_mw": fed,
            "share_percent": share,
        },
        "generation_mw": total,
        "losses_mw": losses,
        "buses": [_bus(prepared, bus, v) for bus, v in flow.voltages.items()],
        "branches": branches,
        "machines": machines,
    }


def _bus(prepared: PreparedScenario, bus: str, voltage: complex) -> dict[str, Any]:
    return {
        "name": bus,
        "title": prepared.titles.get(bus, ""),
        "v_pu": abs(voltage),
        "angle_deg": math.degrees(cmath.phase(voltage)),
        **prepared.regions.of(bus).as_json(),
    }


def _branch(prepared: PreparedScenario, flow: PowerFlow, line: FlowLine) -> dict[str, Any]:
    ends = line.powers(flow.voltages[line.from_bus], flow.voltages[line.to_bus])
    into, out = (complex(SYSTEM_BASE_MVA * power) for power in ends)
    return {
        "name": line.name,
        "from_bus": line.from_bus,
        "to_bus": line.to_bus,
        "closed": line.closed,
        "p_from_mw": into.real,
        "q_from_mvar": into.imag,
        "p_to_mw": out.real,
        "q_to_mvar": out.imag,
        "losses_mw": into.real + out.real,
        **_area(prepared, line.from_bus, line.to_bus),
    }


def _machine(prepared: PreparedScenario, name: str, bus: str, power: complex) -> dict[str, Any]:
    """A unit with its power, from that in per unit of its ``S_n``."""
    S_n = prepared.system.components[name].number("S_n")
    rating = prepared.base_ratings.get(name, S_n)
    return {
        "name": name,
        "bus": bus,
        "rating_mva": rating,
        "p_mw": power.real * S_n,
        "q_mvar": power.imag * S_n,
        "loading_percent": 100 * abs(power) * S_n / rating,
        **_area(prepared, bus),
    }


def _area(prepared: PreparedScenario, *buses: str) -> dict[str, str]:
    """Return the area of buses as the file names it; nothing where it has not several."""
    area = prepared.regions.area_of(*buses)
    return {"area": area} if area else {}

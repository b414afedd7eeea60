"""The power flow of a scenario in figures: buses, branches and machines, for JSON, tables and pages."""

import cmath
import math
from typing import Any

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.scenario.prepare import PreparedScenario


def power_flow_json(prepared: PreparedScenario) -> dict[str, Any] | None:
    """Voltages, flows [MW, Mvar, positive into the branch], what each unit feeds, and the losses; None without one."""
    flow = prepared.power_flow
    if flow is None:
        return None
    branches: list[dict[str, Any]] = []
    for line in flow.lines:
        ends = line.powers(flow.voltages[line.from_bus], flow.voltages[line.to_bus])
        into, out = (complex(SYSTEM_BASE_MVA * power) for power in ends)
        branches.append(
            {
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
        )
    places = {port.name: port.bus for port in prepared.network.ports} if prepared.network else {}
    machines: list[dict[str, Any]] = []
    for name, power in flow.powers.items():
        plan = prepared.system.components[name]
        S_n = plan.number("S_n")
        rating = prepared.base_ratings.get(name, S_n)
        machines.append(
            {
                "name": name,
                "bus": places[name],
                "rating_mva": rating,
                "p_mw": power.real * S_n,
                "q_mvar": power.imag * S_n,
                "loading_percent": 100 * abs(power) * S_n / rating,
                **_area(prepared, places[name]),
            }
        )
    total = sum(machine["p_mw"] for machine in machines)
    slack = [machine for machine in machines if machine["bus"] == flow.slack]
    fed = sum(machine["p_mw"] for machine in slack)
    losses = sum(branch["losses_mw"] for branch in branches)
    return {
        "residual_pu": flow.residual,
        "slack": {
            "bus": flow.slack,
            "units": [machine["name"] for machine in slack],
            "p_mw": fed,
            "share_percent": 100 * fed / total if total else None,
        },
        "generation_mw": total,
        "losses_mw": losses,
        "buses": [
            {
                "name": bus,
                "title": prepared.titles.get(bus, ""),
                "v_pu": abs(v),
                "angle_deg": math.degrees(cmath.phase(v)),
                **prepared.regions.of(bus).as_json(),
            }
            for bus, v in flow.voltages.items()
        ],
        "branches": branches,
        "machines": machines,
    }


def _area(prepared: PreparedScenario, *buses: str) -> dict[str, str]:
    """Return the area of buses as the file names it; nothing where it has not several."""
    area = prepared.regions.area_of(*buses)
    return {"area": area} if area else {}

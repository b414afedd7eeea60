"""The power flow of a scenario, to be looked at: buses, branches and machines as rows."""

import cmath
import math
from collections.abc import Sequence
from typing import Any

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.prepare import PreparedScenario

Rows = list[dict[str, Any]]

COLUMNS = {
    "machines": {
        "name": "Unit", "bus": "Bus", "rating_mva": "Rating [MVA]", "p_mw": "P [MW]", "q_mvar": "Q [Mvar]",
        "loading_percent": "Loading [%]",
    },
    "buses": {"name": "Bus", "v_pu": "Voltage [pu]", "angle_deg": "Angle [°]"},
    "branches": {
        "name": "Branch", "from_bus": "From", "to_bus": "To", "p_from_mw": "P from [MW]",
        "q_from_mvar": "Q from [Mvar]", "p_to_mw": "P to [MW]", "q_to_mvar": "Q to [Mvar]", "losses_mw": "Losses [MW]",
    },
}  # fmt: skip
"""Tables, and the heading of each column."""

TEXTS = {"machines": 2, "buses": 1, "branches": 3}
"""How many columns at the left of each table hold text."""

_DIGITS = {"v_pu": 4, "angle_deg": 2, "rating_mva": None, "losses_mw": 3}


def power_flow_json(prepared: PreparedScenario) -> dict[str, Any] | None:
    """Voltages, flows [MW, Mvar, positive into the branch], what each unit feeds, and the losses; None without one."""
    flow = prepared.power_flow
    if flow is None:
        return None
    branches: Rows = []
    for line in flow.lines:
        ends = line.powers(flow.voltages[line.from_bus], flow.voltages[line.to_bus])
        into, out = (complex(SYSTEM_BASE_MVA * power) for power in ends)
        branches.append(
            {
                "name": line.name, "from_bus": line.from_bus, "to_bus": line.to_bus, "closed": line.closed,
                "p_from_mw": into.real, "q_from_mvar": into.imag, "p_to_mw": out.real, "q_to_mvar": out.imag,
                "losses_mw": into.real + out.real,
            }
        )  # fmt: skip
    places = {port.name: port.bus for port in prepared.network.ports} if prepared.network else {}
    machines: Rows = []
    for name, power in flow.powers.items():
        plan = prepared.system.components[name]
        rating = plan.number("S_n")
        machines.append(
            {
                "name": name, "bus": places[name], "rating_mva": rating, "p_mw": power.real * rating,
                "q_mvar": power.imag * rating, "loading_percent": 100 * abs(power),
            }
        )  # fmt: skip
    total = sum(machine["p_mw"] for machine in machines)
    slack = [machine for machine in machines if machine["bus"] == flow.slack]
    fed = sum(machine["p_mw"] for machine in slack)
    return {
        "residual_pu": flow.residual,
        "slack": {
            "bus": flow.slack, "units": [machine["name"] for machine in slack], "p_mw": fed,
            "share_percent": 100 * fed / total if total else None,
        },
        "generation_mw": total,
        "losses_mw": sum(branch["losses_mw"] for branch in branches),
        "buses": [
            {"name": bus, "v_pu": abs(v), "angle_deg": math.degrees(cmath.phase(v))}
            for bus, v in flow.voltages.items()
        ],
        "branches": branches,
        "machines": machines,
    }  # fmt: skip


def totals(found: dict[str, Any]) -> list[tuple[str, str]]:
    """Generation, losses, the slack's share and the range of voltages, in words."""
    slack, voltages = found["slack"], [bus["v_pu"] for bus in found["buses"]]
    share = "" if slack["share_percent"] is None else f", {slack['share_percent']:.0f} % of the generation"
    return [
        ("generation", f"{found['generation_mw']:.1f} MW"),
        ("losses in branches", f"{found['losses_mw']:.2f} MW"),
        (f"slack {', '.join(slack['units'])}", f"{slack['p_mw']:.1f} MW{share}"),
        ("voltages", f"{min(voltages):.3f} to {max(voltages):.3f} pu"),
    ]


def cells(rows: Sequence[dict[str, Any]], kind: str) -> list[list[str]]:
    """Rows as text, in the order of `COLUMNS`."""
    return [[_cell(column, row[column]) for column in COLUMNS[kind]] for row in rows]


def _cell(column: str, value: Any) -> str:
    if isinstance(value, str):
        return value
    digits = _DIGITS.get(column, 1)
    return f"{value:g}" if digits is None else f"{value:.{digits}f}"

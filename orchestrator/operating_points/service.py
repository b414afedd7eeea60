"""Values that take elements of a scenario out of service."""

from collections.abc import Sequence

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.operating_points.outages import Remains

_DEAD_CHARGING = 1e-3  # part of its charging that a dead line keeps: a bus without any has no voltage


def switched_off(out: Sequence[str], remains: Remains, prepared: PreparedScenario, grid: str) -> dict[str, Value]:
    """Values that take elements out of service in the power flow and in the grid, with all that is dead then."""
    opened = [name for name in (*out, *remains.units, *remains.shunts)
              if name not in remains.loads and name not in remains.ties]  # fmt: skip
    values: dict[str, Value] = {f"{grid}.{name}.connected": False for name in opened}
    plan = prepared.system.components[grid]
    for scale in (f"{name}.scale" for name in remains.loads):  # some loads alone determine a voltage, and keep a trace
        values[f"{grid}.{scale}"] = max(0.0, plan.description.variables[scale].minimum or 0.0)
    return values | {f"{grid}.{name}": _DEAD_CHARGING * plan.number(name) for name in remains.charging}

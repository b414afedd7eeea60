"""A scenario with some of its elements out of service."""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.coupling.schedule import Schedule
from orchestrator.coupling.system import System
from orchestrator.operating_points.columns import Elements
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


def without_units(prepared: PreparedScenario, out: Sequence[str], elements: Elements) -> PreparedScenario:
    """The scenario without the units that are out of service.

    The grid takes nothing from them, so they would only add modes of machines that run alone."""
    gone = [name for name in out if name in elements.units]
    if not gone:
        return prepared
    system = System()
    for name, plan in prepared.system.components.items():
        if name not in gone:
            system.add(name, plan.description, plan.parameters, plan.inputs, isolated=plan.isolated)
    for connection in prepared.system.connections:
        if connection.source.component in gone and connection.target.component not in gone:
            system.components[connection.target.component].inputs[connection.target.variable] = 0.0
        elif connection.target.component not in gone:
            system.connections.append(connection)
    groups = tuple(tuple(name for name in group if name not in gone) for group in prepared.schedule.groups)
    schedule: Schedule = replace(prepared.schedule, groups=tuple(group for group in groups if group))
    return replace(prepared, system=system, schedule=schedule)

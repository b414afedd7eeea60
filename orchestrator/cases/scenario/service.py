"""A scenario without the units that are out of service."""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.cases.form.schema import UnitReconnectionTable
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.start_values import is_connected
from orchestrator.systems.coupling.bus_relays import Relay
from orchestrator.systems.coupling.events import UnitSwitching
from orchestrator.systems.coupling.schedule import Schedule
from orchestrator.systems.coupling.system import System


def in_service(prepared: PreparedScenario) -> PreparedScenario:
    """The scenario without the units that are out of service from the beginning to the end."""
    if prepared.network is None or prepared.power_flow is None:
        return prepared
    grid, plans = prepared.system.components[prepared.grid], prepared.system.components
    scenario = prepared.case.scenarios[prepared.name]
    events = prepared.case.table.events if scenario.events is None else scenario.events
    back = {event.unit for event in events if isinstance(event, UnitReconnectionTable)}
    units = [
        port.name for port in prepared.network.ports if port.name in plans and port.name not in back
    ]
    out = [
        n
        for n in units
        if not (is_connected(plans[n], "connected") and is_connected(grid, f"{n}.connected"))
    ]
    return without_units(prepared, out)


def without_units(prepared: PreparedScenario, gone: Sequence[str]) -> PreparedScenario:
    """The scenario without units that are out of service.

    The grid takes nothing from them, so they would only add modes of machines that run alone."""
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
    groups = tuple(
        tuple(name for name in group if name not in gone) for group in prepared.schedule.groups
    )
    schedule: Schedule = replace(
        prepared.schedule, groups=tuple(group for group in groups if group)
    )
    return replace(
        prepared, system=system, schedule=schedule, relays=_without(prepared.relays, gone)
    )


def _without(relays: Sequence[Relay], gone: Sequence[str]) -> tuple[Relay, ...]:
    """Return the relays that have anything to do without some units."""
    found = []
    for relay in relays:
        orders = tuple(
            x for x in relay.orders if not (isinstance(x, UnitSwitching) and x.unit in gone)
        )
        if orders:
            found.append(replace(relay, orders=orders))
    return tuple(found)

"""Connections of a case: those written in the file, and those of every component that names its bus."""

from orchestrator.cases.draft import Draft
from orchestrator.errors import InputError


def connect(draft: Draft) -> None:
    """Make all connections."""
    for index, wire in enumerate(draft.case.connections):
        ends = {wire.source.partition(".")[0], wire.target.partition(".")[0]}
        if not ends & set(draft.scenario.remove):
            _try_connect(draft, wire.source, wire.target, draft.place("connections", index))
    for name, table in draft.tables.items():
        if table.bus is not None and name in draft.system.components:
            _connect_to_bus(draft, name, table.bus)


def check_inputs(draft: Draft) -> None:
    """Every input needs a source, and only one."""
    for wire in draft.system.connections:
        if wire.target.variable in draft.system.components[wire.target.component].inputs:
            draft.note(
                draft.place("components", wire.target.component, "inputs"),
                f"{wire.target} is given a constant, but {wire.source} feeds it; remove the one or the other",
            )
    for endpoint in draft.system.unconnected_inputs():
        if draft.network_failed and (draft.tables[endpoint.component].bus or endpoint.component == draft.grid):
            continue
        draft.note(
            draft.place("components", endpoint.component),
            f"scenario {draft.name!r}: nothing feeds the input {endpoint}; "
            "connect it, or give it a constant under 'inputs'",
        )


def _connect_to_bus(draft: Draft, name: str, bus: str) -> None:
    where = draft.place("components", name, "bus")
    if draft.network_failed:
        return
    if draft.grid is None or draft.network is None:
        draft.note(
            where,
            "a bus needs a [power_flow] table whose grid is a model with a network; or use [[connections]]",
        )
        return
    ports = {port.name: port.bus for port in draft.network.ports}
    if ports.get(name) != bus:
        known = ", ".join(f"{p} at {b}" for p, b in ports.items())
        draft.note(where, f"the network has no port {name!r} at bus {bus!r}; it has: {known}")
        return
    if draft.grid in draft.system.components:
        for part in ("re", "im"):
            _try_connect(draft, f"{draft.grid}.{bus}.v_{part}", f"{name}.v_{part}", where)
        # The grid's inputs decide which outputs of a device are connected: its current, or an emf with its admittance.
        for taken in draft.system.components[draft.grid].description.inputs:
            port, _, variable = taken.rpartition(".")
            if port == name:
                _try_connect(draft, f"{name}.{variable}", f"{draft.grid}.{taken}", where)


def _try_connect(draft: Draft, source: str, target: str, where: str) -> None:
    known = draft.known - set(draft.system.components)
    if {source.partition(".")[0], target.partition(".")[0]} & known:
        return  # the problem of this end is noted already
    try:
        draft.system.connect(source, target)
    except InputError as error:
        draft.note(where, str(error))

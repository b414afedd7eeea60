"""The network of a scenario: what is read for it, and which network stands behind the grid component."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fmus.dc_line.dyr_records import DC_LINE_RECORDS
from fmus.grid.network import Network, Port
from fmus.toolchain.catalogue import model_names, needs_arguments, network_of
from orchestrator.cases.draft import Draft
from orchestrator.cases.form.csv_rows import seen_from_here
from orchestrator.cases.form.names import close_names
from orchestrator.cases.form.schema import (
    BusFaultTable,
    ComponentTable,
    EventTable,
    LineFaultTable,
    LineTripTable,
    ShuntReconnectionTable,
    ShuntTripTable,
)
from orchestrator.cases.networks.data import network_data
from orchestrator.cases.networks.element_names import ElementNames, names_without_units
from orchestrator.cases.networks.psse.dyr_file import DynamicRecord, read_dyr
from orchestrator.cases.networks.psse.static_vars import RECORDS
from orchestrator.cases.networks.sequence_data import windings_of
from orchestrator.cases.scenario.dc_lines import names_of_lines
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_bytes

Tables = Mapping[str, ComponentTable]


def takes_network(table: ComponentTable) -> bool:
    return table.model in model_names() and needs_arguments(table.model or "")


def read_network(draft: Draft) -> None:
    """Read the elements of the network table. Its source may have data for the units."""
    table = draft.given.case.network
    if table is None:
        return
    given = [
        key for key in ("matpower", "pandapower", "raw", "cgmes") if getattr(table, key) is not None
    ]
    if len(given) > 1:
        names = " or ".join(map(repr, given))
        draft.note_network(draft.given.place("network"), f"give either {names}, not both")
        return
    source = given[0] if given else None
    try:
        flow = draft.given.case.power_flow
        slack = flow.slack if flow else None
        records = _device_records(draft)
        draft.data = network_data(
            table,
            draft.given.directory,
            slack,
            frozenset((x.bus, x.machine) for x in records if x.name in RECORDS),
            modelled_lines=names_of_lines(draft, records),
        )
        _name_in_events(draft, names_without_units(draft.data))
        draft.found.questions += draft.data.changes
        draft.found.records += draft.data.records
    except InputError as error:
        where = draft.given.place("network", source) if source else draft.given.place("network")
        draft.note_unread(where, error)


def _device_records(draft: Draft) -> Sequence[DynamicRecord]:
    """Return the records of compensators and DC lines, but those left out; a file without any is not read here."""
    units, network = draft.given.case.units, draft.given.case.network
    if units is None or units.dyr is None or network is None or network.raw is None:
        return ()
    path = seen_from_here(draft.given.directory / units.dyr)
    known = {*RECORDS, *DC_LINE_RECORDS}
    if not path.is_file() or not any(name.encode() in read_bytes(path) for name in known):
        return ()
    left = {name.upper() for name in units.dyr_leave_out}
    return [x for x in read_dyr(path) if x.name in known - left]


def _name_in_events(draft: Draft, names: ElementNames) -> None:
    """Let events name buses and lines as the network's file does."""
    if not names.meant or draft.data is None:
        return
    buses = draft.data.buses
    lines = [*(x.name for x in draft.data.lines), *(x.name for x in draft.data.transformers)]

    def with_identifiers(table: EventTable) -> EventTable:
        known = {"bus": buses, "line": lines, "cleared_by": lines, "at": buses, "opens_at": buses}
        given = {key: getattr(table, key, None) for key in known}
        meant = {
            key: names.identifier(value, known[key], table.place or key)
            for key, value in given.items()
            if isinstance(value, str)
        }
        return table.model_copy(update={k: v for k, v in meant.items() if v != given[k]})

    given = draft.given
    given.case = given.case.model_copy(
        update={"events": [*map(with_identifiers, given.case.events)]}
    )
    if given.scenario.events is not None:
        events = [*map(with_identifiers, given.scenario.events)]
        given.scenario = given.scenario.model_copy(update={"events": events})


def check_network_is_used(draft: Draft, everything: Tables) -> None:
    """Refuse a network that nothing is built from; its frequency alone would still set that of every component."""
    tables = everything.values()
    unknown = [
        table.model
        for table in tables
        if table.model is not None and table.model not in model_names()
    ]
    if draft.given.case.network is None or draft.given.case.units is not None or unknown:
        return
    if not any(takes_network(table) for table in tables):
        remedy = "give the grid the model 'grid' or 'phasor_grid', or remove the table"
        draft.note(
            draft.given.place("network"), f"no component is built from this network; {remedy}"
        )


def find_network(draft: Draft, everything: Tables) -> None:
    """The network behind the grid component: the model's own, or the file's table."""
    if draft.grid is None:
        _check_buses_have_a_grid(draft)
        return
    grid = draft.tables.get(draft.grid)
    if grid is None:
        hint = close_names(
            draft.grid, draft.tables, f"the case has: {', '.join([*draft.tables][:12])}"
        )
        draft.note_network(
            draft.given.place("power_flow", "grid"), f"there is no component {draft.grid!r}; {hint}"
        )
    elif takes_network(grid):
        draft.network = _from_table(draft, grid, everything)
    elif grid.model in model_names():
        draft.network = _with_ports(draft, grid)
    elif grid.model is not None:
        draft.found.network_failed = True  # what is wrong with its model is said where it is added


def _with_ports(draft: Draft, grid: ComponentTable) -> Network | None:
    """The grid model's own network, with ports for what else stands at its buses."""
    network: Network | None = network_of(grid.model or "")
    if network is None:
        return None
    known = {port.name for port in network.ports}
    further = [
        Port(n, t.bus) for n, t in draft.tables.items() if t.bus in network.buses and n not in known
    ]
    if further:
        network = replace(network, ports=(*network.ports, *further))
    return _with_switches(network, draft, phasors="phasor" in (grid.model or ""))


def _check_buses_have_a_grid(draft: Draft) -> None:
    """Name the first of the components at a bus; what is said of it holds for all."""
    for name, table in draft.tables.items():
        if table.bus is not None:
            place = "units" if name in draft.origins else "components"
            where = (
                draft.given.place(place)
                if place == "units"
                else draft.given.place(place, name, "bus")
            )
            draft.note_network(
                where,
                "a bus needs a [power_flow] table whose grid is a model with a network; or use [[connections]]",
            )
            return


def _from_table(draft: Draft, grid: ComponentTable, everything: Tables) -> Network | None:
    data = draft.data
    if data is None:
        if draft.given.case.network is None:
            text = f"the model {grid.model!r} needs a [network] table with buses, lines and loads"
            draft.note_network(draft.given.place("power_flow", "grid"), text)
        return None
    if draft.found.network_failed:
        return None
    is_moving = draft.given.case.network is not None and draft.given.case.network.move_controls
    if is_moving and grid.model != "phasor_grid":
        text = f"taps and shunts move in phasor models, and the grid's model is {grid.model!r}"
        place = draft.given.place("network", "move_controls")
        draft.note_network(place, f'{text}; write models = "phasor" at the top, or remove the key')
        return None
    held = {table.bus for table in everything.values()}
    idle = [bus for bus in data.generation if bus not in held]
    if idle:
        remedy = "add a row to the units' file, or a component with this bus"
        text = f"the source has generators at {', '.join(idle)}, where the case has no unit and no component; {remedy}"
        draft.note_network(draft.given.place("network"), text)
        return None
    ports = tuple(Port(n, t.bus) for n, t in draft.tables.items() if t.bus)
    name = f"{draft.given.case.name}_grid"
    try:
        network = Network(
            name,
            data.buses,
            lines=data.lines,
            loads=data.loads,
            ports=ports,
            shunts=data.shunts,
            stray_B=data.stray_B,
            faults=(),
            transformers=data.transformers,
            phasors=grid.model == "phasor_grid",
        )
        _check_groups(draft, network)
        return _with_switches(network, draft, phasors=network.phasors)
    except ValueError as error:
        draft.note_network(draft.given.place("network"), str(error))
        return None


def _check_groups(draft: Draft, network: Network) -> None:
    """Refuse a vector group of a branch that is not there, or with another number of windings."""
    table = draft.given.case.network
    windings = dict.fromkeys((x.name for x in network.lines), 2)
    windings |= dict.fromkeys((x.name for x in network.transformers), 3)
    for name, group in (table.sequences.groups if table else {}).items():
        where = draft.given.place("network", "sequences", "groups", name)
        if name not in windings:
            hint = close_names(name, windings, "name a branch of the network")
            draft.note(where, f"there is no branch {name!r}; {hint}")
        elif len(windings_of(group)) != windings[name]:
            draft.note(
                where,
                f"{group!r} has {len(windings_of(group))} windings, and {name} {windings[name]}",
            )


def _with_switches(network: Network, draft: Draft, *, phasors: bool) -> Network:
    """The network with the faults, switched shunts and ends of lines of all scenarios, which share one FMU.

    Unknown names are the events' matter."""
    case = draft.given.case
    network = replace(network, injections=network.buses) if draft.given.injections else network
    tables = [
        *case.events,
        *(event for scenario in case.scenarios.values() for event in scenario.events or ()),
    ]
    faults = {table.bus for table in tables if isinstance(table, BusFaultTable)}
    faults |= draft.given.faulted
    switched = {
        table.shunt
        for table in tables
        if isinstance(table, ShuntTripTable | ShuntReconnectionTable)
    }
    network = _with_line_parts(network, tables, draft.given.line_ends) if phasors else network
    if not (faults or switched):
        return network
    shunts = tuple(replace(shunt, switched=shunt.name in switched) for shunt in network.shunts)
    return replace(
        network, faults=tuple(bus for bus in network.buses if bus in faults), shunts=shunts
    )


def _line_with_end(table: EventTable) -> str | None:
    """Return the line that an event opens at one end alone; None if it opens none so."""
    match table:
        case LineTripTable(at=str()):
            return table.line
        case LineFaultTable(opens="line", opens_at=str()):
            return table.line
        case BusFaultTable(opens_at=str()):
            return table.cleared_by
    return None


def _with_line_parts(
    network: Network, tables: Sequence[EventTable], line_ends: frozenset[str]
) -> Network:
    """The network with lines whose ends switch one by one, and with faults along lines."""
    along = [table for table in tables if isinstance(table, LineFaultTable)]
    faulted = {table.line for table in along}
    poles = {table.line for table in along if table.opens == "pole" and table.opens_at is not None}
    ends = line_ends | {*filter(None, map(_line_with_end, tables))}
    if not (faulted | ends):  # a line with poles is among the faulted
        return network
    lines = tuple(
        replace(
            line,
            faulted=line.name in faulted,
            has_ends=line.name in ends,
            has_poles=line.name in poles,
        )
        for line in network.lines
    )
    return replace(network, lines=lines, phasors=True)

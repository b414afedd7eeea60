"""Faults among a case file's events: what they do to connections and components, and which cannot stand together."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from orchestrator.cases.draft import Draft
from orchestrator.cases.form import schema
from orchestrator.cases.settings.imperfection_tables import (
    connections_meant,
    imperfection_of,
    note_long_delay,
)
from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.instance import is_isolated
from orchestrator.systems.coupling import events as coupled
from orchestrator.systems.coupling.clock import Clock
from orchestrator.systems.coupling.events import Event
from orchestrator.systems.coupling.imperfections import DropOut
from orchestrator.systems.coupling.system import System

_BREAKER = "connected"


def wire_events(
    draft: Draft, table: schema.WireEventTable, clock: Clock, stop: float, where: str
) -> list[Event]:
    """Return what an imperfection that begins at a time, and may end, does to every connection that is meant."""
    end = table.end
    if end is not None:
        if end <= table.time:
            text = f"end = {end:g} s is not after time = {table.time:g} s; give a later end, or leave it out"
            draft.note(where, text)
            return []
        try:
            clock.index(end, "the end of the event")
        except InputError as error:
            draft.note(where, str(error))
            return []
    if isinstance(table, schema.DelayTable):
        note_long_delay(draft, table.delay, stop, where)
    events: list[Event] = []
    for connection in connections_meant(draft, table.connection, where):
        imperfection = imperfection_of(draft, table, connection, clock, where)
        if imperfection is None:
            continue
        draft.system.foresee(connection, imperfection)
        target = connection.target.component
        events.append(coupled.WireFault(table.time, target, connection, imperfection))
        if end is not None:
            events.append(coupled.WireRecovery(end, target, connection, imperfection))
    return events


def component_events(draft: Draft, table: schema.ComponentFaultTable, where: str) -> list[Event]:
    name = table.component
    plan = draft.system.components.get(name)
    if plan is None:
        if name not in draft.known:
            draft.note(
                where, f"there is no component {name!r}; the case has: {', '.join(draft.tables)}"
            )
        return []
    if isinstance(table, schema.ComponentTripTable):
        return _trip(draft, table, where)
    if isinstance(table, schema.TimeOutTable):
        if not is_isolated(plan.description, plan.isolated):
            why = f"component {name!r} runs in this process, where nothing limits how long it takes to answer"
            draft.note(where, f"{why}; give it 'isolated = true' to try a time-out")
            return []
        return [coupled.Silence(table.time, name)]
    if not any(c.source.component == name for c in draft.system.connections):
        draft.note(
            where,
            f"component {name!r} feeds nothing, so that nobody would notice what its outputs are",
        )
        return []
    return [coupled.NotANumber(table.time, name)]


def component_faults(tables: Iterable[schema.EventTable], system: System) -> list[str]:
    """Which components fail later, in words; those that a scenario removes do not."""
    words = {
        schema.ComponentTripTable: "trips",
        schema.NanOutputTable: "gives no numbers",
        schema.TimeOutTable: "answers no more",
    }
    return [
        f"component {table.component!r} {words[type(table)]} at t = {table.time:g} s"
        for table in tables
        if isinstance(table, schema.ComponentFaultTable) and table.component in system.components
    ]


def _trip(draft: Draft, table: schema.ComponentTripTable, where: str) -> list[Event]:
    """Its breaker opens: that of the grid's port, and its own; where there is neither, what it gives becomes 0."""
    name, components = table.component, draft.system.components
    own = _BREAKER in components[name].description.variables
    port = f"{name}.{_BREAKER}"
    grid = next(
        (other for other, plan in components.items() if port in plan.description.variables), None
    )
    if grid:
        return [coupled.UnitSwitching(table.time, grid, name, connected=False, has_breaker=own)]
    if own:
        return [coupled.ParameterChange(table.time, name, _BREAKER, False)]
    given = [c for c in draft.system.connections if c.source.component == name]
    if not given:
        draft.note(
            where,
            f"component {name!r} has no breaker and feeds nothing, so that its trip would change nothing",
        )
    for connection in given:
        draft.system.foresee(connection, DropOut(0.0))
    return [coupled.WireFault(table.time, c.target.component, c, DropOut(0.0)) for c in given]


def note_conflicts(draft: Draft, events: Sequence[tuple[Event, str]], clock: Clock) -> list[Event]:
    """Note events that set the same at the same time; the others, without ends that another beginning replaces."""
    seen: dict[tuple[int, str], tuple[Event, str]] = {}
    for event, where in events:
        for what in _set_by(event):
            first = seen.setdefault((clock.index(event.time, "the event"), what), (event, where))
            if first[0] is not event:
                text = f"{what} is set at {event.time:g} s by " + first[1]
                text += " already, and only one of the two could hold"
                draft.note(where, text + "; remove one, or give it another time")
    obsolete = _replaced_ends(draft, events)
    return [event for event, _ in events if id(event) not in obsolete]


def _set_by(event: Event) -> Iterator[str]:
    match event:
        case coupled.WireFault():
            yield f"{_kind(event)} of {event.connection}"
        case coupled.WireRecovery():
            return
        case coupled.Forcing():
            yield f"{event.component}.{event.variable}"
        case coupled.NotANumber():
            yield f"the outputs of {event.component}"
        case _:
            for component, settings in event.changes().items():
                for variable in settings:
                    yield f"{component}.{variable}"


def _replaced_ends(draft: Draft, events: Sequence[tuple[Event, str]]) -> set[int]:
    """Ends at which another imperfection of the kind begins; one that begins before the other's end is noted."""
    by_kind: dict[
        tuple[str, str], list[tuple[coupled.WireFault, coupled.WireRecovery | None, str]]
    ] = {}
    for k, (event, where) in enumerate(events):
        if isinstance(event, coupled.WireFault):
            after = events[k + 1][0] if k + 1 < len(events) else None
            mine = isinstance(after, coupled.WireRecovery) and after.connection == event.connection
            end = after if mine and isinstance(after, coupled.WireRecovery) else None
            by_kind.setdefault((str(event.connection), _kind(event)), []).append(
                (event, end, where)
            )
    obsolete = set()
    for (connection, kind), faults in by_kind.items():
        for (one, end, where), (other, _, elsewhere) in pairwise(
            sorted(faults, key=lambda f: f[0].time)
        ):
            if end is not None and end.time == other.time:
                obsolete.add(id(end))
            elif one.time < other.time and (end is None or end.time > other.time):
                until = "the run's end" if end is None else f"{end.time:g} s"
                lasts = f"while that of {where} lasts from {one.time:g} s to {until}; give that one an end by then"
                draft.note(elsewhere, f"{kind} of {connection} begins at {other.time:g} s, {lasts}")
    return obsolete


def _kind(event: coupled.WireFault) -> str:
    kind = type(event.imperfection)
    return "the loss" if kind is DropOut else f"the {kind.__name__.lower()}"

"""Events of a case file as the coupling's typed events, checked against the components they change."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from fmus.grid.names import lines_among
from orchestrator.cases.assignment import convert_value
from orchestrator.cases.draft import Draft
from orchestrator.cases.names import close_names
from orchestrator.cases.schema import (
    BranchChangeTable,
    EventTable,
    LineReclosingTable,
    LineTripTable,
    LoadChangeTable,
    LoadReconnectionTable,
    LoadTripTable,
    ParameterChangeTable,
    ReferenceChangeTable,
    UnitReconnectionTable,
    UnitTripTable,
)
from orchestrator.coupling.clock import Clock
from orchestrator.coupling.events import (
    BranchChange,
    Event,
    LineSwitching,
    LoadChange,
    LoadSwitching,
    ParameterChange,
    ReferenceChange,
    UnitSwitching,
)
from orchestrator.coupling.system import ComponentPlan, Endpoint
from orchestrator.errors import InputError


def scenario_events(draft: Draft, clock: Clock | None, stop: float) -> tuple[Event, ...]:
    """The scenario's events, else the case's, up to the stop [s]; what is wrong with them is noted."""
    own = draft.scenario.events is not None
    tables = draft.scenario.events if draft.scenario.events is not None else draft.case.events
    events = []
    for index, table in enumerate(tables):
        where = draft.place("scenarios", draft.name, "events", index) if own else draft.place("events", index)
        for event in _events_of(draft, table, where):
            checked = _checked(draft, event, where)
            if checked is not None and clock is not None:
                _check_time(draft, clock, event.time, "the event", where)
                events.append(checked)
    if clock is not None:
        where = "--stop" if stop != draft.case.solver.stop_time else draft.place("solver", "stop_time")
        _check_time(draft, clock, stop, "the stop", where)
    return tuple(event for event in events if event.time < stop)


def _check_time(draft: Draft, clock: Clock, time: float, what: str, where: str) -> None:
    try:
        clock.index(time, what)
    except InputError as error:
        draft.note(where, str(error))


def _events_of(draft: Draft, table: EventTable, where: str) -> list[Event]:
    """What a table stands for; its values are still as the file has them. Nothing for a component that is removed."""
    if isinstance(table, ReferenceChangeTable | ParameterChangeTable):
        component = table.component
    elif table.component is None and draft.grid is None:
        draft.note(where, "the key 'component' is missing; name the grid here, or in a [power_flow] table")
        return []
    else:
        component = table.component or draft.grid or ""
    concerned = {component, table.unit if isinstance(table, UnitTripTable | UnitReconnectionTable) else component}
    if concerned & set(draft.scenario.remove):
        return []
    if isinstance(table, UnitTripTable | UnitReconnectionTable):
        return _unit_switching(draft, table, component)
    return _grid_or_reference_events(table, component)


def _unit_switching(draft: Draft, table: UnitTripTable | UnitReconnectionTable, grid: str) -> list[Event]:
    plan = draft.system.components.get(table.unit)
    if plan is None and table.unit in draft.known:
        return []  # a share of 0, or a problem already
    has_breaker = plan is not None and "connected" in plan.description.variables
    return [UnitSwitching(table.time, grid, table.unit, isinstance(table, UnitReconnectionTable), has_breaker)]


def _grid_or_reference_events(table: EventTable, component: str) -> list[Event]:
    match table:
        case LoadChangeTable():
            return [LoadChange(table.time, component, table.load, table.scale)]
        case LoadTripTable():
            return [LoadSwitching(table.time, component, table.load, 0.0)]
        case LoadReconnectionTable():
            return [LoadSwitching(table.time, component, table.load, table.scale)]
        case LineTripTable():
            opened = LineSwitching(table.time, component, table.line, False)
            if table.reclose_after is None:
                return [opened]
            return [opened, replace(opened, time=table.time + table.reclose_after, connected=True)]
        case LineReclosingTable():
            return [LineSwitching(table.time, component, table.line, True)]
        case BranchChangeTable():
            return [BranchChange(table.time, component, table.line, table.X, table.R)]
        case ReferenceChangeTable():
            return [ReferenceChange(table.time, component, table.reference, table.delta)]
        case ParameterChangeTable():
            value: Any = table.value  # brought to the variable's type and unit by the check
            return [ParameterChange(table.time, component, table.parameter, value)]
        case _:
            raise TypeError(f"{type(table).__name__} is no event of the grid or of a component")


def _checked(draft: Draft, event: Event, where: str) -> Event | None:
    """The event with its values in the variables' units; None if something is wrong with it."""
    fed = {c.target: c.source for c in draft.system.connections}
    before = len(draft.problems)
    for component, settings in event.changes().items():
        plan = draft.system.components.get(component)
        if plan is None:
            if component not in draft.tables:
                names = ", ".join(draft.tables)
                draft.note(where, f"there is no component {component!r}; the case has: {names}")
            return None
        for variable, value in settings.items():
            info = plan.description.variables.get(variable)
            if info is None:
                draft.note(where, _unknown(event, component, variable, plan))
            elif source := fed.get(Endpoint(component, variable)):
                draft.note(where, f"{component}.{variable} is fed by {source}; change that one's source")
            elif info.causality != "input" and info.variability != "tunable":
                kind = f"{info.variability} {info.causality}"
                draft.note(
                    where,
                    f"{component}.{variable} is a {kind}; only tunable parameters and open inputs can change",
                )
            elif isinstance(event, LoadSwitching) and info.minimum is not None and event.scale < info.minimum:
                draft.note(
                    where,
                    f"load {event.load!r} cannot be switched off, because nothing else determines the voltage of its "
                    "bus; give a line there some charging B, or take load_change",
                )
            else:
                converted = convert_value(draft, info, value, where)
                if isinstance(event, ParameterChange) and converted is not None:
                    event = replace(event, value=converted)
    return event if len(draft.problems) == before else None


def _unknown(event: Event, component: str, variable: str, plan: ComponentPlan) -> str:
    """Which of the grid's elements is meant by a name that it does not have."""
    names = plan.description.variables
    wanted, kind, known = "", "", list[str]()
    match event:
        case LineSwitching() | BranchChange():
            wanted, kind, known = event.line, "line", lines_among(names)
        case LoadChange() | LoadSwitching():
            wanted, kind, known = event.load, "load", _elements(names, "scale")
        case UnitSwitching():
            wanted, kind, known = event.unit, "unit", _elements(plan.description.inputs, "i_re")
    if kind and wanted not in known:
        some = ", ".join(known[:12]) + (", …" if len(known) > 12 else "")
        hint = close_names(wanted, known, f"it has: {some}" if known else f"it has no {kind}s")
        return f"component {component!r} has no {kind} {wanted!r}; {hint}"
    return f"component {component!r} has no variable {variable!r} for this event to set"


def _elements(names: Iterable[str], variable: str) -> list[str]:
    """Names of the elements that have a variable."""
    return [name.removesuffix(f".{variable}") for name in names if name.endswith(f".{variable}")]

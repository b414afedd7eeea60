"""Events of a case file as the coupling's typed events, checked against the components they change."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from math import isinf
from typing import Any

from fmus.grid.names import lines_among
from fmus.grid.network import Network
from orchestrator.cases.draft import Draft, Findings
from orchestrator.cases.events.fault_tables import component_events, note_conflicts, wire_events
from orchestrator.cases.events.islands import question_islands
from orchestrator.cases.events.line_events import line_events
from orchestrator.cases.events.unbalanced_faults import solve_unbalanced
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.flow.sharing import power_limits
from orchestrator.cases.form import schema
from orchestrator.cases.form.names import close_names, hint_at
from orchestrator.cases.settings.assignment import convert_value
from orchestrator.core.errors import InputError, Problem, QuestionTopic
from orchestrator.core.options import Option
from orchestrator.systems.coupling import events as coupled
from orchestrator.systems.coupling.clock import Clock
from orchestrator.systems.coupling.connections import Endpoint
from orchestrator.systems.coupling.events import Event
from orchestrator.systems.coupling.system import ComponentPlan

_POWERS = ("P_ref", "Pref")
# product of the frequency of a forcing and the communication step up to which it is followed
_FASTEST = 0.05
_TOUCHED = 1e-3  # power [pu, S_n] beyond a limit that does not count
_LONG_FAULT = 10.0  # duration of a fault [s] above which one without a unit is questioned


def scenario_events(
    draft: Draft, clock: Clock | None, stop: float, flow: PowerFlow | None = None
) -> tuple[Event, ...]:
    """The events of the scenario, or of the case if the scenario has no events, up to the stop time [s]. Problems are
    noted."""
    head = () if draft.given.scenario.events is None else ("scenarios", draft.given.name)
    if clock is None:
        return ()
    fed = {c.target: c.source for c in draft.system.connections}
    events: list[tuple[Event, str]] = []
    for index, table in enumerate(draft.given.events):
        where = table.place or draft.given.place(*head, "events", index)
        if not _is_point(draft, clock, table.time, "the event", where):
            continue
        if table.time >= stop:
            _note_late(draft, table.time, stop, where)
            draft.found.not_reached.append(table.time)
        else:
            asked = (*_endless(table, stop), *_elsewhere(table, draft.network))
            draft.found.questions += [Problem(where, text) for text in asked]
        for event in _all_events_of(draft, table, clock, stop, where):
            checked = (
                event if isinstance(event, coupled.Fault) else _checked(draft, event, fed, where)
            )
            if checked is not None and _is_point(draft, clock, event.time, "the event", where):
                events.append((checked, where))
    where = (
        Option.STOP
        if stop != draft.given.case.solver.stop_time
        else draft.given.place("solver", "stop_time")
    )
    _is_point(draft, clock, stop, "the stop", where)
    if not draft.found.problems:
        events = solve_unbalanced(draft, flow, events)
    question_islands(draft, [(event, where) for event, where in events if event.time < stop])
    return tuple(event for event in note_conflicts(draft, events, clock) if event.time < stop)


def other_scenarios(draft: Draft, wanted: Collection[str]) -> Iterator[Problem]:
    """Yield what is wrong with events of scenarios that are not asked for: a time after the run, an element that the
    network of this one lacks. Their units may be others."""
    for name in (name for name in draft.given.case.scenarios if name not in wanted):
        other = replace(draft, given=replace(draft.given, name=name), found=Findings())
        for index, table in enumerate(draft.given.case.scenarios[name].events or ()):
            where = draft.given.place("scenarios", name, "events", index)
            if table.time >= draft.given.case.solver.stop_time:
                _note_late(other, table.time, draft.given.case.solver.stop_time, where)
            if isinstance(table, schema.GridEventBase) and not isinstance(
                table, schema.UnitSwitchingTable
            ):
                for event in _events_of(other, table, where):
                    _checked(other, event, {}, where)
        yield from (
            Problem(p.place, f"scenario {name!r}, which was not asked for: {p.text}")
            for p in other.found.problems
        )


def _is_point(draft: Draft, clock: Clock, time: float, what: str, where: str) -> bool:
    """Return whether a time is a communication point; if not, that is noted."""
    try:
        clock.index(time, what)
    except InputError as error:
        draft.note(where, str(error))
        return False
    return True


def _note_late(draft: Draft, time: float, stop: float, where: str) -> None:
    """An event that no run reaches: the file's mistake, or worth a word where the stop was chosen for one run."""
    text = f"the event at {time:g} s never happens, as the run stops at {stop:g} s"
    if stop == draft.given.case.solver.stop_time:
        draft.note(where, f"{text}; give it an earlier time, or the run a later solver.stop_time")
    else:
        topic = QuestionTopic("an event after the stop")
        draft.found.questions.append(Problem(where, (f"{text} (" + Option.STOP + ")"), topic=topic))


def _endless(table: schema.EventTable, stop: float) -> Iterator[str]:
    """Questions about what ends only after the run, or lasts so long that its unit is in doubt."""
    if isinstance(table, schema.FaultBase) and table.duration is not None:
        seen = f"duration = {table.duration:g} s"
        slip = (
            f"; if {table.duration:g} ms is meant, write '{table.duration:g} ms'"
            if table.has_bare_duration
            else ""
        )
        lasts = table.duration if table.lasts is None else table.lasts
        if lasts > table.duration and table.time + lasts > stop:
            yield f"other_end_after = {lasts:g} s: the fault is not cleared before the run stops at {stop:g} s"
        elif table.time + table.duration > stop:
            yield f"{seen}: the fault is not cleared before the run stops at {stop:g} s{slip}"
        elif table.has_bare_duration and table.duration > _LONG_FAULT:
            yield f"{seen}, without a unit: a fault is cleared within a second{slip}, else '{table.duration:g} s'"
    reclosing = schema.LineTripTable | schema.LineFaultTable | schema.BusFaultTable
    reclose = table.reclose_after if isinstance(table, reclosing) else None
    opened = table.time + ((table.lasts if isinstance(table, schema.FaultBase) else None) or 0.0)
    if reclose is not None and opened + reclose > stop:
        yield f"reclose_after = {reclose:g} s: the line recloses only after the run, which stops at {stop:g} s"


def _elsewhere(table: schema.EventTable, network: Network | None) -> Iterator[str]:
    """Questions about a fault that ends though what leads to it stays closed."""
    if isinstance(table, schema.LineFaultTable) and network is not None:
        yield from _beside_a_closed_end(table, network)
    if (
        isinstance(table, schema.BusFaultTable)
        and table.cleared_by is not None
        and network is not None
    ):
        ends = {line.name: (line.from_bus, line.to_bus) for line in network.lines}.get(
            table.cleared_by, ()
        )
        if ends and table.bus not in ends:
            text = f"{table.cleared_by} opens for a fault at {table.bus}, but it joins {' and '.join(ends)}"
            yield f"{text}: the fault goes away though nothing that leads to it opens; is another line meant?"
        elif ends and table.opens_at not in (None, table.bus):
            text = f"{table.cleared_by} opens at {table.opens_at} alone, and stays joined to {table.bus}"
            yield f"{text}, where the fault goes away; is its end at {table.bus} meant?"


def _later(table: schema.LineFaultTable) -> str:
    """Return how to say when the other end opens; "" where one phase opens, as a fault lasts no longer there."""
    if table.opens == "pole":
        return "is opens_at meant? "
    return (
        "other_end_after = '400 ms' in the event, in words 'other end after 400 ms', has it open so long after the "
        "fault's begin, as by its zone 2; "
    )


def _beside_a_closed_end(table: schema.LineFaultTable, network: Network) -> Iterator[str]:
    """Questions about a fault along a line that ends as one end of the line opens."""
    line = next((line for line in network.lines if line.name == table.line), None)
    if table.opens_at is None or table.duration is None or line is None:
        return
    if table.other_end_after is not None:
        return
    other = line.to_bus if table.opens_at == line.from_bus else line.from_bus
    yield (
        f"{table.line} opens at {table.opens_at} alone: the fault along it ends with that, where a real one lasts "
        f"until its end at {other} opens too; {_later(table)}without opens_at the line opens at both ends"
    )


def _all_events_of(
    draft: Draft, table: schema.EventTable, clock: Clock, stop: float, where: str
) -> list[Event]:
    if isinstance(table, schema.WireEventTable):
        return wire_events(draft, table, clock, stop, where)
    if isinstance(table, schema.ComponentFaultTable):
        return component_events(draft, table, where)
    if isinstance(table, schema.ForcingTable):
        return forcing_events(draft, table, clock, stop, where)
    return _events_of(draft, table, where)


def _events_of(draft: Draft, table: schema.SettingEventTable, where: str) -> list[Event]:
    """Return the events of a table, with values as the file has them; none for a component that is removed."""
    if isinstance(table, schema.ReferenceChangeTable | schema.ParameterChangeTable):
        component = table.component
    elif table.component is None and draft.found.network_failed:
        return []
    elif table.component is None and draft.grid is None:
        draft.note(
            where, "the key 'component' is missing; name the grid here, or in a [power_flow] table"
        )
        return []
    else:
        component = table.component or draft.grid or ""
    concerned = {
        component,
        table.unit if isinstance(table, schema.UnitSwitchingTable) else component,
    }
    if concerned & set(draft.given.scenario.remove):
        return []
    if isinstance(table, schema.UnitSwitchingTable):
        return _unit_switching(draft, table, component)
    if isinstance(table, schema.FaultBase | schema.LineTripTable):
        return line_events(draft, table, component, where)
    return _grid_or_reference_events(table, component)


def forcing_events(
    draft: Draft, table: schema.ForcingTable, clock: Clock, stop: float, where: str
) -> list[Event]:
    plan = draft.system.components.get(table.component)
    if plan is None:
        if table.component in draft.given.scenario.remove:
            if table.place:
                text = table.place + f" cannot act: the scenario has no {table.component}"
                topic = QuestionTopic("an event at a removed component", table.component)
                draft.found.questions.append(Problem("", text, topic=topic))
        else:
            names = list(draft.system.components)
            known = close_names(table.component, names, f"the case has: {', '.join(draft.tables)}")
            draft.note(where, f"there is no component {table.component!r}; {known}")
        return []
    tunable = {
        _reference_of(v): v
        for v, info in plan.description.variables.items()
        if info.variability == "tunable" and v.rpartition(".")[2].startswith("delta_")
    }
    wanted = table.reference or next((r for r in tunable if r.rpartition(".")[2] in _POWERS), None)
    if wanted not in tunable:
        what = (
            f"has no reference {wanted!r}"
            if wanted
            else "has no reference of its power; name another one"
        )
        draft.note(where, f"{table.component!r} {what}; it has: {', '.join(tunable) or 'none'}")
        return []
    if table.frequency * clock.step_size > _FASTEST:
        draft.note(
            where,
            f"frequency = {table.frequency:g} Hz: a step of {clock.step_size:g} s does not show it; give "
            f"at most {_FASTEST / clock.step_size:g} Hz, or a shorter step",
        )
        return []
    end = stop if table.end is None else table.end
    if end <= table.time or not _is_point(draft, clock, end, "the end of the event", where):
        if end <= table.time < stop:
            draft.note(
                where, f"end = {end:g} s is not after time = {table.time:g} s; give a later end"
            )
        return []
    is_power = wanted.rpartition(".")[2] in _POWERS
    draft.found.questions += [
        Problem(where, text) for text in _large_forcing(plan, table, wanted, is_power=is_power)
    ]
    return [
        coupled.Forcing(
            table.time,
            table.component,
            tunable[wanted],
            frequency=table.frequency,
            amplitude=table.amplitude,
            shape=table.shape,
            end=table.end,
        )
    ]


def _large_forcing(
    plan: ComponentPlan, table: schema.ForcingTable, reference: str, *, is_power: bool
) -> Iterator[str]:
    """Questions about a swing that no plant makes: beyond its base, or beyond what the unit can feed."""
    share = 100 * table.amplitude
    swing = f"{table.component}.{reference} swings by {share:.4g} % to both sides"
    if table.amplitude > 1:
        base = "its rated power" if is_power else "its base"
        yield f"{swing}, more than {base}: if {table.amplitude:.4g} % is meant, write '{table.amplitude:.4g} %'"
        return
    if not is_power or not {"P_0", "S_n"} <= set(plan.description.variables):
        return
    least, most = power_limits(
        plan, plan.number("Q_0") if "Q_0" in plan.description.variables else 0.0
    )
    P_0, S_n = plan.number("P_0"), plan.number("S_n")
    if P_0 <= 1:
        most = min(most, 1.0)
    if plan.kind == "machine" and P_0 >= 0:
        least = max(least, 0.0)
    low, high = P_0 - table.amplitude, P_0 + table.amplitude
    if low < least - _TOUCHED or high > most + _TOUCHED:
        ends = " to ".join("no limit" if isinf(x) else f"{x * S_n:.4g} MW" for x in (least, most))
        yield (
            f"{swing}: its power would go from {low * S_n:.4g} to {high * S_n:.4g} MW, beyond what it feeds ({ends}): "
            "give less, or another dispatch"
        )


def _reference_of(variable: str) -> str:
    """``governor.delta_P_ref`` → ``governor.P_ref``."""
    scope, _, name = variable.rpartition(".")
    return f"{scope}.{name.removeprefix('delta_')}".removeprefix(".")


def _unit_switching(draft: Draft, table: schema.UnitSwitchingTable, grid: str) -> list[Event]:
    plan = draft.system.components.get(table.unit)
    if plan is None and table.unit in draft.known:
        return []  # its share is 0, or its problem is noted already
    has_breaker = plan is not None and "connected" in plan.description.variables
    return [
        coupled.UnitSwitching(
            table.time,
            grid,
            table.unit,
            isinstance(table, schema.UnitReconnectionTable),
            has_breaker,
        )
    ]


def _grid_or_reference_events(table: schema.EventTable, component: str) -> list[Event]:
    match table:
        case schema.LoadChangeTable():
            return [coupled.LoadChange(table.time, component, table.load, table.scale)]
        case schema.LoadTripTable():
            return [coupled.LoadSwitching(table.time, component, table.load, 0.0)]
        case schema.LoadReconnectionTable():
            return [coupled.LoadSwitching(table.time, component, table.load, table.scale)]
        case schema.ShuntTripTable() | schema.ShuntReconnectionTable():
            closed = isinstance(table, schema.ShuntReconnectionTable)
            return [coupled.ShuntSwitching(table.time, component, table.shunt, closed)]
        case schema.LineReclosingTable():
            return [coupled.LineSwitching(table.time, component, table.line, True)]
        case schema.BranchChangeTable():
            return [coupled.BranchChange(table.time, component, table.line, table.X, table.R)]
        case schema.ReferenceChangeTable():
            return [coupled.ReferenceChange(table.time, component, table.reference, table.delta)]
        case schema.ParameterChangeTable():
            value: Any = table.value  # the check converts it to the variable's type and unit
            return [coupled.ParameterChange(table.time, component, table.parameter, value)]
        case _:
            raise TypeError(f"{type(table).__name__} is no event of the grid or of a component")


def _checked(
    draft: Draft, event: Event, fed: Mapping[Endpoint, Endpoint], where: str
) -> Event | None:
    """The event with its values in the variables' units; None if something is wrong with it."""
    before = len(draft.found.problems)
    for component, settings in event.changes().items():
        plan = draft.system.components.get(component)
        if plan is None:
            if component not in draft.tables and not (
                draft.found.network_failed and component == draft.grid
            ):
                names = ", ".join(draft.tables)
                draft.note(where, f"there is no component {component!r}; the case has: {names}")
            return None
        for variable, value in settings.items():
            info = plan.description.variables.get(variable)
            if info is None:
                draft.note(where, _unknown(event, component, variable, plan))
            elif source := fed.get(Endpoint(component, variable)):
                draft.note(
                    where, f"{component}.{variable} is fed by {source}; change that one's source"
                )
            elif info.causality != "input" and info.variability != "tunable":
                kind = f"{component}.{variable} is a {info.variability} {info.causality}"
                draft.note(where, f"{kind}; only tunable parameters and open inputs can change")
            elif (
                isinstance(event, coupled.LoadSwitching)
                and info.minimum is not None
                and event.scale < info.minimum
            ):
                why = "because nothing else determines the voltage of its bus"
                remedy = "give a line there some charging B, or take load_change"
                draft.note(where, f"load {event.load!r} cannot be switched off, {why}; {remedy}")
            else:
                converted = convert_value(draft, info, value, where)
                if isinstance(event, coupled.ParameterChange) and converted is not None:
                    event = replace(event, value=converted)
    return event if len(draft.found.problems) == before else None


def _unknown(event: Event, component: str, variable: str, plan: ComponentPlan) -> str:
    names = plan.description.variables
    wanted, kind, known = "", "", list[str]()
    match event:
        case coupled.LineSwitching() | coupled.BranchChange() | coupled.LineFault():
            wanted, kind, known = event.line, "line", lines_among(names)
        case coupled.LoadChange():
            wanted, kind, known = event.load, "load", _elements(names, "scale")
        case coupled.ShuntSwitching():
            wanted, kind, known = event.shunt, "shunt", _elements(names, "connected")
        case coupled.BusFault():
            wanted, kind, known = event.bus, "bus", _elements(names, "v_0")
        case coupled.UnitSwitching():
            wanted, kind, known = event.unit, "unit", _elements(plan.description.inputs, "i_re")
    if kind and wanted not in known:
        some = ", ".join(known[:12]) + (", …" if len(known) > 12 else "")
        hint = close_names(wanted, known, f"it has: {some}" if known else "it has none")
        if isinstance(event, coupled.BusFault) and wanted in lines_among(names):
            hint = f"it is a line: along it, a fault is at a share of the way, as in '{wanted} at 50 %, 100 ms'"
        return f"component {component!r} has no {kind} {wanted!r}; {hint}"
    settable = (*plan.description.parameters, *plan.description.inputs)
    hint = hint_at(plan.description, variable, settable, "")
    says = f"component {component!r} has no variable {variable!r} for this event to set"
    return f"{says}; {hint}" if hint else says


def _elements(names: Iterable[str], variable: str) -> list[str]:
    return [name.removesuffix(f".{variable}") for name in names if name.endswith(f".{variable}")]

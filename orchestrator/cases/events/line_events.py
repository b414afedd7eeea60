"""Faults and the opening of lines among a case file's events, and what only networks of phasors can do of them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from fmus.grid.element_data import Line
from fmus.grid.line_parts import NEAREST
from orchestrator.cases.draft import Draft
from orchestrator.cases.events.zero_sequence_transformers import unit_side
from orchestrator.cases.form import schema
from orchestrator.cases.networks.transformer_kinds import is_known_transformer
from orchestrator.core.errors import Problem, QuestionTopic
from orchestrator.core.options import Option
from orchestrator.systems.coupling import events as coupled
from orchestrator.systems.coupling.events import Event

SHARES = f"from {100 * NEAREST:g} to {100 * (1 - NEAREST):g} %"
"""Parts of the way along a line at which a fault can be, in words."""

_REMEDY = 'write models = "phasor" at the top of the case, or ' + Option.SET + " models=phasor"


def line_events(
    draft: Draft, table: schema.FaultBase | schema.LineTripTable, grid: str, where: str
) -> list[Event]:
    """Return the events of a fault or of a line that opens; none where the network cannot do it, which is noted."""
    for what in _beyond_transients(table):
        if not _is_of_phasors(draft, grid):
            draft.note(
                where,
                f"{what} needs a network of phasors, and {grid!r} has transients; " + _REMEDY,
            )
            return []
    match table:
        case schema.BusFaultTable():
            return _bus_fault(draft, table, grid, where)
        case schema.LineFaultTable():
            return _line_fault(draft, table, grid, where)
        case schema.LineTripTable():
            return _line_trip(draft, table, grid, where)
        case _:
            raise TypeError(f"{type(table).__name__} is no event of a line or a fault")


def _beyond_transients(table: schema.FaultBase | schema.LineTripTable) -> Iterator[str]:
    """Yield what of an event EMT networks of ours, which are balanced and have whole lines, cannot do."""
    if isinstance(table, schema.FaultBase) and table.kind != "3-phase":
        yield f"a fault of kind {table.kind!r}"
    if isinstance(table, schema.LineFaultTable):
        yield "a fault along a line"
    if table.end_bus is not None:
        yield "a line that opens at one end"


def _is_of_phasors(draft: Draft, grid: str) -> bool:
    plan = draft.system.components.get(grid)
    return plan is None or plan.is_of_phasors


def _bus_fault(draft: Draft, table: schema.BusFaultTable, grid: str, where: str) -> list[Event]:
    begin = coupled.BusFault(
        table.time, grid, table.bus, True, R=table.R, X=table.X, kind=table.kind
    )
    if table.duration is None:
        return [begin]
    end = table.time + table.duration
    events: list[Event] = [begin, coupled.BusFault(end, grid, table.bus, False)]
    if table.cleared_by is not None:
        line = _LineOfEvent(grid, table.cleared_by, where)
        events += _opening(draft, line, table.opens_at, (end, table.reclose_after))
    return events


@dataclass(frozen=True)
class _LineOfEvent:
    """A line that an event switches: the grid, its name, and where the case says so."""

    grid: str
    name: str
    where: str


def _opening(
    draft: Draft, line: _LineOfEvent, bus: str | None, times: tuple[float, float | None]
) -> list[Event]:
    """Return the opening of a line, at one of its buses alone where one is given, and its closing again.

    ``times``: of the opening [s], and from it until the line closes [s], None if it stays open. No events if the line
    does not lead to the bus, which is noted."""
    begin, dead = times
    opened: coupled.LineSwitching | coupled.LineEndSwitching
    opened = coupled.LineSwitching(begin, line.grid, line.name, False)
    if bus is not None and (joined := _line(draft, line.name)) is not None:
        side = _side(draft, joined, bus, line.where)
        if side is None:
            return []
        opened = coupled.LineEndSwitching(begin, line.grid, line.name, side, False)
    return (
        [opened] if dead is None else [opened, replace(opened, time=begin + dead, connected=True)]
    )


def _side(draft: Draft, line: Line, bus: str, where: str) -> Literal["from", "to"] | None:
    """Return which end of a line is at a bus; None, which is noted, if neither is."""
    if bus == line.from_bus:
        return "from"
    if bus == line.to_bus:
        return "to"
    draft.note(
        where,
        f"{line.name} joins {line.from_bus} and {line.to_bus}, and has no end at {bus!r}; name one of them",
    )
    return None


def _line_fault(draft: Draft, table: schema.LineFaultTable, grid: str, where: str) -> list[Event]:
    if _is_within_a_transformer(draft, table, where) or _is_at_an_end(draft, table, where):
        return []
    begin = coupled.LineFault(
        table.time, grid, table.line, table.at, True, R=table.R, X=table.X, kind=table.kind
    )
    events: list[Event] = [begin]
    if table.duration is None:
        return events
    if table.other_end_after is not None:
        return [begin, *_end_by_end(draft, table, begin, where)]
    end = table.time + table.duration
    events.append(coupled.LineFault(end, grid, table.line, table.at, False))
    closed = None if table.reclose_after is None else end + table.reclose_after
    if table.opens == "line":
        line = _LineOfEvent(grid, table.line, where)
        events += _opening(draft, line, table.opens_at, (end, table.reclose_after))
    elif table.opens == "pole" and closed is not None:
        events += _pole(draft, table, (grid, where), (end, closed))
    return events


def _is_at_an_end(draft: Draft, table: schema.LineFaultTable, where: str) -> bool:
    """Note a fault so near to an end of its line that it is one at the bus there."""
    line = _line(draft, table.line)
    if line is None or NEAREST <= table.at <= 1 - NEAREST:
        return False
    bus = line.from_bus if table.at < NEAREST else line.to_bus
    draft.note(
        where,
        f"at = {100 * table.at:g} %: along {table.line} it is {SHARES} of the way from {line.from_bus}; a fault at "
        f"this end is one at {bus}: type = 'bus_fault', bus = {bus!r}",
    )
    return True


def _end_by_end(
    draft: Draft, table: schema.LineFaultTable, fault: coupled.LineFault, where: str
) -> list[Event]:
    """Return the opening of a faulted line at one end, later at the other with the fault's end, and its closing.

    In between, the other end feeds the fault. One of fewer phases meets other networks then, and begins anew for that.
    """
    line, bus = _line(draft, table.line), table.opens_at
    if line is None or bus is None or table.duration is None or table.other_end_after is None:
        return []  # that there is no such line is noted with the fault
    side = _side(draft, line, bus, where)
    if side is None:
        return []
    times = table.time + table.duration, table.time + table.other_end_after
    first = coupled.LineEndSwitching(times[0], fault.component, line.name, side, False)
    last = replace(first, time=times[1], end="to" if side == "from" else "from")
    events: list[Event] = [first]
    if fault.kind != "3-phase":
        events.append(replace(fault, time=times[0]))
    events += [replace(fault, time=times[1], on=False), last]
    if table.reclose_after is not None:
        closing = times[1] + table.reclose_after
        events += [replace(one, time=closing, connected=True) for one in (first, last)]
    return events


def _is_within_a_transformer(draft: Draft, table: schema.LineFaultTable, where: str) -> bool:
    """Refuse a fault along what has no way: a transformer of two or three windings."""
    network, line = draft.network, _line(draft, table.line)
    windings = {x.name: x.buses for x in network.transformers} if network else {}
    buses: tuple[str, ...] = windings.get(table.line, ())
    kind = "three"
    if line is not None:
        asked = draft.given.case.network
        of_file = draft.data.sequences.transformers if draft.data and draft.data.sequences else None
        groups = asked.sequences.groups if asked else {}
        if is_known_transformer(line, of_file, groups):
            buses, kind = (line.from_bus, line.to_bus), "two"
    if not buses:
        if line is not None:
            _ask_whether_transformer(draft, line, where)
        return False
    lasts = "100 ms" if table.duration is None else f"{1e3 * table.duration:g} ms"
    draft.note(
        where,
        f"{table.line} is a transformer of {kind} windings, along which no fault has a place; put it at one of its "
        f"buses, {', '.join(buses)}, as "
        + Option.FAULT
        + f" '{buses[0]}, {lasts}, opens {table.line}, from {table.time:g} s' does",
    )
    return True


def _ask_whether_transformer(draft: Draft, line: Line, where: str) -> None:
    """Ask about a fault along what the network's file does not call a transformer, and is taken for one elsewhere."""
    network, sequences = draft.network, draft.data.sequences if draft.data else None
    if network is None or line.B or (sequences and sequences.transformers is not None):
        return
    side = unit_side(network, line)
    if side is None:
        return
    bus = (line.from_bus, line.to_bus)[side]
    text = (
        f"{line.name} has no charging and alone leads to the units at {bus}: zero-sequence networks take it for a "
        "transformer, along which no fault has a place, and this fault takes it for a line; put the fault at "
        f"{line.from_bus} or {line.to_bus}, or give the line its charging B"
    )
    topic = QuestionTopic("a fault along what may be a transformer", line.name)
    draft.found.questions.append(Problem(where, text, topic=topic))


def _pole(
    draft: Draft, table: schema.LineFaultTable, at: tuple[str, str], times: tuple[float, float]
) -> list[Event]:
    """Return the opening and the closing of one phase of a line, at one of its ends or at both."""
    grid, where = at
    line = _line(draft, table.line)
    plan = draft.system.components.get(grid)
    if line is None or plan is None:
        return []  # that there is no such line is noted with the fault
    if line.has_ratio:
        draft.note(
            where,
            f"{table.line} has a ratio: one of its phases cannot open alone; write opens = 'line'",
        )
        return []
    if table.opens_at is not None:
        side = _side(draft, line, table.opens_at, where)
        if side is None:
            return []
        opened = coupled.PoleEndSwitching(times[0], grid, table.line, side)
        return [opened, replace(opened, time=times[1], open=False)]
    X, R = plan.number(line.variable("X")), plan.number(line.variable("R"))
    return [
        coupled.PoleSwitching(time, grid, table.line, X, R, open=is_open)
        for time, is_open in zip(times, (True, False), strict=True)
    ]


def _line_trip(draft: Draft, table: schema.LineTripTable, grid: str, where: str) -> list[Event]:
    line = _LineOfEvent(grid, table.line, where)
    return _opening(draft, line, table.at, (table.time, table.reclose_after))


def _line(draft: Draft, name: str) -> Line | None:
    lines = draft.network.lines if draft.network else ()
    return next((line for line in lines if line.name == name), None)

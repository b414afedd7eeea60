"""Events in words: references that swing (``--force``) and short circuits (``--fault``), as tables of a case."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from fmus.grid.line_parts import NEAREST
from orchestrator.cases.case import Case
from orchestrator.cases.events.line_events import SHARES
from orchestrator.cases.form.schema import (
    BusFaultTable,
    CaseTable,
    ForcingTable,
    LineFaultTable,
    ScenarioTable,
)
from orchestrator.cases.networks.data import bus_name
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.core.units import to_unit

_BEGIN = 1.0  # time at which an event in words begins unless it says another [s]
_FORMS = {
    Option.FORCE: (
        ForcingTable,
        "forcing",
        re.compile(
            r"(?P<component>[^\s.]+)(\.(?P<reference>\S+))?\s+(?P<frequency>\S+\s*[mk]?Hz)\s+(?P<amplitude>\S+?\s*(%|pu))"
            r"(\s+(?P<shape>sine|square))?(\s+from\s+(?P<time>\S+\s*[mu]?s))?"
        ),
        "'UNIT FREQUENCY AMPLITUDE', such as 'sg35 0.8 Hz 2 %'; a reference ('sg35.exciter.V_ref'), a shape ('square')",
    ),
    Option.FAULT: (
        BusFaultTable,
        "bus_fault",
        re.compile(
            r"(bus )?(?P<bus>[^,]+?)\s*,\s*(?P<duration>[^\s,]+\s*[mu]?s)(\s*,\s*(?P<kind>[123]-phase(-earth)?))?"
            r"(\s*,\s*opens\s+(?P<cleared_by>[^,]+?))?"
            r"(\s*,\s*(the\s+)?other\s+end\s+after\s+(?P<other_end_after>\S+\s*[mu]?s))?"
            r"(\s*,\s*recloses\s+after\s+(?P<reclose_after>\S+\s*[mu]?s))?"
            r"(\s*,?\s*from\s+(?P<time>\S+\s*[mu]?s))?"
        ),
        "'PLACE, DURATION', such as 'bus_9, 150 ms' or 'line_7_9 at 30 %, 100 ms'; the phases ('1-phase', '2-phase', "
        "'2-phase-earth'), what clears it ('opens line_7_9'; along a line 'opens it' or 'opens one pole'; at one end "
        "alone 'opens line_7_9 at bus_7', 'opens it at bus_7', 'opens one pole at bus_7'; along a line "
        "'other end after 400 ms', counted from the fault's begin; and 'recloses after 500 ms')",
    ),
}
"""Option → what it asks for, its form, and that in words."""

_AT = " at "  # between a line and the bus at which alone it opens, as in --outages
_ALONG = re.compile(r"(?P<line>.+?)\s+at\s+(?P<at>\S+?(\s*%)?)")
_OPENED = {
    "it": "line",
    "one pole": "pole",
}  # words for what opens at the end of a fault along a line


def with_events(case: Case, forcings: Sequence[str], faults: Sequence[str]) -> Case:
    """The case with these in the place of all its events; see `event_of`."""
    if not (forcings or faults):
        return case
    events = [
        *(event_of(Option.FORCE, text) for text in forcings),
        *(event_of(Option.FAULT, text) for text in faults),
    ]
    said = [
        f'{word} "{text}"'
        for word, texts in (("force", forcings), ("fault", faults))
        for text in texts
    ]
    scenarios = {
        name: table.model_copy(update={"events": None, "title": _title(table, said)})
        for name, table in case.table.scenarios.items()
    }
    table: CaseTable = case.table.model_copy(update={"events": events, "scenarios": scenarios})
    return replace(case, table=table, events_given=tuple(said))


def different_scenarios(case: Case) -> list[str]:
    """Return the scenarios that are left to compute: of those that only their own events told apart, the first.

    Without events in the place of the case's, all of them."""
    if not case.events_given:
        return [*case.table.scenarios]
    found: list[tuple[str, ScenarioTable]] = []
    for name, table in case.table.scenarios.items():
        alike = table.model_copy(update={"title": ""})
        if all(alike != other for _, other in found):
            found.append((name, alike))
    return [name for name, _ in found]


def _title(scenario: ScenarioTable, said: Sequence[str]) -> str:
    """The title of a scenario with other events: these, where its own title told of events of its own."""
    return ", ".join(said) if scenario.events and scenario.title else scenario.title


def _reason(detail: Any) -> str:
    """A mistake of one part of an event in words: which part, the rule, and the value seen."""
    said = str(detail["msg"]).removeprefix("Value error, ")
    if not said.startswith("Input should be"):
        return said
    place = ".".join(map(str, detail["loc"]))
    return f"{place} = {detail['input']!r}; {said.replace('Input should be', 'it must be')}"


EventInWords = ForcingTable | BusFaultTable | LineFaultTable


def event_of(option: Option, text: str) -> EventInWords:
    """An event in words: ``sg35.exciter.V_ref 0.8 Hz 0.02 pu square from 2 s``, ``bus_9, 150 ms, opens line_7_9``."""
    kind, name, form, how = _FORMS[option]
    parts = form.fullmatch(" ".join(text.split()))
    if parts is None:
        raise InputError(
            option + f" {text!r}: it is not of the form {how} and a begin ('from 2 s') may be added"
        )
    given = {key: word for key, word in parts.groupdict().items() if word is not None}
    try:
        time = to_unit(given.pop("time", _BEGIN), "s")
        given |= {"bus": bus_name(given["bus"])} if " " not in given.get("bus", " ") else {}
        given |= _at_one_end(given.get("cleared_by", ""))
        along = _ALONG.fullmatch(given.get("bus", ""))
        if along is not None:
            kind, name, given = LineFaultTable, "line_fault", _along_a_line(given, along)
        elif "other_end_after" in given:
            raise ValueError(
                "'other end after' is of a fault along a line, which its other end goes on feeding: "
                "'line_7_9 at 1 %' is one close to the bus"
            )
        elif given.get("cleared_by") in _OPENED:
            raise ValueError(
                f"opens {given['cleared_by']!r}: at a bus it names the line, as in 'opens line_7_9'; "
                "'it' and 'one pole' are of a fault along a line, as in 'line_7_9 at 30 %'"
            )
        table: EventInWords = kind(type=name, time=time, **given)
        return table.asked_as(option + f" {text!r}")
    except ValueError as error:  # pydantic's and ours
        details = error.errors() if hasattr(error, "errors") else []
        reasons = [_reason(one) for one in details] or [str(error)]
        raise InputError(option + f" {text!r}: {'; '.join(reasons)}") from error


def _at_one_end(opened: str) -> dict[str, str]:
    """Return the keys of what opens at one bus alone; none of what opens whole."""
    line, at, bus = opened.rpartition(_AT)
    return {"cleared_by": line, "opens_at": bus_name(bus)} if at else {}


def _is_between_ends(at: str) -> bool:
    """Return whether a word is a share of the way along a line that lies between its ends, and not at one of them."""
    try:
        return NEAREST <= to_unit(at, "1") <= 1 - NEAREST
    except ValueError:
        return False


def _along_a_line(given: Mapping[str, str], along: re.Match[str]) -> dict[str, str]:
    """Return the keys of a fault along a line, from those of one at a bus."""
    if not _is_between_ends(along["at"]):
        raise ValueError(
            f"at {along['at']!r}: along a line it is the share of the way from its from bus, such as 'at 30 %', "
            f"{SHARES}; a fault at an end of it is one at that bus, as in 'bus_9, 150 ms'"
        )
    found = {key: word for key, word in given.items() if key not in ("bus", "cleared_by")}
    opened = given.get("cleared_by")
    if opened is not None and opened not in _OPENED:
        raise ValueError(
            f"opens {opened!r}: along a line it is 'opens it' or 'opens one pole'; other lines open by [[events]]"
        )
    return found | along.groupdict() | ({"opens": _OPENED[opened]} if opened else {})

"""Events in words: references that swing (``--force``) and short circuits (``--fault``), as tables of a case."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from orchestrator.cases.case import Case
from orchestrator.cases.network_data import bus_name
from orchestrator.cases.schema import BusFaultTable, CaseTable, ForcingTable
from orchestrator.errors import InputError
from orchestrator.units import to_unit

_FORCING = re.compile(
    r"(?P<component>[^\s.]+)(\.(?P<reference>\S+))?\s+(?P<frequency>\S+\s*[mk]?Hz)\s+(?P<amplitude>\S+?\s*(%|pu))"
    r"(\s+(?P<shape>sine|square))?(\s+from\s+(?P<time>\S+\s*[mu]?s))?"
)
_FAULT = re.compile(
    r"(bus )?(?P<bus>[^\s,]+)\s*,\s*(?P<duration>[^\s,]+\s*[mu]?s)(\s*,\s*opens\s+(?P<cleared_by>[^\s,]+))?"
    r"(\s*,?\s*from\s+(?P<time>\S+\s*[mu]?s))?"
)
_BEGIN = 1.0  # time at which an event in words begins unless it says another [s]


def with_events(case: Case, forcings: Sequence[str], faults: Sequence[str]) -> Case:
    """The case with these in the place of all its events; see `forcing_of` and `fault_of`."""
    if not (forcings or faults):
        return case
    events = [*map(forcing_of, forcings), *map(fault_of, faults)]
    scenarios = {name: table.model_copy(update={"events": None}) for name, table in case.table.scenarios.items()}
    table: CaseTable = case.table.model_copy(update={"events": events, "scenarios": scenarios})
    return replace(case, table=table)


def forcing_of(text: str) -> ForcingTable:
    """A forcing in words: ``sg35 0.8 Hz 2 %``, ``sg35.exciter.V_ref 0.8 Hz 0.02 pu square from 2 s``."""
    return _table(ForcingTable, "forcing", _FORCING, f"--force {text!r}", text, "'UNIT FREQUENCY AMPLITUDE', such as "
                  "'sg35 0.8 Hz 2 %'; a reference ('sg35.exciter.V_ref'), a shape ('square') and a begin ('from 2 "
                  "s')")  # fmt: skip


def fault_of(text: str) -> BusFaultTable:
    """A three-phase short circuit in words: ``bus_9, 150 ms``, ``bus_9, 150 ms, opens line_7_9, from 2 s``."""
    return _table(BusFaultTable, "bus_fault", _FAULT, f"--fault {text!r}", text, "'BUS, DURATION', such as "
                  "'bus_9, 150 ms'; the line that clears it ('opens line_7_9') and a begin ('from 2 s')")  # fmt: skip


_Table = TypeVar("_Table", ForcingTable, BusFaultTable)


def _table(kind: type[_Table], name: str, form: re.Pattern[str], option: str, text: str, how: str) -> _Table:
    parts = form.fullmatch(" ".join(text.split()))
    if parts is None:
        raise InputError(f"{option}: it is not of the form {how} may be added")
    given = {key: word for key, word in parts.groupdict().items() if word is not None}
    try:
        time = to_unit(given.pop("time", _BEGIN), "s")
        given |= {"bus": bus_name(given["bus"])} if "bus" in given else {}
        return kind(type=name, time=time, **given).asked_as(option)  # type: ignore[arg-type]  # texts with units
    except ValueError as error:  # pydantic's and ours
        reasons = [str(e["msg"]) for e in error.errors()] if hasattr(error, "errors") else [str(error)]
        raise InputError(f"{option}: {'; '.join(reasons).removeprefix('Value error, ')}") from error

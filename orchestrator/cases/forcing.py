"""Forcings: references that swing, as tables of a case's events and as the words of ``--force``."""

import re
from collections.abc import Sequence
from dataclasses import replace

from orchestrator.cases.case import Case
from orchestrator.cases.schema import CaseTable, ForcingTable
from orchestrator.errors import InputError
from orchestrator.units import to_unit

_FORM = re.compile(
    r"(?P<component>[^\s.]+)(\.(?P<reference>\S+))?\s+(?P<frequency>\S+\s*[mk]?Hz)\s+(?P<amplitude>\S+?\s*(%|pu))"
    r"(\s+(?P<shape>sine|square))?(\s+from\s+(?P<time>\S+\s*[mu]?s))?"
)
_BEGIN = 1.0  # time at which a forcing of ``--force`` begins unless it says another [s]


def forced(case: Case, texts: Sequence[str]) -> Case:
    """The case with forcings in the place of all its events; see `forcing_of`."""
    if not texts:
        return case
    events = [forcing_of(text) for text in texts]
    scenarios = {name: table.model_copy(update={"events": None}) for name, table in case.table.scenarios.items()}
    table: CaseTable = case.table.model_copy(update={"events": events, "scenarios": scenarios})
    return replace(case, table=table)


def forcing_of(text: str) -> ForcingTable:
    """A forcing in words: ``sg35 0.8 Hz 2 %``, ``sg35.exciter.V_ref 0.8 Hz 0.02 pu square from 2 s``."""
    parts = _FORM.fullmatch(" ".join(text.split()))
    if parts is None:
        raise InputError(
            f"--force {text!r}: it is not of the form 'UNIT FREQUENCY AMPLITUDE', such as 'sg35 0.8 Hz 2 %'; a "
            "reference ('sg35.exciter.V_ref'), a shape ('square') and a begin ('from 2 s') may be added"
        )
    given = {name: word for name, word in parts.groupdict().items() if word is not None}
    try:
        time = to_unit(given.pop("time", _BEGIN), "s")
        return ForcingTable(type="forcing", time=time, **given).asked_as(text)  # type: ignore[arg-type]  # texts with units
    except ValueError as error:  # pydantic's and ours
        reasons = [str(e["msg"]) for e in error.errors()] if hasattr(error, "errors") else [str(error)]
        raise InputError(f"--force {text!r}: {'; '.join(reasons).removeprefix('Value error, ')}") from error

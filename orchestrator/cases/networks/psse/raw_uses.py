"""Uses of the records of a RAW file, area interchange among them: used, held at its value, or not used."""

from collections.abc import Collection, Mapping, Sequence

from orchestrator.cases.networks.psse.missing_buses import status_columns
from orchestrator.cases.networks.psse.raw_records import (
    ADJUSTMENTS,
    LEFT_OUT,
    NODES,
    SWITCHING_DEVICES,
    RawFile,
    Record,
    elements,
)
from orchestrator.cases.networks.record_use import RecordUse, UseOfRecord

_OUT = 4  # IDE of a bus that is out of service
_IREG = 7  # column of the bus whose voltage a machine controls
_USED = (UseOfRecord.USED, "")
BY_MODEL = "by the model of its record of dynamics data"
"""Why a device's record is used."""

_NO_EFFECT = (UseOfRecord.NOT_USED, "no effect on the network")
_JOINING = ("branch", "system switching device")  # that may be zero impedance lines
_OF_SECTION = {
    "area": (UseOfRecord.HELD, "interchange is not controlled: the machines feed PG"),
    "impedance correction": _USED,
    "multi-section line": (UseOfRecord.NOT_USED, "its sections are branches of their own"),
    "system-wide": (UseOfRecord.NOT_USED, "settings of PSS/E's solution, beside THRSHZ"),
    ADJUSTMENTS: (UseOfRecord.HELD, "its tap or phase shift"),
    "substation": (UseOfRecord.NOT_USED, "its nodes and switches are passed over"),
}


def record_uses(
    raw: RawFile,
    merged: Collection[int],
    leaving_out: Collection[str],
    unused: Mapping[tuple[str, int], str],
    dropped: Mapping[int, str],
    *,
    modelled: Collection[int] = (),
) -> tuple[RecordUse, ...]:
    """Return what became of every element of a file, by the first line of its record.

    ``merged``: lines of zero impedance lines that make their buses one; ``leaving_out``: elements that the user leaves
    out; ``unused``: why a device is not used, by section and place among its elements; ``dropped``: why another element
    is not used, by the line of its record; ``modelled``: lines of devices that are units with a model."""
    found = []
    for section, records in raw.sections.items():
        for k, lines in enumerate(elements(section, records)):
            use, why = _use(raw, section, lines, leaving_out)
            if section in _JOINING and lines[0].line in merged:
                use, why = UseOfRecord.NOT_USED, "zero impedance: its buses are one"
            if (section, k) in unused:
                use, why = UseOfRecord.NOT_USED, unused[section, k]
            if lines[0].line in modelled:
                use, why = UseOfRecord.USED, BY_MODEL
            if lines[0].line in dropped:
                use, why = UseOfRecord.NOT_USED, dropped[lines[0].line]
            found.append(RecordUse(raw.place, lines[0].line, section, use, why))
    return tuple(found)


def _use(
    raw: RawFile, section: str, lines: Sequence[Record], leaving_out: Collection[str]
) -> tuple[UseOfRecord, str]:
    record = lines[0]
    if section in LEFT_OUT:
        if section in leaving_out:
            return UseOfRecord.NOT_USED, "left out, as leave_out says"
        return UseOfRecord.HELD, "what it feeds or draws in the file's solution"
    if section == "bus":
        return _out_of_service("IDE = 4") if record.whole(3, "IDE", 1) == _OUT else _USED
    status = status_columns(raw.revision).get(section)
    if status is not None and not record.whole(status, "the status", 1):
        return _out_of_service("its status is 0")
    if section == "branch" and len({abs(record.whole(k, "the bus' number")) for k in (0, 1)}) == 1:
        return UseOfRecord.NOT_USED, "from a bus to itself"
    if section == "switched shunt" and record.whole(_mode(raw.revision), "MODSW", 1):
        return UseOfRecord.HELD, "at BINIT"
    if section == "transformer" and _is_controlled(raw.revision, lines):
        return UseOfRecord.HELD, "its tap or phase shift"
    bus = abs(record.whole(0, "the bus' number")) if section == "generator" else 0
    if bus and record.whole(_IREG, "IREG", 0) not in (0, bus):
        return UseOfRecord.HELD, "the voltage of its own bus, instead of that of IREG"
    is_element = section in status_columns(raw.revision) or section == "switched shunt"
    return _USED if is_element else _OF_SECTION.get(section, _NO_EFFECT)


def _out_of_service(how: str) -> tuple[UseOfRecord, str]:
    return UseOfRecord.NOT_USED, f"out of service: {how}"


def _mode(revision: int) -> int:
    """Return the column of MODSW of a switched shunt."""
    return 1 + (revision >= NODES)


def _is_controlled(revision: int, lines: Sequence[Record]) -> bool:
    column = 6 if revision < SWITCHING_DEVICES else 15
    return any(line.whole(column, "COD", 0) for line in lines[2:] if len(line.fields) > 3)

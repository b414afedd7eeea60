"""Uses of the records of a network's files: used, held, or not used, and why."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from orchestrator.core.errors import number_of


class UseOfRecord(StrEnum):
    USED = "used"
    HELD = "held"  # a control that stays at its value, such as a tap
    NOT_USED = "not used"


@dataclass(frozen=True, slots=True)
class RecordUse:
    """One record: its file and line, its kind (a section of RAW, a model of DYR), and why it is not used as it is."""

    file: str
    line: int
    kind: str
    use: UseOfRecord
    why: str = ""
    of_no_machine: bool = False  # a record of a DYR file at a bus and identifier without a machine


def in_one_line(records: Sequence[RecordUse]) -> str:
    """``records: 12 used, 3 not used (2 IEELAL, 1 CMLDBLU2)``; empty without records."""
    parts = []
    for use in UseOfRecord:
        kinds = Counter(record.kind for record in records if record.use is use)
        if not kinds:
            continue
        named = ", ".join(f"{n} {kind}" for kind, n in kinds.most_common())
        parts.append(
            f"{kinds.total()} {use}" + (f" ({named})" if use is not UseOfRecord.USED else "")
        )
    return f"{number_of(len(records), 'record')}: {', '.join(parts)}" if parts else ""


def details(records: Sequence[RecordUse]) -> list[str]:
    """A line for each record that is not used as it stands there."""
    return [
        f"{record.file}, line {record.line}: {record.kind}: {record.use}{f': {record.why}' if record.why else ''}"
        for record in records
        if record.use is not UseOfRecord.USED
    ]


def in_full(records: Sequence[RecordUse]) -> list[str]:
    """Return the details under their heading, or a line that tells why there are none."""
    lines = details(records)
    if lines:
        return ["Records that are not used as they stand:", *lines]
    return [
        "Every record of the files is used as it stands."
        if records
        else "gfor lists no records of files of this format."
    ]


def as_json(records: Sequence[RecordUse]) -> list[dict[str, Any]]:
    return [asdict(record) for record in records]

"""Elements in service at buses that a RAW file does not have: PSS/E tells of each and goes on without it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from orchestrator.cases.networks.psse.raw_records import (
    NODES,
    SWITCHING_DEVICES,
    RawFile,
    Record,
    elements,
)
from orchestrator.cases.networks.source_changes import Remark

_SWITCHED_SHUNT_STATUS = 32  # first revision with STAT of a switched shunt
_ENDS: Mapping[str, int] = {
    "load": 1,
    "fixed shunt": 1,
    "switched shunt": 1,
    "generator": 1,
    "branch": 2,
    "system switching device": 2,
    "transformer": 3,
}
"""Section → columns with the numbers of buses, from the first one on."""

_VERBS: Mapping[str, str] = {"load": "draws", "generator": "feeds"}
"""Section → what its elements do with their power."""


@dataclass(frozen=True)
class KnownElements:
    """A file without the elements at buses that it does not have, and why, by the line of their record."""

    raw: RawFile
    dropped: Mapping[int, str]


def with_known_buses(raw: RawFile) -> KnownElements:
    """Leave out elements in service at buses that the file does not have; others may point anywhere, as in PSS/E."""
    buses = {abs(record.whole(0, "the bus' number")) for record in raw.of("bus")}
    status = status_columns(raw.revision)
    dropped: dict[int, str] = {}
    sections = dict(raw.sections)
    for section in (section for section in _ENDS if raw.of(section)):
        kept: list[Record] = []
        for lines in elements(section, raw.of(section)):
            record, column = lines[0], status.get(section)
            missing = [bus for bus in _buses(section, record) if bus not in buses]
            if missing and (column is None or record.whole(column, "the status", 1)):
                named = " and ".join(str(bus) for bus in missing)
                dropped[record.line] = Remark(
                    f"not used: the file has no bus {named}{_lost(section, record)}",
                    "an element at a bus that the file has not",
                )
            else:
                kept += lines
        sections[section] = kept
    return (
        KnownElements(replace(raw, sections=sections), dropped)
        if dropped
        else KnownElements(raw, {})
    )


def _lost(section: str, record: Record) -> str:
    """Return which power the network lacks without an element, such as ``; the 10 MW that it draws drop out``."""
    amounts = [
        f"{x:g} {unit}"
        for x, unit in zip(_power(section, record), ("MW", "Mvar"), strict=True)
        if x
    ]
    return f"; the {' and '.join(amounts)} that it {_VERBS[section]} drop out" if amounts else ""


def _power(section: str, record: Record) -> tuple[float, float]:
    """Return what a load draws at 1 pu, or a machine feeds [MW, Mvar]; 0 of other elements."""
    if section == "generator":
        return record.number(2, "PG", 0.0), record.number(3, "QG", 0.0)
    if section != "load":
        return 0.0, 0.0
    names = ("PL", "QL", "IP", "IQ", "YP", "YQ")
    pl, ql, ip, iq, yp, yq = (record.number(5 + k, name, 0.0) for k, name in enumerate(names))
    return pl + ip + yp, ql + iq - yq  # YQ is positive where it generates


def status_columns(revision: int) -> dict[str, int]:
    """Return the column of an element's status by section, of which 0 is out of service."""
    shunt = {} if revision < _SWITCHED_SHUNT_STATUS else {"switched shunt": 3 + (revision >= NODES)}
    return shunt | {
        "load": 2,
        "fixed shunt": 2,
        "generator": 14 + (revision >= NODES),
        "branch": 13 if revision < SWITCHING_DEVICES else 23,
        "system switching device": 16,
        "transformer": 11,
    }


def _buses(section: str, record: Record) -> Iterator[int]:
    """Yield the buses of an element; a transformer of two windings has no third one."""
    for column in range(_ENDS[section]):
        bus = abs(record.whole(column, "the bus' number", 0 if column > 1 else None))
        if bus or column < 2:
            yield bus

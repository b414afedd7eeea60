"""Records of a PSS/E power flow data file (RAW), by section.

Elements that our network does not have are refused without the user's word, and listed with it."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from orchestrator.cases.form.remedies import without_kinds
from orchestrator.cases.networks.psse.titles import section_of
from orchestrator.cases.networks.source_changes import Changes
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_bytes, visible
from orchestrator.core.units import LARGEST

REVISIONS = tuple(range(23, 37))  # revisions whose records are known
NODES = 35  # first revision with nodes in the records of machines, switched shunts and converters
NAMES = 36  # first revision with names of switched shunts, and sets of ratings of switching devices
SWITCHING_DEVICES = 34  # first revision with system-wide data, switching devices and substations
_OLDEST = 23  # last revision with loads in the records of buses
_OLDEST_FIELDS = 12  # of a bus until then
ADJUSTMENTS = "transformer adjustment"
"""Section of the controls of transformers, which are branches up to revision 26."""

MOST_BYTES = 200_000_000  # of a file: ten times the largest interconnections

_TAIL = (
    "area",
    "two-terminal dc",
    "vsc dc line",
    "impedance correction",
    "multi-terminal dc",
    "multi-section line",
    "zone",
    "inter-area transfer",
    "owner",
    "facts device",
    "switched shunt",
    "gne",
    "induction machine",
)
_HEAD = ("bus", "load", "fixed shunt", "generator", "branch")
_ORDER: dict[int, tuple[str, ...]] = dict.fromkeys((31, 32, 33), (*_HEAD, "transformer", *_TAIL))
_ORDER[30] = _ORDER[29] = (
    *("bus", "load", "generator", "branch", "transformer", "area", "two-terminal dc"),
    *("vsc dc line", "switched shunt", "impedance correction", "multi-terminal dc"),
    *("multi-section line", "zone", "inter-area transfer", "owner", "facts device"),
)
_ORDER[28] = tuple(name for name in _ORDER[29] if name != "vsc dc line")
_ORDER[24] = tuple(ADJUSTMENTS if name == "transformer" else name for name in _ORDER[28])
_ORDER[26] = _ORDER[25] = _ORDER[24]
_ORDER[_OLDEST] = tuple(name for name in _ORDER[24] if name != "load")
_ORDER[34] = ("system-wide", *_HEAD, "system switching device", "transformer", *_TAIL, "substation")
_ORDER[35] = _ORDER[34]

_TOKEN = re.compile(r"""'([^']*)'?|"([^"]*)"?|(,)|(/)|([^\s,'"/]+)""")
# the same between commas, where an apostrophe ends a text only before a comma, a slash or the end of the line: others,
# doubled or not, belong to it
_STRICT_TOKEN = re.compile(
    r"""'((?:[^']|'(?!\s*(?:,|/|$)))*)'?|"((?:[^"]|"(?!\s*(?:,|/|$)))*)"?|(,)|(/)|([^\s,'"/]+)"""
)
_BETWEEN_COMMAS = re.compile(r"""[^'"/]*,\s*['"]""")  # begin of a record whose texts stand so
BEGIN_OF_SECTION = re.compile(r"\bBEGIN(?:NING OF)?\s+(.*?)(?:\s+DATA\b.*)?$", re.IGNORECASE)
_RECORD = re.compile(r"""\s*[-'"\d]""")  # begin of a record: a number or a text
_END = re.compile(r"\bEND OF\s+(.*?)(?:\s+DATA\b.*|,.*)?$", re.IGNORECASE)
_COMMENT = re.compile(r"\s*(@!|//?(\s|$))")  # begins of a line without data
_WRITER = re.compile(r"PSS\W*(?:\w{1,2}\W*)?E\W*(\d{2})", re.IGNORECASE)  # "PSS/E-30.3"
_REMEDY = (
    "(such as '0 / END OF BUS DATA, BEGIN LOAD DATA'), and their order is not known for this file; export the case "
    "from PSS/E as revision 35"
)


@dataclass(frozen=True, slots=True)
class Record:
    """One line of data: the file and its number, and its fields as text; omitted fields are empty."""

    place: str
    line: int
    fields: Sequence[str]

    def text(self, index: int, default: str = "") -> str:
        """A field as text, without quotes and blanks around it."""
        return (self.fields[index] if index < len(self.fields) else "") or default

    def number(self, index: int, name: str, default: float | None = None) -> float:
        text = self.text(index)
        if not text and default is not None:
            return default
        try:
            value = float(text.replace("D", "E").replace("d", "e"))
        except ValueError:
            value = math.nan
        if not abs(value) < LARGEST:
            raise self.error(f"{name} is {text!r}; it must be a number")
        return value

    def whole(self, index: int, name: str, default: int | None = None) -> int:
        value = self.number(index, name, default)
        if value != int(value):
            raise self.error(f"{name} is {self.text(index)!r}; it must be a whole number")
        return int(value)

    def error(self, text: str) -> InputError:
        return InputError.at(f"{self.place}, line {self.line}", f"{text}")


@dataclass(frozen=True)
class RawFile:
    place: str
    revision: int
    # base_mva, frequency: system base [MVA], and rated frequency [Hz] where the file says it
    base_mva: float
    frequency: float | None
    # records by the section's name in small letters; one with several lines is several records
    sections: dict[str, list[Record]] = field(default_factory=dict)
    # lines between sections that do not say which data begin, though others do, and the section that was taken by the
    # revision's order
    guessed: dict[int, str] = field(default_factory=dict)

    # (line, text) of what the first lines say in another way than usual
    remarks: tuple[tuple[int, str], ...] = ()

    def of(self, section: str) -> list[Record]:
        return self.sections.get(section, [])


def read_records(path: Path) -> RawFile:
    lines = numbered_lines(text_of(path))
    first = next(lines, None)
    if first is None:
        raise InputError.at(f"{path}", "it is empty; export the case from PSS/E as RAW")
    head = Record(str(path), first[0], fields_of(first[1]))
    titles = [next(lines, None) for _ in range(2)]
    begin = [line for line in (next(lines, None),) if line is not None]
    lines = chain(begin, lines)
    oldest = all(_is_oldest_bus(line) for _, line in begin) and bool(begin)
    revision, remarks = _revision(head, first[1], oldest=oldest)
    if head.whole(0, "IC", 0) not in (0, 1):
        raise head.error(f"IC is {head.text(0)}; it is 0 for a whole case, or 1 for changes")
    if head.whole(0, "IC", 0):
        remarks.append("IC = 1, data to be added to a case: read as a whole case")
    base = head.number(1, "the system base SBASE [MVA]", 100.0)
    if not base > 0:
        raise head.error(f"the system base SBASE is {base:g} MVA; it must exceed 0")
    frequency = head.number(5, "the frequency BASFRQ [Hz]", 0.0)
    if titles[1] is not None and _is_bus(titles[1][1]):
        remarks.append("one line of titles, where PSS/E writes two: the second is a bus")
        lines = chain([titles[1]], lines)
    sections, guessed = _sections(path, revision, lines)
    noted = tuple((head.line, text) for text in remarks)
    return RawFile(
        str(path),
        revision,
        base_mva=base,
        frequency=frequency or None,
        sections=sections,
        guessed=guessed,
        remarks=noted,
    )


def _revision(head: Record, line: str, *, oldest: bool) -> tuple[int, list[str]]:
    """REV, which revisions before 31 only tell in the comment, and remarks.

    ``oldest``: whether the buses hold their loads."""
    written = _WRITER.search(line)
    known = f"{REVISIONS[0]} to {REVISIONS[-1]}"
    if head.text(2):
        revision = head.whole(2, "the revision REV")
    elif written:
        revision = int(written[1])
    elif len(head.fields) < 2 or not is_number(head.text(1)):
        raise head.error(
            "the first record has no revision; a RAW file begins with IC, SBASE, REV, XFRRAT, NXFRAT, BASFRQ"
        )
    elif oldest:
        return _OLDEST, ["no revision REV, and the buses hold their loads: read as revision 23"]
    else:
        return 30, ["no revision REV: read as revision 30, the last one without it"]
    if revision not in REVISIONS:
        raise head.error(
            f"the revision REV is {revision}; {known} are read: export the case from PSS/E as one of them"
        )
    return revision, []


def is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _is_bus(line: str) -> bool:
    """Return whether a line of titles is the record of a bus: its number, a name in quotes, and numbers."""
    if not re.match(r"\s*\d+\s*,?\s*['\"]", line):
        return False
    fields = fields_of(line)
    return len(fields) > 7 and all(is_number(text) for text in fields[2:4])


def _is_oldest_bus(line: str) -> bool:
    """Return whether a bus has its kind in the place of its name, and 12 values, as up to revision 23."""
    fields = fields_of(line)
    return len(fields) == _OLDEST_FIELDS and fields[1] in ("1", "2", "3", "4")


def text_of(path: Path) -> str:
    """The text of a file, in UTF-8 or, if it is none, Latin-1."""
    if not path.is_file():
        raise InputError.at(f"{path}", "there is no such file; give the path of a PSS/E RAW file")
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise InputError.at(f"{path}", f"it has {size} bytes; at most {MOST_BYTES} are read")
    content = read_bytes(path, MOST_BYTES)
    if b"\x00" in content[:4096]:
        raise InputError.at(
            f"{path}", "it is no text, perhaps a saved case (.sav); export it from PSS/E as RAW"
        )
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return visible(text)


def numbered_lines(text: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, without those that only comment."""
    yield from (
        (n, line)
        for n, line in enumerate(text.splitlines(), start=1)
        if not _COMMENT.match(line) and (line.strip() or n > 1)
    )


def _sections(
    path: Path, revision: int, lines: Iterator[tuple[int, str]]
) -> tuple[dict[str, list[Record]], dict[int, str]]:
    """Records by section, and the sections that only the order gives although other lines say theirs."""
    sections: dict[str, list[Record]] = {}
    guessed: dict[int, str] = {}
    named = False
    order = list(_ORDER.get(revision, ()))
    name = "bus" if revision < SWITCHING_DEVICES else "system-wide"
    for number, line in lines:
        stripped = line.strip()
        if not stripped:
            continue
        if stripped.upper() == "Q":
            return sections, guessed if named else {}
        if END_OF_SECTION.match(stripped):
            named = named or bool(BEGIN_OF_SECTION.search(stripped) and name != "system-wide")
            name = _following(path, number, stripped, name, order)
            if not (BEGIN_OF_SECTION.search(stripped) or _END.search(stripped)) and name != "end":
                guessed[number] = name
        elif name == "end" and not _RECORD.match(line):
            continue  # what a program says behind the last section
        elif name == "end":
            raise InputError.at(
                f"{path}, line {number}",
                f"the line before these data does not say which begin {_REMEDY}",
            )
        else:
            fields = fields_of(line)
            fields = _without_names(name, fields) if revision >= NAMES else fields
            sections.setdefault(name, []).append(Record(str(path), number, fields))
    if not {"bus", "branch"} <= {*sections} or name in _HEAD:
        raise InputError.at(f"{path}", f"it ends within its {name} data; export the case once more")
    return sections, guessed if named else {}


END_OF_SECTION = re.compile(r"""(0|'\s*0\s*'|"\s*0\s*")\s*(/|$)""")
"""A 0 in the place of a record's first value; in quotes where that is a name, as programs write it behind DC lines."""

_NAME = {"switched shunt": 12, "induction machine": 8}
"""Column of NAME, before others that revision 35 has as well."""

_RATING_SET = 4
"""Column of the name of a set of ratings, in whose place revision 35 has the ratings themselves."""

_RATINGS = 12
"""Ratings that revision 35 has there."""


def _without_names(section: str, fields: list[str]) -> list[str]:
    """Return a record of revision 36 with the columns of revision 35; a number is no name.

    Source: the headings of the columns in the sample that PSS/E 36 writes."""
    column = _NAME.get(section)
    if column is not None and len(fields) > column and not is_number(fields[column]):
        return [*fields[:column], *fields[column + 1 :]]
    is_set = section == "system switching device" and len(fields) > _RATING_SET
    if is_set and not is_number(fields[_RATING_SET]):
        return [*fields[:_RATING_SET], *[""] * _RATINGS, *fields[_RATING_SET + 1 :]]
    return fields


def _following(path: Path, number: int, line: str, name: str, order: list[str]) -> str:
    """The section that begins: the one that the line names, or else the next in the revision's order."""
    found = _END.search(line)
    ended = section_of(found[1]) if found else ""
    if name == "substation" and not BEGIN_OF_SECTION.search(line):
        return name  # each substation has sections of its own
    shunts = ended.endswith("shunt") and name.endswith("shunt")  # either may be called just so
    if ended in order and name in order and ended != name and not shunts:
        raise InputError.at(
            f"{path}, line {number}",
            f"it ends the {ended} data, and what stands before it are {name} data by the "
            "lines between sections; one of these is missing or wrong: export the case "
            "once more",
        )
    found = BEGIN_OF_SECTION.search(line)
    if found:
        return section_of(found[1])
    if name not in order:
        if ended:
            return "end"
        raise InputError.at(
            f"{path}, line {number}", f"the line does not say which data begin {_REMEDY}"
        )
    following = order.index(name) + 1
    return order[following] if following < len(order) else "end"


def fields_of(line: str) -> list[str]:
    """Fields of a record, separated by commas or blanks; what stands behind a slash is a comment."""
    fields, empty = list[str](), True  # empty: nothing since the last comma
    tokens = _STRICT_TOKEN if _BETWEEN_COMMAS.match(line) else _TOKEN
    for token in tokens.finditer(line):
        quoted, other, comma, slash, plain = token.groups()
        if slash:
            break
        if comma:
            fields += [""] if empty else []
        else:
            text = quoted.replace("''", "'") if quoted else other or plain or ""
            fields.append(text.strip())
        empty = bool(comma)
    return fields


LEFT_OUT = (
    "two-terminal dc",
    "vsc dc line",
    "facts device",
    "induction machine",
    "multi-terminal dc",
    "gne",
)
"""Devices that feed or draw by controls of their own; `leave_out` of the case names those that may go."""

_FIELDS_OF_GNE = 10  # in the first line of one with one bus
_IN_A_LINE = 10  # most values of a kind in one line of a GNE


def elements(section: str, records: Sequence[Record]) -> Iterator[Sequence[Record]]:
    """Yield the lines of each element of a section; the last one may lack some of its own."""
    start = 0
    while start < len(records):
        count = _lines_of(section, records[start])
        yield records[start : start + count]
        start += count


def _lines_of(section: str, record: Record) -> int:
    """Return the number of lines of the element that begins with a record."""
    if section in ("two-terminal dc", "vsc dc line"):
        return 3
    if section == "transformer":
        return 5 if record.whole(2, "K", 0) else 4
    if section == "multi-terminal dc":
        counts = (record.text(k) for k in (1, 2, 3))
        return 1 + sum(int(text) for text in counts if text.isdigit())
    if section == "gne" and record.text(2).isdigit():
        first = first_of_gne(record)
        counts = (record.text(first + k) for k in range(3))
        return 1 + sum(-(-int(text) // _IN_A_LINE) for text in counts if text.isdigit())
    return 1


def first_of_gne(record: Record) -> int:
    """Return the column of NREAL of a GNE, behind its buses; with one bus, some programs write a second one of 0."""
    terminals = record.whole(2, "NTERM")
    has_second = terminals == 1 and len(record.fields) > _FIELDS_OF_GNE
    return 3 + terminals + has_second


_WITHOUT_EFFECT = {
    "area",
    "zone",
    "owner",
    "inter-area transfer",
    "multi-section line",
    "impedance correction",
    "system-wide",
    "substation",
    "voltage droop control",
    "switching device rating set",
    "load type",
    "interface",
    "interface element",
}
_KNOWN = {
    "bus",
    "load",
    "fixed shunt",
    "generator",
    "branch",
    "system switching device",
    "transformer",
    "switched shunt",
    ADJUSTMENTS,
}


def leave_out(raw: RawFile, allowed: Sequence[str], changes: Changes) -> None:
    """Note the devices that the user leaves out.

    Raises an `InputError` for sections that are not known, until the user leaves them out, and for a wish that means
    nothing."""
    unknown = [kind for kind in allowed if kind not in (*LEFT_OUT, *raw.sections)]
    if unknown:
        raise InputError(f"leave_out: {unknown[0]!r} is unknown; choose from {', '.join(LEFT_OUT)}")
    refused = []
    for section, records in raw.sections.items():
        if section in _WITHOUT_EFFECT | _KNOWN or not records:
            continue
        lines = [element[0].line for element in elements(section, records)]
        if section in allowed:
            for line in lines:
                changes.note(line, f"{section}: left out, as leave_out says")
        elif section not in LEFT_OUT:
            refused.append(f"{section} (line {', '.join(map(str, lines))})")
    if refused:
        raise InputError.at(
            raw.place,
            f"the network has no such elements: {'; '.join(refused)}; to go on without "
            f"them, write {without_kinds([text.split(' (line')[0] for text in refused])}, "
            "and put what they feed or draw into loads",
        )

"""Records of a PSS/E power flow data file (RAW), by section.

Elements that our network does not have are refused without the user's word, and listed with it."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.cases.source_changes import Changes
from orchestrator.errors import InputError
from orchestrator.foreign_files import read_bytes, visible
from orchestrator.units import LARGEST

REVISIONS = (33, 34, 35, 36)  # revisions whose records are known
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
_ORDER: dict[int, tuple[str, ...]] = {33: (*_HEAD, "transformer", *_TAIL)}
_ORDER[34] = ("system-wide", *_HEAD, "system switching device", "transformer", *_TAIL, "substation")
_ORDER[35] = _ORDER[34]

_ALIASES = {
    "two-terminal dc line": "two-terminal dc",
    "vsc dc": "vsc dc line",
    "facts": "facts device",
    "multi-terminal dc line": "multi-terminal dc",
    "facts control device": "facts device",
    "gne device": "gne",
    "multi-section line group": "multi-section line",
    "transformer impedance correction": "impedance correction",
    "interarea transfer": "inter-area transfer",
    "inter-area": "inter-area transfer",
    "switching device": "system switching device",
}
_TOKEN = re.compile(r"""'([^']*)'?|"([^"]*)"?|(,)|(/)|([^\s,'"/]+)""")
_BEGIN = re.compile(r"BEGIN\s+(.*?)\s+DATA", re.IGNORECASE)
_END = re.compile(r"END OF\s+(.*?)\s+DATA", re.IGNORECASE)
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
        return InputError(f"{self.place}, line {self.line}: {text}")


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

    def of(self, section: str) -> list[Record]:
        return self.sections.get(section, [])


def read_records(path: Path) -> RawFile:
    lines = _numbered(text_of(path))
    first = next(lines, None)
    if first is None:
        raise InputError(f"{path}: it is empty; export the case from PSS/E as RAW")
    head = Record(str(path), first[0], _fields(first[1]))
    if len(head.fields) < 3:
        raise head.error(
            "the first record has no revision; a RAW file begins with IC, SBASE, REV, XFRRAT, NXFRAT, BASFRQ"
        )
    revision = head.whole(2, "the revision REV", 0)
    if revision not in REVISIONS:
        known = ", ".join(map(str, REVISIONS))
        raise head.error(
            f"the revision REV is {revision}; {known} are read: export the case from PSS/E as one of them"
        )
    if head.whole(0, "IC", 0) != 0:
        raise head.error(
            f"IC is {head.text(0)}: the file changes another case; export the whole case (IC = 0)"
        )
    base = head.number(1, "the system base SBASE [MVA]", 100.0)
    if not base > 0:
        raise head.error(f"the system base SBASE is {base:g} MVA; it must exceed 0")
    frequency = head.number(5, "the frequency BASFRQ [Hz]", 0.0)
    for _ in range(2):  # two lines of titles
        next(lines, None)
    return RawFile(str(path), revision, base, frequency or None, *_sections(path, revision, lines))


def text_of(path: Path) -> str:
    """The text of a file of PSS/E, if it is one."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give the path of a PSS/E RAW file")
    if (size := path.stat().st_size) > MOST_BYTES:
        raise InputError(f"{path}: it has {size} bytes; at most {MOST_BYTES} are read")
    content = read_bytes(path, MOST_BYTES)
    if b"\x00" in content[:4096]:
        raise InputError(
            f"{path}: it is no text, perhaps a saved case (.sav); export it from PSS/E as RAW"
        )
    return visible(content.decode("utf-8-sig", errors="replace"))


def _numbered(text: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, without those that only comment."""
    yield from (
        (n, line) for n, line in enumerate(text.splitlines(), start=1) if not line.startswith("@!")
    )


def _sections(
    path: Path, revision: int, lines: Iterator[tuple[int, str]]
) -> tuple[dict[str, list[Record]], dict[int, str]]:
    """Records by section, and the sections that only the order gives although other lines say theirs."""
    sections: dict[str, list[Record]] = {}
    guessed: dict[int, str] = {}
    named = False
    order = list(_ORDER.get(revision, ()))
    name = "bus" if revision == 33 else "system-wide"
    for number, line in lines:
        stripped = line.strip()
        if not stripped:
            continue
        if stripped.upper() == "Q":
            return sections, guessed if named else {}
        if re.match(r"0\s*(/|$)", stripped):
            named = named or bool(_BEGIN.search(stripped) and name != "system-wide")
            name = _following(path, number, stripped, name, order)
            if not (_BEGIN.search(stripped) or _END.search(stripped)) and name != "end":
                guessed[number] = name
        elif name == "end":
            raise InputError(
                f"{path}, line {number}: the line before these data does not say which begin {_REMEDY}"
            )
        else:
            sections.setdefault(name, []).append(Record(str(path), number, _fields(line)))
    if not {"bus", "branch"} <= {*sections} or name in _HEAD:
        raise InputError(f"{path}: it ends within its {name} data; export the case once more")
    return sections, guessed if named else {}


def _following(path: Path, number: int, line: str, name: str, order: list[str]) -> str:
    """The section that begins: the one that the line names, or else the next in the revision's order."""
    ended = _known_as(found[1]) if (found := _END.search(line)) else ""
    if ended in order and name in order and ended != name:
        raise InputError(
            f"{path}, line {number}: it ends the {ended} data, and what stands before it are {name} data by the lines "
            "between sections; one of these is missing or wrong: export the case once more"
        )
    if found := _BEGIN.search(line):
        return _known_as(found[1])
    if name not in order:
        if ended:
            return "end"
        raise InputError(f"{path}, line {number}: the line does not say which data begin {_REMEDY}")
    following = order.index(name) + 1
    return order[following] if following < len(order) else "end"


def _known_as(text: str) -> str:
    name = " ".join(text.lower().split())
    return _ALIASES.get(name, name)


def _fields(line: str) -> list[str]:
    """Fields of a record, separated by commas or blanks; what stands behind a slash is a comment."""
    fields, empty = list[str](), True  # empty: nothing since the last comma
    for token in _TOKEN.finditer(line):
        quoted, other, comma, slash, plain = token.groups()
        if slash:
            break
        if comma:
            fields += [""] if empty else []
        else:
            fields.append((quoted or other or plain or "").strip())
        empty = bool(comma)
    return fields


# lines of a record
_LINES = {"two-terminal dc": 3, "vsc dc line": 3, "facts device": 1, "induction machine": 1}
LEFT_OUT = (*_LINES, "multi-terminal dc", "gne")
"""Elements that our network does not have; `leave_out` of the case names those that may go."""

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
}


def leave_out(raw: RawFile, allowed: Sequence[str], changes: Changes) -> None:
    """Note the elements that our network does not have."""
    if unknown := [kind for kind in allowed if kind not in LEFT_OUT]:
        raise InputError(f"leave_out: {unknown[0]!r} is unknown; choose from {', '.join(LEFT_OUT)}")
    refused = []
    for section, records in raw.sections.items():
        if section in _WITHOUT_EFFECT | _KNOWN or not records:
            continue
        step = _LINES.get(section, len(records))
        lines = [record.line for record in records[::step]]
        if section in allowed:
            for line in lines:
                changes.note(line, f"{section}: left out, as leave_out says")
        else:
            refused.append(f"{section} (line {', '.join(map(str, lines))})")
    if refused:
        raise InputError(
            f"{raw.place}: the network has no such elements: {'; '.join(refused)}; to go on without them, write "
            f"leave_out = [{', '.join(repr(text.split(' (line')[0]) for text in refused)}] in [network], and put what "
            "they feed or draw into loads"
        )

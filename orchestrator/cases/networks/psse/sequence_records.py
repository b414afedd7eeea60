"""Records of a PSS/E sequence data file (SEQ), by section.

Sources of the columns and codes: the readers of GridPACK (``PSSE_seq_parser``), of InterPSS' data model
(``PSSEXfrZeroSeqDataMapper``), of STEPS and of psse34parser, and the headings that PSS/E Xplore 35.4 writes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from orchestrator.cases.networks.psse.raw_records import (
    BEGIN_OF_SECTION,
    END_OF_SECTION,
    Record,
    fields_of,
    numbered_lines,
    text_of,
)
from orchestrator.core.errors import InputError

_MEANINGS: tuple[tuple[tuple[str, ...], str], ...] = (
    (("conventional",), "non-conventional source"),
    (("mutual",), "mutual"),
    (("switched",), "switched shunt"),
    (("fixed",), "fixed shunt"),
    (("induction",), "induction machine"),
    (("non", "transformer"), "branch"),
    (("nontransformer",), "branch"),
    (("branch",), "branch"),
    (("transformer",), "transformer"),
    (("negative", "generator"), "negative machine"),
    (("negative", "machine"), "negative machine"),
    (("zero", "generator"), "zero machine"),
    (("zero", "machine"), "zero machine"),
    (("negative", "load"), "negative load"),
    (("negative", "shunt"), "negative load"),
    (("zero", "load"), "zero load"),
    (("zero", "shunt"), "zero load"),
    (("load",), "load"),
    (("generator",), "machine"),
    (("machine",), "machine"),
)
"""Words of which all stand in a title → section; the more telling first."""

_SHORT = {"neg": "negative"}  # words that titles cut short
_OLD_ORDER = (
    *("positive machine", "negative machine", "zero machine", "negative load", "zero load"),
    *("branch", "mutual", "transformer", "switched shunt", "fixed shunt"),
)
_ORDER = (
    *("machine", "load", "branch", "mutual", "transformer", "switched shunt", "fixed shunt"),
    *("induction machine", "non-conventional source"),
)
_SYSTEM_WIDE = 35  # first revision that begins with system-wide data
_OLD_MACHINE = 4  # columns of a machine where each sequence is a section of its own
_TELLS = re.compile(r"[A-Za-z]")  # a line of system-wide data begins with a word


@dataclass(frozen=True)
class SequenceFile:
    """A file's name, revision and records by section."""

    place: str
    revision: int
    sections: dict[str, list[Record]] = field(default_factory=dict)

    def of(self, section: str) -> list[Record]:
        return self.sections.get(section, [])


def read_sequence_file(path: Path) -> SequenceFile:
    """Read a file.

    Raises an `InputError` with file and line for what is no sequence data."""
    state = path.stat() if path.is_file() else None
    if state is None:
        raise InputError.at(f"{path}", "there is no such file; give the path of a PSS/E SEQ file")
    return _read(path, (state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=2)
def _read(path: Path, version: tuple[int, int]) -> SequenceFile:
    lines = numbered_lines(text_of(path))
    first = next(lines, None)
    if first is None or not fields_of(first[1]):
        raise InputError.at(
            f"{path}", "it is empty; export the case's sequence data from PSS/E as SEQ"
        )
    head = Record(str(path), first[0], fields_of(first[1]))
    change, revision = head.whole(0, "IC", 0), head.whole(1, "the revision REV", 0)
    if change not in (0, 1):
        raise head.error(
            f"IC is {head.text(0)}: sequence data begin with IC and REV; is it another file of PSS/E?"
        )
    return SequenceFile(str(path), revision, _sections(path, revision, list(lines)))


def _sections(
    path: Path, revision: int, lines: Sequence[tuple[int, str]]
) -> dict[str, list[Record]]:
    sections: dict[str, list[Record]] = {}
    name = _first_section(revision, lines)
    for number, line in lines:
        stripped = line.strip()
        if not stripped:
            continue
        if stripped.upper() == "Q" or name == "end":
            break
        if END_OF_SECTION.match(stripped):
            name = _following(path, number, stripped, name)
        elif name != "system-wide":
            sections.setdefault(name, []).append(Record(str(path), number, fields_of(line)))
    return sections


def _first_section(revision: int, lines: Sequence[tuple[int, str]]) -> str:
    """Return the section that begins behind the first line, by the revision and by the columns of the first record."""
    if revision >= _SYSTEM_WIDE or (lines and _TELLS.match(lines[0][1].strip())):
        return "system-wide"
    begins = [BEGIN_OF_SECTION.search(line) for _, line in lines]
    titles = [section_of(found[1]) for found in begins if found]
    if "negative machine" in titles:
        return _OLD_ORDER[0]
    if titles:
        return _ORDER[0]
    return _OLD_ORDER[0] if len(fields_of(lines[0][1])) <= _OLD_MACHINE else _ORDER[0]


def _following(path: Path, number: int, line: str, name: str) -> str:
    """Return the section that begins: the one that a line names, or else the next in order."""
    found = BEGIN_OF_SECTION.search(line)
    if found:
        section = section_of(found[1])
        if not section:
            raise InputError.at(
                f"{path}, line {number}",
                f"{found[1]!r} is no section of sequence data; is it another file of PSS/E?",
            )
        return section
    if name == "system-wide":
        return _ORDER[0]
    order = _OLD_ORDER if name in _OLD_ORDER[:-5] else _ORDER
    following = order.index(name) + 1 if name in order else len(order)
    return order[following] if following < len(order) else "end"


def section_of(title: str) -> str:
    """Return the section that a title means; "" if it means none that is known."""
    words = re.findall(r"[a-z]+", title.lower())
    singular = {*words, *(word.removesuffix("s") for word in words)}
    singular |= {_SHORT[word] for word in words if word in _SHORT}
    return next((section for wanted, section in _MEANINGS if singular.issuperset(wanted)), "")

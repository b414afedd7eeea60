"""Parts of a code: rows with a stimulus and criteria, sources, and what is left out by name."""

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.studies.certification.codes.measured import MeasuredRow
from orchestrator.studies.certification.codes.programme import BenchProgramme


@dataclass(frozen=True, slots=True)
class Declaration:
    # name, meaning, unit: as ``--declare`` takes it, and what it is.
    name: str
    meaning: str
    unit: str
    # least, most: range in which a value makes sense, in its unit.
    least: float
    most: float


def checked(
    wanted: Sequence[Declaration], given: Mapping[str, object], code: str
) -> dict[str, float]:
    names = [declaration.name for declaration in wanted]
    unknown = [name for name in given if name not in names]
    if unknown:
        takes = f"it takes {', '.join(names)}" if names else "it takes none; leave it out"
        raise InputError(
            Option.DECLARE
            + f" {unknown[0]}: "
            + Option.CODE
            + f" {code} knows no such value; {takes}"
        )
    missing = [d for d in wanted if d.name not in given]
    if missing:
        said = "; ".join(f"{d.name} ({d.meaning}) [{d.unit}]" for d in missing)
        example = " ".join((Option.DECLARE + f" {d.name}=…") for d in missing)
        raise InputError(
            Option.CODE
            + f" {code} compares the converter with what is declared of it; missing: {said}"
            f". Add {example}"
        )
    values = {}
    for declaration in wanted:
        value = given[declaration.name]
        number = (
            value
            if isinstance(value, int | float) and not isinstance(value, bool)
            else float("nan")
        )
        if not declaration.least <= number <= declaration.most:
            raise InputError(
                Option.DECLARE
                + f" {declaration.name}={value}: the {declaration.meaning} is a number from "
                f"{declaration.least:g} to {declaration.most:g} [{declaration.unit}]; give it "
                "so"
            )
        values[declaration.name] = float(number)
    return values


@dataclass(frozen=True, slots=True)
class RowFinding:
    """A criterion applied to a response.

    ``origin``: ``code`` where the number is the code's, ``reading`` where the code gives none and this program's is
    taken; ``value``, ``limit``: what was measured and what it is compared with; None where there is no such number;
    ``margin``: how far the value is on the good side of the limit, in parts of the limit (negative: on the bad side);
    ``unit``: of value and limit; "" where they count something.
    """

    criterion: str
    rule: str
    origin: str
    value: float | None
    limit: float | None
    margin: float | None
    accepted: bool | None
    text: str
    unit: str = ""

    @property
    def recorded(self) -> dict[str, Any]:
        """The entry of a certificate's record, without the unit: those of earlier versions would not come out anew."""
        return {key: value for key, value in asdict(self).items() if key != "unit"}


# A criterion: the response of a row → whether it is met
Judge = Callable[[MeasuredRow], RowFinding]


@dataclass(frozen=True)
class Band:
    """Where a criterion asks a quantity to stay, for a picture.

    ``label``: the quantity, with its unit; ``quantity``: the response of a row → the quantity over its times, shape
    (n,); ``times``: at which the limits hold [s], shape (m,); ``low``, ``high``: limits in the quantity's unit, shape
    (m,); None where there is none; ``alone``: whether it gets a picture of its own, which shows its times alone."""

    criterion: str
    label: str
    quantity: Callable[[MeasuredRow], Numbers]
    times: Numbers
    low: Numbers | None = None
    high: Numbers | None = None
    alone: bool = False


@dataclass(frozen=True)
class Bounded:
    """A criterion whose limits can be drawn."""

    judge: Judge
    bands: Callable[[MeasuredRow], Sequence[Band]]

    def __call__(self, row: MeasuredRow) -> RowFinding:
        return self.judge(row)


@dataclass(frozen=True)
class Row:
    """One row of a code's table.

    ``shown_only``: whether the code gives no verdict on it; ``since``: the version of this program whose table has it
    first, of a row that was added to a code that had been released."""

    name: str
    title: str
    clause: str
    shown_only: bool = field(default=False, kw_only=True)
    since: str = field(default="", kw_only=True)


@dataclass(frozen=True)
class CodeRow(Row):
    """A row on the test bench: a stimulus, and what is asked of the response.

    ``name``: short, for files: letters, digits and underscores; ``programme``: what the bench does, for a rated
    frequency [Hz]."""

    programme: Callable[[float], BenchProgramme]
    criteria: tuple[Judge, ...]


AnyRow = TypeVar("AnyRow", bound=Row)

_FILE = "words.toml"
_WORDS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name(_FILE).read_text(encoding="utf-8")
)
_TEXT, _TEXTS = (str, "a text"), (list, "a list of texts")
_KINDS: dict[str, tuple[Any, str]] = {
    "title": _TEXT,
    "source": _TEXT,
    "date": _TEXT,
    "where": _TEXT,
    "f_n": (float, "the rated frequency [Hz], as 50.0"),
    "left_out": _TEXTS,
    "readings": _TEXTS,
}


def in_words(key: str) -> str:
    """A code with where it applies, as help names it; its key alone where its words are not as they should be."""
    where, f_n = (_WORDS.get(key, {}).get(name) for name in ("where", "f_n"))
    return f"{key} ({where}, {f_n:g} Hz)" if where and isinstance(f_n, float) else key


def like(text: str, keys: Iterable[str]) -> list[str]:
    """Codes that may be meant: by another spelling of the key, or a part of the place or of the title."""
    known, wanted = list(keys), _plain(text)
    near = [key for key in known if wanted and (wanted in key or key in wanted)]
    for name in ("where", "title") if len(wanted) > 3 else ():
        near = near or [
            key for key in known if wanted in _plain(str(_WORDS.get(key, {}).get(name)))
        ]
    return near or get_close_matches(wanted, known, 3)


def _plain(text: str) -> str:
    return re.sub(r"\W|_", "", text.lower())


def _fault_of_words(key: str, place: str) -> str:
    words = _WORDS.get(key)
    if words is None:
        return f"{_FILE} has no section [{key}]; a code has its words there: {', '.join(_KINDS)}"
    strange = [name for name in words if name not in _KINDS]
    if strange:
        return f"{place}: {strange[0]!r} is no word of a code; its words are {', '.join(_KINDS)}"
    for name, (kind, rule) in _KINDS.items():
        if not isinstance(words.get(name), kind):
            return f"{place}: {name} {f'= {words[name]!r}' if name in words else 'is missing'}; give {rule}"
    return ""


def _fault_of_rows(key: str, rows: Sequence[Row]) -> str:
    names = [row.name for row in rows]
    if not rows:
        return f"code {key!r} has no row; give it one at least"
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        return (
            f"code {key!r}: two rows are named {twice[0]!r}, and would be judged as one; rename one"
        )
    for row in (row for row in rows if isinstance(row, CodeRow)):
        if not re.fullmatch(r"\w+", row.name, re.ASCII):
            return f"code {key!r}, row {row.name!r}: a file is named so; take letters, digits and _"
        if not row.criteria:
            return f"code {key!r}, row {row.name!r} asks for nothing; give it a criterion"
    return ""


@dataclass(frozen=True)
class GridCode(Generic[AnyRow]):
    """A code as a table; its words stand in ``words.toml``.

    ``title``, ``source``, ``date``: what it is, where its numbers were read, and of when it is; ``where`` it applies;
    ``f_n``: rated frequency of the system [Hz]; ``left_out``: what the code asks and this table does not test, with
    the reason; ``readings``: where the code leaves something open, how it was read; ``declared``: what the applicant
    declares of the converter, where the rows depend on it; ``fault``: why it cannot be used."""

    key: str
    rows: tuple[AnyRow, ...]
    title: str = ""
    source: str = ""
    date: str = ""
    where: str = ""
    f_n: float = 50.0
    left_out: tuple[str, ...] = ()
    readings: tuple[str, ...] = ()
    declared: Mapping[str, float] = field(default_factory=dict)
    fault: str = ""

    @classmethod
    def of(
        cls,
        key: str,
        rows: tuple[AnyRow, ...],
        declared: Mapping[str, float] = MappingProxyType({}),
        words: Mapping[str, Any] | None = None,
    ) -> "GridCode[AnyRow]":
        """A code with its words.

        ``words``: those of a code that another distribution brings, as a section of ``words.toml`` has them."""
        place = f"{_FILE}, [{key}]"
        if words is not None:
            place = f"the words of code {key!r}"
            _WORDS[key] = dict(words)
        fault = _fault_of_words(key, place) or _fault_of_rows(key, rows)
        if fault:
            return cls(key, rows, fault=fault)
        texts: dict[str, Any] = {
            n: tuple(text) if isinstance(text, list) else text for n, text in _WORDS[key].items()
        }
        return cls(key, rows, declared=dict(declared), **texts)

    def later(self, version: str) -> tuple[str, ...]:
        """Rows that the table of that version of this program had not."""
        return tuple(
            row.name for row in self.rows if version and _number(row.since) > _number(version)
        )

    def of_version(self, version: str) -> "GridCode[AnyRow]":
        later = self.later(version)
        return replace(self, rows=tuple(row for row in self.rows if row.name not in later))


@dataclass(frozen=True)
class DeclaredCode:
    """A code whose rows depend on what the applicant declares of the converter.

    ``declared``: what that is; ``make``: the code for declared values by name."""

    key: str
    declared: Sequence[Declaration]
    make: Callable[[Mapping[str, float]], GridCode[CodeRow]]


def _number(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version)[:3])

"""What a code is: rows with a stimulus and criteria, sources, and what is left out by name."""

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from orchestrator.arrays import Numbers
from orchestrator.certification.codes.measured import MeasuredRow
from orchestrator.certification.codes.programme import BenchProgramme
from orchestrator.errors import InputError


@dataclass(frozen=True, slots=True)
class Declaration:
    # name, meaning, unit: as ``--declare`` takes it, and what it is.
    name: str
    meaning: str
    unit: str
    # least, most: range in which a value makes sense, in its unit.
    least: float
    most: float


def checked(wanted: Sequence[Declaration], given: Mapping[str, object], code: str) -> dict[str, float]:
    names = [declaration.name for declaration in wanted]
    if unknown := [name for name in given if name not in names]:
        takes = f"it takes {', '.join(names)}" if names else "it takes none; leave it out"
        raise InputError(f"--declare {unknown[0]}: --code {code} knows no such value; {takes}")
    if missing := [d for d in wanted if d.name not in given]:
        said = "; ".join(f"{d.name} ({d.meaning}) [{d.unit}]" for d in missing)
        example = " ".join(f"--declare {d.name}=…" for d in missing)
        raise InputError(f"--code {code} compares the converter with what is declared of it; missing: {said}. "
                         f"Add {example}")  # fmt: skip
    values = {}
    for declaration in wanted:
        value = given[declaration.name]
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not (math.isfinite(value) and declaration.least <= value <= declaration.most)
        ):
            raise InputError(
                f"--declare {declaration.name}={value}: the {declaration.meaning} is a number from "
                f"{declaration.least:g} to {declaration.most:g} [{declaration.unit}]; give it so"
            )
        values[declaration.name] = float(value)
    return values


@dataclass(frozen=True, slots=True)
class RowFinding:
    """A criterion applied to a response.

    ``origin``: ``code`` where the number is the code's, ``reading`` where the code gives none and this program's is
    taken; ``value``, ``limit``: what was measured and what it is compared with; None where there is no such number;
    ``margin``: how far the value is on the good side of the limit, in parts of the limit (negative: on the bad side).
    """

    criterion: str
    rule: str
    origin: str
    value: float | None
    limit: float | None
    margin: float | None
    accepted: bool | None
    text: str


Judge = Callable[[MeasuredRow], RowFinding]  # A criterion: the response of a row → whether it is met


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
    """One row of a code's table. ``shown_only``: whether the code gives no verdict on it."""

    name: str
    title: str
    clause: str
    shown_only: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class CodeRow(Row):
    """A row on the test bench: a stimulus, and what is asked of the response.

    ``name``: short, for files: letters, digits and underscores; ``programme``: what the bench does, for a rated
    frequency [Hz]."""

    programme: Callable[[float], BenchProgramme]
    criteria: tuple[Judge, ...]


AnyRow = TypeVar("AnyRow", bound=Row)

_WORDS = tomllib.loads(Path(__file__).with_name("codes.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class GridCode(Generic[AnyRow]):
    """A code as a table; its words stand in ``codes.toml``.

    ``title``, ``source``, ``date``: what it is, where its numbers were read, and of when it is; ``f_n``: rated
    frequency of the system [Hz]; ``left_out``: what the code asks and this table does not test, with the reason;
    ``readings``: where the code leaves something open, how it was read; ``declared``: what the applicant declares of
    the converter, where the rows depend on it."""

    key: str
    title: str
    source: str
    date: str
    f_n: float
    rows: tuple[AnyRow, ...]
    left_out: tuple[str, ...] = ()
    readings: tuple[str, ...] = ()
    declared: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls, key: str, rows: tuple[AnyRow, ...], declared: Mapping[str, float] = MappingProxyType({})
    ) -> "GridCode[AnyRow]":
        texts: dict[str, Any] = {
            name: tuple(text) if isinstance(text, list) else text for name, text in _WORDS[key].items()
        }
        if len({row.name for row in rows}) < len(rows):
            raise ValueError(f"code {key!r}: two rows have one name, and one response would be judged as both")
        return cls(key, rows=rows, declared=dict(declared), **texts)

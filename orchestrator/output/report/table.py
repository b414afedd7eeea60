"""A table whose columns are stated once: terminals, pages, CSV files and DataFrames are renderers of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, Generic, TypeVar

from rich.text import Text

from orchestrator.core.late import pd
from orchestrator.output.report.html.elements import table as table_of_page
from orchestrator.output.report.tables import PlainTable, eigenvalue_text, make_table
from orchestrator.output.results.storage import save_table

Row = TypeVar("Row")

_DATE = r"\d{4}-\d\d-\d\d( \d\d:\d\d:\d\d)?"
_MINUS = re.compile(r"^-(?=\d)")
_ON_TERMINALS = {"good": "bold green", "bad": "bold red", "soft": "bold yellow"}
LEAST_DAMPING = 5.0  # [%]; less is marked


@dataclass(frozen=True)
class Marked:
    """A cell's text that is ``good``, ``bad`` or ``soft``: not known."""

    text: str
    mark: str


@dataclass(frozen=True)
class Column(Generic[Row]):
    heading: str  # on terminals and pages; "" for what only files and programs have
    get: Callable[[Row], Any]
    write: str | Callable[[Any], str | Marked] = ""  # how a cell shows it: a format, or a function
    name: str = ""  # in files and DataFrames; "" for what is only shown
    text: bool = False  # whether it holds text, though it stands behind figures

    def cell(self, row: Row) -> str | Marked:
        value = self.get(row)
        if callable(self.write):
            return self.write(value)
        return "–" if value is None else f"{value:{self.write}}"


@dataclass(frozen=True)
class ColumnTable(Generic[Row]):
    title: str
    columns: Sequence[Column[Row]]
    rows: Sequence[Row]
    left: int = 1  # how many columns at the left hold text
    most: int | None = None  # rows that are shown; the others are counted
    file: str = "the files"  # where all of them stand

    @property
    def shown_columns(self) -> list[Column[Row]]:
        return [column for column in self.columns if column.heading]

    def __rich__(self) -> PlainTable:
        rows = [
            [column.cell(row) for column in self.shown_columns] for row in self.rows[: self.most]
        ]
        cells = [
            [c if isinstance(c, str) else Text(c.text, _ON_TERMINALS[c.mark]) for c in row]
            for row in rows
        ]
        table = make_table(
            self.title,
            *(column.heading for column in self.shown_columns),
            left=self.left,
            rows=cells,
        )
        table.caption = self._rest or None
        for column, shown in zip(self.shown_columns, table.columns, strict=True):
            shown.justify = "left" if column.text else shown.justify
        return table

    def html(self) -> str:
        cells = [
            [_on_page(column.cell(row)) for column in self.shown_columns]
            for row in self.rows[: self.most]
        ]
        text = table_of_page(
            self.title, [column.heading for column in self.shown_columns], cells, self.left
        )
        return f"{text}<p>{escape(self._rest)}</p>" if self._rest else text

    @property
    def _rest(self) -> str:
        rest = 0 if self.most is None else len(self.rows) - self.most
        return f"{rest} more in {self.file}" if rest > 0 else ""

    def records(self) -> list[dict[str, Any]]:
        return [
            {column.name: column.get(row) for column in self.columns if column.name}
            for row in self.rows
        ]

    def frame(self) -> pd.DataFrame:
        """Whole numbers and times as names of points are such again, as tables of points have them."""
        found = pd.DataFrame(
            self.records(), columns=[column.name for column in self.columns if column.name]
        )
        names = found.get("point")
        if names is None or not len(names):
            return found
        if names.str.fullmatch(r"0|-?[1-9]\d{0,17}").all():
            return found.assign(point=names.astype("int64"))
        times = pd.to_datetime(names.where(names.str.fullmatch(_DATE)), errors="coerce")
        return found.assign(point=times) if times.notna().all() else found

    def save(self, path: Path) -> None:
        """Write a CSV file; truth values are in lower case, as in JSON."""
        plain = [
            {k: str(v).lower() if isinstance(v, bool) else v for k, v in row.items()}
            for row in self.records()
        ]
        save_table(plain, path, [column.name for column in self.columns if column.name])


def _on_page(cell: str | Marked) -> str:
    if isinstance(cell, Marked):
        return f'<span class="{cell.mark}">{_on_page(cell.text)}</span>'
    return _MINUS.sub("−", escape(cell)).replace("\n", "<br>")


def damping(percent: float | None) -> str | Marked:
    text = "–" if percent is None else f"{percent:.2f}"
    return Marked(text, "bad") if percent is not None and percent < LEAST_DAMPING else text


def verdict(stable: bool | None) -> str | Marked:
    words: dict[bool | None, str | Marked] = {
        True: "stable",
        False: Marked("UNSTABLE", "bad"),
        None: "not known",
    }
    return words[stable]


def mode_columns(mode_of: Callable[[Row], Any]) -> list[Column[Row]]:
    return [
        Column("Mode [rad/s]", lambda row: mode_of(row).eigenvalue, eigenvalue_text),
        Column("", lambda row: mode_of(row).eigenvalue.real, name="real"),
        Column("", lambda row: mode_of(row).eigenvalue.imag, name="imag"),
        Column("f [Hz]", lambda row: mode_of(row).frequency_hz, ".4f", name="frequency_hz"),
        Column(
            "Damping [%]", lambda row: mode_of(row).damping_percent, damping, name="damping_percent"
        ),
    ]

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
from orchestrator.output.report.colours import OF_MARKS
from orchestrator.output.report.html.elements import table as table_of_page
from orchestrator.output.report.terminal_tables import PlainTable, make_table
from orchestrator.output.results.file_writers import save_table

Row = TypeVar("Row")

_DATE = r"\d{4}-\d\d-\d\d( \d\d:\d\d:\d\d)?"
_MINUS = re.compile(r"^-(?=\d)")


@dataclass(frozen=True)
class Marked:
    """A cell's text that is ``good``, ``bad`` or ``soft``: not known."""

    text: str
    mark: str


ShownCell = str | Marked


@dataclass(frozen=True)
class ShownTable:
    """Headings and cells that a terminal and a page show; the columns behind the ``left`` first ones hold figures."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[ShownCell]]
    left: int = 1
    note: str = ""  # a sentence below it
    # the part of the table that each row is in: a line divides parts on a terminal
    parts: Sequence[Any] = ()
    stand_out: Sequence[bool] = ()  # whether each row is bold on a terminal
    texts: Sequence[bool] = ()  # whether each column holds text, though it stands behind figures

    def __rich__(self) -> PlainTable:
        table = make_table(self.title, *self.headings, left=self.left)
        for k, row in enumerate(self.rows):
            cells = [c if isinstance(c, str) else Text(c.text, OF_MARKS[c.mark]) for c in row]
            style = "bold" if any(self.stand_out[k : k + 1]) else None
            ends = len(set(self.parts[k : k + 2])) > 1
            table.add_row(*cells, style=style, end_section=ends)
        table.caption = self.note or None
        table.caption_justify = "left"
        for is_text, shown in zip(self.texts, table.columns, strict=False):
            shown.justify = "left" if is_text else shown.justify
        return table

    def html(self) -> str:
        cells = [[_on_page(cell) for cell in row] for row in self.rows]
        text = table_of_page(self.title, self.headings, cells, self.left, self.texts)
        return f"{text}<p>{escape(self.note)}</p>" if self.note else text


@dataclass(frozen=True)
class Column(Generic[Row]):
    heading: str  # on terminals and pages; "" for what only files and programs have
    get: Callable[[Row], Any]
    write: str | Callable[[Any], str | Marked] = ""  # how a cell shows it: a format, or a function
    name: str = ""  # in files and DataFrames; "" for what is only shown
    text: bool = False  # whether it holds text, though it stands behind figures
    # its heading in CSV files where that is not the name; "" for what they do not have
    file: str | None = None
    stored: str = ""  # the format of a figure in CSV files; "" for all its digits

    @property
    def file_heading(self) -> str:
        """The heading in CSV files, "" where they do not have the column."""
        return self.name if self.file is None else self.file

    def cell(self, row: Row) -> str | Marked:
        value = self.get(row)
        if callable(self.write):
            return self.write(value)
        return "–" if value is None else f"{value:{self.write}}"

    def stored_value(self, row: Row) -> Any:
        """The value as CSV files have it; truth values are in lower case, as in JSON."""
        value = self.get(row)
        if isinstance(value, bool):
            return str(value).lower()
        return format(value, self.stored) if self.stored else value


@dataclass(frozen=True)
class ColumnTable(Generic[Row]):
    title: str
    columns: Sequence[Column[Row]]
    rows: Sequence[Row]
    left: int = 1  # how many columns at the left hold text
    most: int | None = None  # rows that are shown; the others are counted
    file: str = "the files"  # where all of them stand
    note: str = ""  # a sentence below it, in the place of how many rows are left out
    stands_out: Callable[[Row], bool] = lambda row: False
    # names the part of the table that a row is in; a line divides parts on a terminal
    part: Callable[[Row], Any] = lambda row: None

    @property
    def shown_columns(self) -> list[Column[Row]]:
        return [column for column in self.columns if column.heading]

    def __rich__(self) -> PlainTable:
        table = self._table.__rich__()
        table.caption_justify = "left" if self.note else "center"
        return table

    def html(self) -> str:
        return self._table.html()

    @property
    def _table(self) -> ShownTable:
        rows, columns = self.rows[: self.most], self.shown_columns
        headings = [column.heading for column in columns]
        cells = [[column.cell(row) for column in columns] for row in rows]
        texts = [column.text for column in columns]
        return ShownTable(
            self.title,
            headings,
            cells,
            left=self.left,
            note=self.note or self._rest,
            parts=[self.part(row) for row in rows],
            stand_out=[self.stands_out(row) for row in rows],
            texts=texts,
        )

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
        """Write a CSV file with all rows."""
        columns = {column.file_heading: column for column in self.columns if column.file_heading}
        rows = [
            {heading: column.stored_value(row) for heading, column in columns.items()}
            for row in self.rows
        ]
        save_table(rows, path, list(columns))


def _on_page(cell: str | Marked) -> str:
    if isinstance(cell, Marked):
        return f'<span class="{cell.mark}">{_on_page(cell.text)}</span>'
    return _MINUS.sub("−", escape(cell)).replace("\n", "<br>")

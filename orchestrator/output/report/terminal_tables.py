"""Tables for a terminal, with rich; `column_table` makes them of columns that all readers share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

from rich.markup import escape
from rich.table import Table
from rich.text import Text

Cell = str | Text  # of a table: text that is shown to the letter, or text with a style


class PlainTable(Table):
    """A table that shows its cells as they are: rich would take "[kV]" of a foreign text for a style.

    Such a word would be left out, and "[/s]" would end the program."""

    def add_row(self, *cells: Any, **options: Any) -> None:
        """Add a row; text in it is shown to the letter."""
        super().add_row(
            *(Text(cell) if isinstance(cell, str) else cell for cell in cells), **options
        )

    def with_texts(self, write: Callable[[str], str]) -> PlainTable:
        """Return the table with every cell and caption written otherwise, as with the names of a network's file."""
        found = copy(self)
        found.columns = [replace(column, _cells=[]) for column in self.columns]
        for column, other in zip(self.columns, found.columns, strict=True):
            cells = [_rewrite(cell, write) for cell in column.cells]
            other._cells.extend(cells)
        if isinstance(self.caption, str):
            found.caption = write(self.caption)
        return found


def _rewrite(cell: Any, write: Callable[[str], str]) -> Any:
    return (
        Text(write(cell.plain), cell.style) if isinstance(cell, Text) and not cell.spans else cell
    )


def make_table(
    title: str, *columns: str, left: int = 1, rows: Iterable[Sequence[Cell]] = ()
) -> PlainTable:
    """A table whose title, headings and cells are shown as they are; columns after the ``left`` first ones are of
    figures."""
    table = PlainTable(
        title=escape(title), title_justify="left", title_style="bold", header_style="bold"
    )
    for index, column in enumerate(columns):
        table.add_column(
            escape(column), justify="left" if index < left else "right", overflow="fold"
        )
    for row in rows:
        table.add_row(*row)
    return table

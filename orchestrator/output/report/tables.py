"""Tables and verdicts for a terminal, with rich, and the table of an FMU's variables."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

from rich.markup import escape
from rich.table import Table
from rich.text import Text

from orchestrator.devices.fmi.values import as_text

if TYPE_CHECKING:
    from orchestrator.devices.fmi.description import FmuDescription, VariableInfo

Told = TypeVar("Told")
# of a verdict that is good, bad or not known
COLOURS = {True: "green", False: "red", None: "yellow"}


@dataclass(frozen=True)
class VerdictSentence:
    """``word: text``, and whether that is good; None if that is not known, or if it is so in part only."""

    good: bool | None
    word: str
    text: str

    def __str__(self) -> str:
        return f"{self.word}: {self.text}"

    def markup(self, subject: str = "") -> str:
        """The sentence for a terminal, its word in colour; ``subject`` says of what it is."""
        of = f" {escape(subject)}:" if subject else ""
        return f"[bold {COLOURS[self.good]}]{self.word}[/]:{of} {escape(self.text)}"


_FIGURE = re.compile(r"[-+]?\b\d[\d.,]*(?:e[-+]?\d+)?")
# variables in a table; rich takes half a millisecond for each
_MOST_IN_A_TABLE = 5000
_ITEMS_SHOWN = 5  # how many of a long list are shown, largest first


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


def first_few(items: Iterable[Any], text: Callable[[Any], str]) -> str:
    items = list(items)
    shown = ", ".join(text(item) for item in items[:_ITEMS_SHOWN])
    return shown + (f" … {len(items)} in all" if len(items) > _ITEMS_SHOWN else "")


def kinds_of(said: Iterable[tuple[Told, Iterable[str]]]) -> list[tuple[str, list[Told]]]:
    """Texts with all that tell them, the most told first; those that differ only in their figures are one."""
    found: dict[str, tuple[str, list[Told]]] = {}
    for teller, texts in said:
        for kind, text in {_FIGURE.sub("#", text): text for text in texts}.items():
            found.setdefault(kind, (text, []))[1].append(teller)
    return sorted(found.values(), key=lambda kind: -len(kind[1]))


def short(text: str, longest: int) -> str:
    """A remark, cut at a word where it has more characters."""
    return text if len(text) <= longest else f"{text[: longest - 1].rsplit(' ', 1)[0]} …"


def share_text(entry: tuple[str, float]) -> str:
    """``sg1 28%``."""
    return f"{entry[0]} {entry[1]:.0%}"


def fmu_variables(description: FmuDescription) -> Iterable[Table | str]:
    """A table for each causality; plain text for one with more than `_MOST_IN_A_TABLE` variables."""
    for causality in ("input", "output", "parameter", "calculatedParameter", "local"):
        variables = [
            v
            for v in description.variables.values()
            if v.causality == causality and not v.name.startswith("der(")
        ]
        if not variables:
            continue
        columns = ("Name", "Unit", "Start", "Range", "Variability", "Description")
        rows = [
            (
                v.name,
                v.unit,
                "" if v.start is None else as_text(v.start),
                _bounds(v),
                v.variability,
                v.description,
            )
            for v in variables
        ]
        title = f"{causality} ({len(variables)})"
        if len(variables) > _MOST_IN_A_TABLE:
            yield _in_columns(title, columns, rows)
        else:
            yield make_table(title, *columns, left=6, rows=rows)


def _in_columns(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Text in columns, on one line for each row."""
    lines = [columns, *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    padded = (map(str.ljust, line, widths) for line in lines)
    return "\n".join([title, *("  ".join(line).rstrip() for line in padded)])


def _bounds(variable: VariableInfo) -> str:
    bounds = ["" if b is None else f"{b:g}" for b in (variable.minimum, variable.maximum)]
    return "…".join(bounds) if any(bounds) else ""

"""Rows of a CSV file, with the place of each, so that an error can name it."""

import csv
from collections.abc import Sequence
from pathlib import Path

from orchestrator.errors import InputError

Row = dict[str, str]
_PLACE = "_place"


def rows_of(path: Path, columns: Sequence[str]) -> list[Row]:
    """All rows of a file that must have some columns.

    Raises
    ------
    InputError
        If the file or one of the columns is missing.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; it should hold the columns {', '.join(columns)}")
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        missing = [c for c in columns if c not in (reader.fieldnames or ())]
        if missing:
            raise InputError(f"{path}: column {', '.join(missing)} is missing; it should hold {', '.join(columns)}")
        return [row | {_PLACE: f"{path}, line {line}"} for line, row in enumerate(reader, start=2)]


def place_of(row: Row) -> str:
    """File and line of a row."""
    return row[_PLACE]


def number(row: Row, column: str) -> float:
    """The number in a column.

    Raises
    ------
    InputError
        If the column holds no number.
    """
    try:
        return float(row[column])
    except (TypeError, ValueError):
        raise InputError(f"{place_of(row)}: {column} = {row[column]!r} is not a number") from None


def optional_number(row: Row, column: str) -> float | None:
    """The number in a column; None where the column or the entry is missing."""
    return number(row, column) if (row.get(column) or "").strip() else None

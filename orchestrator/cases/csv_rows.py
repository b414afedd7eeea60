"""Rows of a CSV file, each with its place for errors."""

import csv
import math
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from orchestrator.errors import InputError

Row = dict[str, str]
PLACE = "_place"
"""Key of a row's file and line."""

MOST_ROWS = 100_000
"""Of one file: ten times the lines of the largest networks that operators study."""


def rows_of(path: Path, columns: Sequence[str]) -> list[Row]:
    """All rows of a file that must have some columns.

    Raises
    ------
    InputError
        If the file or one of the columns is missing, the file is not text in UTF-8, or it has more than `MOST_ROWS`
        rows.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; it should hold the columns {', '.join(columns)}")
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            missing = [c for c in columns if c not in (reader.fieldnames or ())]
            if missing:
                raise InputError(f"{path}: column {', '.join(missing)} is missing; it should hold {', '.join(columns)}")
            rows = [row | {PLACE: f"{path}, line {n}"} for n, row in enumerate(islice(reader, MOST_ROWS + 1), start=2)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: it cannot be read as a table: {error}; save it as CSV in UTF-8") from error
    if len(rows) > MOST_ROWS:
        raise InputError(f"{path}: it has more than {MOST_ROWS} rows, which is the most that a table may have")
    return rows


def place_of(row: Row) -> str:
    """File and line of a row."""
    return row[PLACE]


def number(row: Row, column: str) -> float:
    """The number in a column.

    Raises
    ------
    InputError
        If the column holds no number.
    """
    try:
        value = float(row[column])
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{place_of(row)}: {column} = {row[column]!r} is not a number")
    return value


def optional_number(row: Row, column: str) -> float | None:
    """The number in a column; None where the column or the entry is missing."""
    return number(row, column) if (row.get(column) or "").strip() else None

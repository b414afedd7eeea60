"""Rows of a CSV file, each with its place for errors, and paths as messages write them."""

import csv
import io
import math
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import check_regular, read_text, visible
from orchestrator.core.given_files import ShownFile
from orchestrator.core.units import LARGEST


def seen_from_here(path: Path) -> Path:
    """The path as a user in the working directory writes it; places in messages are read there."""
    check_regular(path)
    try:
        path.exists()  # false where there is none; it fails where nobody could tell
    except OSError as error:
        raise InputError(
            f"{str(path)[:200]}: it cannot be looked for: {error.strerror}; give another path"
        ) from error
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


Row = dict[str, str]
PLACE = "_place"  # key of a row's file and line
MOST_ROWS = 100_000  # of one file: ten times the lines of the largest networks that operators study


def rows_of(path: Path, columns: Sequence[str]) -> list[Row]:
    """All rows of a file that must have some columns.

    Raises an `InputError` if the file or one of the columns is missing, a column stands twice, columns are separated by
    semicolons or tabs, the file is not text in UTF-8, or it has more than `MOST_ROWS` rows."""
    path = seen_from_here(path)
    shown = ShownFile.of(path)
    if not path.is_file():
        wanted = (
            f"it should hold the columns {', '.join(columns)}"
            if columns
            else "give the path of a .csv"
        )
        raise InputError.at(f"{shown}", f"there is no such file; {wanted}")
    try:
        text = visible(read_text(path, encoding="utf-8-sig"))  # spreadsheets write the mark
        reader = csv.DictReader(io.StringIO(text), restval="")
        names = reader.fieldnames or ()
        _check_names(shown, names)
        missing = [c for c in columns if c not in names]
        if missing:
            raise InputError.at(
                f"{shown}",
                f"column {', '.join(missing)} is missing; it should hold {', '.join(columns)}",
            )
        rows = [
            row | {PLACE: shown.at_line(n)}
            for n, row in enumerate(islice(reader, MOST_ROWS + 1), start=2)
        ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError.at(
            f"{shown}", f"it cannot be read as a table: {error}; save it as CSV in UTF-8"
        ) from error
    if len(rows) > MOST_ROWS:
        raise InputError.at(
            f"{shown}",
            f"it has more than {MOST_ROWS} rows, which is the most that a table may have",
        )
    return rows


def _check_names(file: ShownFile, names: Sequence[str]) -> None:
    """A reader would take the last of two columns in silence."""
    for mark, word in ((";", "semicolons"), ("\t", "tabs")):
        if len(names) == 1 and mark in names[0]:
            raise InputError.at(
                file.at_line(1),
                f"its columns are separated by {word}; separate them by commas, and write "
                "decimals with a point",
            )
    for k, name in enumerate(names):
        if name and name in names[:k]:
            raise InputError.at(
                file.at_line(1), f"the column {name!r} stands twice; leave one of them out"
            )


def place_of(row: Row) -> str:
    return row[PLACE]


def number(row: Row, column: str) -> float:
    try:
        value = float(row[column])
    except (TypeError, ValueError):
        value = math.nan
    if not abs(value) < LARGEST:
        raise InputError.at(place_of(row), f"{column} = {row[column]!r} is not a number")
    return value


def optional_number(row: Row, column: str) -> float | None:
    return number(row, column) if (row.get(column) or "").strip() else None

"""A table over the time, CSV or Excel, as a dataset such as a run gives: the time first, then a column each signal."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import MOST_TEXT, read_bytes
from orchestrator.core.late import pd, xr
from orchestrator.output.results.readers import LINE_FREQUENCY

EXCEL = (".xlsx", ".xlsm")
_HEADING = re.compile(r"\s*(.*?)\s*(?:[\[(]([^])]*)[])])?\s*")
_SECONDS = {
    "": 1.0,
    "s": 1.0,
    "sec": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "min": 60.0,
}
_TIMES = ("time", "t", "timestamp", "datetime", "utc", "soc", "epoch", "zeit", "temps", "tiempo")
_THOUSANDS = r"[-+]?\d{1,3}(?:[.,'\s]\d{3})+(?:[.,]\d+)?"
_DATE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}([T\s].*)?|\d{1,2}:\d{2}(:.*)?")
_TIME = re.compile(rf"\s*([-+]?\d*[.,]?\d+([eE][-+]?\d+)?|{_DATE.pattern})\s*")
_SAMPLED = 0.045  # times farther apart [s] are slower than phasors are usually sent: perhaps ms
_SLOWEST_FRAMES = 0.105  # and still are seconds up to here [s], ten phasors a second, in files
_LENGTHS_OF_FRAMES = 1.0, 200.0  # of such a length [s]: as many ms hold no swing
_AGAIN = " "  # behind a name for each time that it came before: columns of a table differ
_EPOCH = 1e8  # numbers of seconds above it count from 1970, and are taken from the first sample on


def read_table(path: Path) -> xr.Dataset:
    """Read signals; headings such as ``f north [Hz]``, or a row of units below the names, give names and units.

    A heading as it is written stays the signal's ``long_name``.

    Lines above the headings, and columns without numbers, are left out."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give the path of a recording")
    table = _table(path)
    first = str(table.columns[0]) if table.shape[1] else ""
    name, unit = _parts(first)
    kind = table[first].dtype.kind if len(table) else ""
    stamps = _seconds_of_dates(table) if kind and kind not in "if" else None
    if stamps is None and (
        (name.lower() not in _TIMES and not unit) or unit not in _SECONDS or kind not in ("i", "f")
    ):
        raise InputError(
            f"{path}: its first column is {first!r}; it must be the time, as numbers below 'time', 't' or 'time [ms]', "
            "or as dates such as 2025-03-01 12:00:00.020, and a first line names the columns"
        )
    times = table[first].to_numpy(float) * _SECONDS[unit] if stamps is None else stamps
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise InputError(
            f"{path}: the time of its {len(times)} rows does not rise from each row to the next; {_time_remedy(times)}"
        )
    apart = float(np.median(np.diff(times)))
    is_unclear = kind == "i" or (apart > _SAMPLED and not _are_slow_frames(apart, times))
    if stamps is None and not unit and is_unclear:
        raise InputError(
            f"{path}: its times are {apart:g} apart, perhaps in ms, and {first!r} says no unit; "
            f"write '{first} [s]' or '{first} [ms]'"
        )
    _check_numbers(path, table)
    found = {
        name: _parts(name)
        for name in map(str, table.columns[1:])
        if name.strip() and table[name].dtype.kind in "if"
    }
    shorts = ["time", *(short for short, _ in found.values())]
    twice = next((short for k, short in enumerate(shorts) if short in shorts[:k]), None)
    if twice:
        raise InputError(
            f"{path}: several columns have the name {twice!r}; give each a name of its own"
        )
    columns = {
        short: ("time", table[full].to_numpy(float), {"units": u, "long_name": full})
        for full, (short, u) in found.items()
    }
    times = np.round(times - times[0], 6) if times[0] > _EPOCH else times
    rows = ("time", times, {"long_name": first})
    return xr.Dataset(columns, {"time": rows, LINE_FREQUENCY: 0.0})


def _are_slow_frames(apart: float, times: Numbers) -> bool:
    """Return whether times without a unit are seconds of a recorder that sends ten to twenty phasors a second."""
    shortest, longest = _LENGTHS_OF_FRAMES
    return apart <= _SLOWEST_FRAMES and shortest <= times[-1] - times[0] <= longest


def _time_remedy(times: Numbers) -> str:
    """Say what mends times that do not rise."""
    if len(times) < 2:
        return "give at least two rows"
    if np.isnan(times).any():
        row = int(np.flatnonzero(np.isnan(times))[0]) + 1
        return f"row {row} of the numbers has no time: give it, or leave the row out"
    ordered = np.sort(times)
    alike = ordered[1:][np.diff(ordered) <= 0]
    if len(alike):
        return (
            f"several rows have {alike[0]:.10g}: give each row once, and its time with all digits"
        )
    return "sort them"


def _table(path: Path) -> pd.DataFrame:
    """Names, and rows of numbers where a column has nothing else."""
    if path.suffix.lower() in EXCEL:
        mark, cells = "", _sheet(path)
        names, rows = _parted(cells)
    else:
        try:
            text = _text(read_bytes(path, MOST_TEXT))
            for mark in [*(mark for mark in ";\t" if mark in text), ","]:
                cells = list(csv.reader(io.StringIO(text), delimiter=mark))
                names, rows = _parted(cells)
                if rows:
                    break
        except (OSError, csv.Error) as error:
            raise InputError(f"{path}: it cannot be read as CSV: {error}") from error
    _check_heading_once(path, cells, rows)
    odd = next((row for row in rows if len(row) != len(names)), None)
    if odd:
        both = "the comma both parts the columns and stands in the numbers: write decimal points, or ';' between them"
        remedy = both if mark == "," and len(rows[0]) == 2 * len(names) else "name them all"
        raise InputError(
            f"{path}: the line above the numbers names {len(names)} columns, and {mark.join(odd)!r} has "
            f"{len(odd)}; {remedy}"
        )
    texts = pd.DataFrame(
        rows,
        columns=[f"{n}{_AGAIN * names[:k].count(n)}" for k, n in enumerate(names)],
        dtype=str,
    )
    return texts.apply(lambda column: _numbers(column, comma=mark != ","))


def _check_heading_once(path: Path, cells: Sequence[list[str]], rows: Sequence[list[str]]) -> None:
    """Refuse a heading that comes again among the numbers, as in files that were joined."""
    begin = next((k for k, row in enumerate(cells) if rows and row is rows[0]), len(cells))
    heads = [row for row in cells[:begin] if row][-2:]  # names, and units below them
    again = next((k for k in range(begin, len(cells)) if cells[k] in heads), None)
    if again is not None:
        raise InputError(f"{path}: row {again + 1} repeats the heading; remove that row")


def _numbers(column: pd.Series[Any], *, comma: bool) -> pd.Series[Any]:
    with suppress(ValueError):
        return pd.to_numeric(column)  # most columns; what follows takes three times as long
    column = column.str.strip().mask(lambda one: one.isin(["", "NaN", "nan", "NA", "N/A"]))
    for texts in (column, column.str.replace(",", ".")) if comma else (column,):
        with suppress(ValueError):
            return pd.to_numeric(texts)
    return column


def _sheet(path: Path) -> list[list[str]]:
    """Cells of the first sheet."""
    try:
        cells = pd.read_excel(path, header=None)
    except Exception as error:
        remedy = "`pip install openpyxl` where that is missing, or save the sheet as CSV"
        raise InputError(f"{path}: it cannot be read as Excel: {error}; {remedy}") from error
    texts = cells.astype(object).where(cells.notna(), "")
    return [list(map(str, row)) for row in texts.itertuples(index=False)]


def _text(content: bytes) -> str:
    """Decode text as Excel and recorders write it: with a mark of the code, in UTF-8, or in Windows' own."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16")
    with suppress(UnicodeDecodeError):
        return content.decode("utf-8-sig")
    return content.decode("cp1252", "replace")


def _parted(rows: Sequence[list[str]]) -> tuple[list[str], list[list[str]]]:
    """Names of the columns, with units from a row of their own, and the rows from the first that begins with a time."""
    rows = [row for row in rows if row]
    begin = next(
        (
            k
            for k, row in enumerate(rows)
            if len(row) > 1 and row[1].strip() and _TIME.fullmatch(row[0])
        ),
        0,
    )
    if not begin:
        return (rows[0] if rows else []), []
    names, above = [cell.strip() for cell in rows[begin - 1]], rows[begin - 2] if begin > 1 else []
    if above and len(above) == len(names) and names[0].strip("[]()-") in (*_SECONDS, "UTC"):
        units = [cell.strip("[]()-") for cell in names]
        names = [
            f"{name.strip()} [{unit}]" if unit else name.strip()
            for name, unit in zip(above, units, strict=True)
        ]
    return names, rows[begin:]


def _seconds_of_dates(table: pd.DataFrame) -> Numbers | None:
    """Seconds from the first of some dates or times of day; None where they are none."""
    texts = table.iloc[:, 0].astype(str).str.strip().str.replace(",", ".")
    if not texts.str.fullmatch(_DATE).all():
        return None
    clock = (
        table.iloc[:, 1].astype(str).str.strip().str.replace(",", ".")
        if table.shape[1] > 1
        else texts
    )
    if (
        texts.str.len().max() <= 10
        and not texts.str.contains(":").any()
        and clock.str.fullmatch(_DATE).all()
    ):
        texts = texts + " " + clock
    if texts.str.contains("/").all() and texts.str.split(" ").str[0].nunique() == 1:
        texts = texts.str.split(" ", n=1).str[-1]  # whichever is the month: all are of one day
    texts = texts.str.replace(r"^(\d{2})\.(\d{2})\.(\d{4})", r"\3-\2-\1", regex=True)
    form = "mixed" if texts.str.contains("[AP]M$").all() else "ISO8601"
    for day in ("", "2000-01-01 "):
        with suppress(ValueError, TypeError):
            stamps = pd.to_datetime(day + texts, format=form)
            return np.asarray((stamps - stamps.iloc[0]).dt.total_seconds(), dtype=float)
    return None


def _check_numbers(path: Path, table: pd.DataFrame) -> None:
    """Numbers that are taken for text would be missing without a word."""
    for name in (n for n in table.columns[1:] if table[n].dtype.kind not in "if"):
        texts = table[name].dropna().astype(str).str.strip()
        marked, other = (
            texts[texts.str.fullmatch(_THOUSANDS)],
            texts[pd.to_numeric(texts, errors="coerce").isna()],
        )
        if len(marked):
            said = f"{marked.iloc[0]!r}; write its numbers without marks between thousands"
        elif 0 < len(other) < len(texts):
            said = f"{other.iloc[0]!r} among numbers; leave such cells empty"
        else:
            continue
        raise InputError(f"{path}: column {name!r} has {said}")


def _parts(heading: str) -> tuple[str, str]:
    found = _HEADING.fullmatch(heading)
    return (found[1], found[2] or "") if found else (heading, "")

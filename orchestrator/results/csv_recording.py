"""A CSV file as a dataset over the time, such as a run gives: the time first, then a column for each signal."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.errors import InputError
from orchestrator.late import pd, xr
from orchestrator.results.comtrade.reading import LINE_FREQUENCY

_HEADING = re.compile(r"\s*(.*?)\s*(?:[\[(]([^])]*)[])])?\s*")
_SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0}
_TIMES = ("time", "t", "timestamp", "datetime")
_THOUSANDS = r"[-+]?\d{1,3}(?:[.,'\s]\d{3})+(?:[.,]\d+)?"


def read_csv(path: Path) -> xr.Dataset:
    """Read signals; headings such as ``f north [Hz]`` give a name and a unit. Columns without numbers are left out."""
    table = _table(path)
    first = str(table.columns[0]) if table.shape[1] else ""
    name, unit = _parts(first)
    kind = table[first].dtype.kind if len(table) else ""
    stamps = _seconds_of_dates(table[first]) if kind and kind not in "if" else None
    if name.lower() not in _TIMES or unit not in _SECONDS or (stamps is None and kind not in ("i", "f")):
        raise InputError(
            f"{path}: its first column is {first!r}; it must be the time, as numbers below 'time', 't' or 'time [ms]', "
            "or as dates such as 2025-03-01 12:00:00.020, and a first line names the columns"
        )
    times = table[first].to_numpy(float) * _SECONDS[unit] if stamps is None else stamps
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise InputError(
            f"{path}: the time of its {len(times)} rows does not rise from each row to the next; sort them"
        )
    apart = float(np.median(np.diff(times)))
    if stamps is None and not unit and (apart > 1 or kind == "i"):
        raise InputError(
            f"{path}: its times are {apart:g} apart, perhaps in ms, and {first!r} says no unit; "
            f"write '{first} [s]' or '{first} [ms]'"
        )
    _check_numbers(path, table)
    found = {name: _parts(name) for name in map(str, table.columns[1:]) if table[name].dtype.kind in "if"}
    columns = {short: ("time", table[full].to_numpy(float), {"units": u}) for full, (short, u) in found.items()}
    return xr.Dataset(columns, {"time": times, LINE_FREQUENCY: 0.0})


def _table(path: Path) -> pd.DataFrame:
    try:
        with path.open(encoding="utf-8-sig") as file:
            heading = file.readline()
        mark = next((mark for mark in ";\t" if mark in heading), ",")
        decimals = (".", ",") if mark != "," else (".",)
        tables = [pd.read_csv(path, sep=mark, decimal=d, encoding="utf-8-sig", skipinitialspace=True) for d in decimals]
    except (OSError, ValueError) as error:
        reason = (
            getattr(error, "strerror", None) or "its lines do not have the columns of the first one, or are no text"
        )
        raise InputError(f"{path}: it cannot be read as CSV: {reason}") from error
    table = max(tables, key=lambda one: one.select_dtypes("number").shape[1])
    if not isinstance(table.index, pd.RangeIndex):  # what pandas makes of columns without a name
        more = table.shape[1] + table.index.nlevels
        both = (
            "the comma both parts the columns and stands in the numbers: write decimal points, or ';' between columns"
        )
        remedy = both if mark == "," and more == 2 * table.shape[1] else "name them all"
        raise InputError(f"{path}: its first line names {table.shape[1]} columns, and the others have {more}; {remedy}")
    return table


def _seconds_of_dates(column: pd.Series[Any]) -> Numbers | None:
    """Seconds from the first of some dates or times of day; None where they are none."""
    texts = column.astype(str).str.replace(",", ".")
    for day in ("", "2000-01-01T"):
        with suppress(ValueError, TypeError):
            stamps = pd.to_datetime(day + texts, format="ISO8601")
            return np.asarray((stamps - stamps.iloc[0]).dt.total_seconds(), dtype=float)
    return None


def _check_numbers(path: Path, table: pd.DataFrame) -> None:
    """Numbers that are taken for text would be missing without a word."""
    for name in (n for n in table.columns[1:] if table[n].dtype.kind not in "if"):
        texts = table[name].dropna().astype(str).str.strip()
        marked, other = texts[texts.str.fullmatch(_THOUSANDS)], texts[pd.to_numeric(texts, errors="coerce").isna()]
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

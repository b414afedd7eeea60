"""A CSV file as a dataset over the time, such as a run gives: the time first, then a column for each signal."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.errors import InputError
from orchestrator.late import Late
from orchestrator.results.comtrade.reading import LINE_FREQUENCY

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
else:
    pd, xr = Late("pandas"), Late("xarray")

_HEADING = re.compile(r"\s*(.*?)\s*(?:[\[(]([^])]*)[])])?\s*")
_SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0}
_TIMES = ("time", "t", "timestamp", "datetime")
_THOUSANDS = r"[-+]?\d{1,3}(?:[.,'\s]\d{3})+(?:[.,]\d+)?"


def read_csv(path: Path) -> xr.Dataset:
    """Read signals; headings such as ``f north [Hz]`` give a name and a unit. Columns without numbers are left out.

    The time is a number, or a date or time of day as ISO 8601 has it.
    """
    table = _table(path)
    first = str(table.columns[0]) if table.shape[1] else ""
    name, unit = _parts(first)
    stamps = _seconds_of_dates(table[first]) if first and table[first].dtype.kind not in "if" else None
    known = stamps is not None or (len(table) > 0 and table[first].dtype.kind in "if")
    if name.lower() not in _TIMES or unit not in _SECONDS or not known:
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
    if stamps is None and not unit and (apart > 1 or table[first].dtype.kind == "i"):
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
        cause = "the comma both parts the columns and stands in the numbers: write the file with ';' between columns"
        both = mark == "," and more == 2 * table.shape[1]
        raise InputError(
            f"{path}: its first line names {table.shape[1]} columns, and the others have {more}; "
            + (f"{cause}, or with decimal points" if both else "name them all")
        )
    return table


def _seconds_of_dates(column: pd.Series[Any]) -> Numbers | None:
    """Seconds from the first of some dates or times of day; None where they are none."""
    texts = column.astype(str).str.replace(",", ".")
    for day in ("", "2000-01-01T"):
        try:
            stamps = pd.to_datetime(day + texts, format="ISO8601")
        except (ValueError, TypeError):
            continue
        seconds: Numbers = (stamps - stamps.iloc[0]).dt.total_seconds().to_numpy(float)
        return seconds
    return None


def _check_numbers(path: Path, table: pd.DataFrame) -> None:
    """Numbers that are taken for text would be missing without a word."""
    for name in table.columns[1:]:
        if table[name].dtype.kind in "if":
            continue
        texts = table[name].dropna().astype(str).str.strip()
        marked = texts[texts.str.fullmatch(_THOUSANDS)]
        numbers = pd.to_numeric(texts, errors="coerce")
        if len(marked):
            says, remedy = f"{marked.iloc[0]!r}", "write its numbers without marks between thousands"
        elif numbers.notna().any() and numbers.isna().any():
            says, remedy = f"{texts[numbers.isna()].iloc[0]!r} among numbers", "leave such cells empty"
        else:
            continue
        raise InputError(f"{path}: column {name!r} has {says}; {remedy}")


def _parts(heading: str) -> tuple[str, str]:
    found = _HEADING.fullmatch(heading)
    return (found[1], found[2] or "") if found else (heading, "")

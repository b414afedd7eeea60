"""A CSV file as a dataset over the time, such as a run gives: the time first, then a column for each signal."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from orchestrator.errors import InputError
from orchestrator.late import pd, xr
from orchestrator.results.comtrade.reading import LINE_FREQUENCY

_HEADING = re.compile(r"\s*(.*?)\s*(?:[\[(]([^])]*)[])])?\s*")
_SECONDS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6}


def read_csv(path: Path) -> xr.Dataset:
    """Read signals; headings such as ``f north [Hz]`` give a name and a unit. Columns without numbers are left out."""
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
    found = {name: _parts(name) for name in map(str, table.columns) if table[name].dtype.kind in "if"}
    first = str(table.columns[0]) if table.shape[1] else ""
    name, unit = _parts(first)
    if name.lower() not in ("time", "t") or unit not in _SECONDS or first not in found:
        raise InputError(
            f"{path}: its first column is {first!r}; it must be the time, as numbers below 'time', 't' or 'time [ms]', "
            "and a first line names the columns"
        )
    times = table[first].to_numpy(float) * _SECONDS[unit]
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise InputError(
            f"{path}: the time of its {len(times)} rows does not rise from each row to the next; sort them"
        )
    columns = {short: ("time", table[full].to_numpy(float), {"units": u}) for full, (short, u) in found.items()}
    columns.pop(name)
    return xr.Dataset(columns, {"time": times, LINE_FREQUENCY: 0.0})


def _parts(heading: str) -> tuple[str, str]:
    found = _HEADING.fullmatch(heading)
    return (found[1], found[2] or "") if found else (heading, "")

"""Signals named in a case file: a recorded variable, or the difference of two."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from orchestrator.cases.form.names import variables_of
from orchestrator.core.late import xr

MOST_DRAWN = 200_000  # rows up to which a signal is drawn as it is
_AT_ONCE = 1_000_000  # rows of a long signal that are read at once


def signal(dataset: xr.Dataset, expression: str) -> xr.DataArray | None:
    """``"a.b"``, ``"a.b - c.d"`` or ``"|a.i|"`` from a recorded dataset; None if a variable was not recorded.

    The name of a measured channel may hold `` - `` itself."""
    if expression in dataset:
        return dataset[expression]
    parts = expression.split(" - ")
    for k in range(1, len(parts)):
        first, second = " - ".join(parts[:k]), " - ".join(parts[k:])
        if first.strip() in dataset and second.strip() in dataset:
            return dataset[first.strip()] - dataset[second.strip()]
    names = variables_of(expression)
    if len(names) > 1 and all(name in dataset for name in names):
        found: xr.DataArray = combined(expression, [dataset[name] for name in names])
        return found.assign_attrs(dataset[names[0]].attrs)
    return None


def combined(expression: str, values: Sequence[Any]) -> Any:
    """A signal from the values of its `variables_of`, in their order: one of them, a magnitude or a difference."""
    if len(values) == 1:
        return values[0]
    first, second = values
    return (first**2 + second**2) ** 0.5 if expression.strip().startswith("|") else first - second


def outline(dataset: xr.Dataset, expression: str, most: int = MOST_DRAWN) -> xr.DataArray | None:
    """A signal to be drawn: all of it, or of a long one the least and the largest value in each of many short spans.

    A long one is read piece by piece."""
    rows = dataset.sizes["time"]
    if rows <= most:
        return signal(dataset, expression)
    span = -(-rows // (most // 2))
    piece = span * max(1, _AT_ONCE // span)
    times, values = [], []
    for begin in range(0, rows, piece):
        part = signal(dataset.isel(time=slice(begin, begin + piece)), expression)
        if part is None:
            return None
        seen, starts = part.values, np.arange(0, len(part), span)
        extremes = np.column_stack(
            [np.minimum.reduceat(seen, starts), np.maximum.reduceat(seen, starts)]
        )
        values.append(extremes.ravel())
        times.append(np.repeat(part["time"].values[starts], 2))
    return xr.DataArray(np.concatenate(values), dims="time", coords={"time": np.concatenate(times)})


def relative_difference(simulated: xr.DataArray, linear: xr.DataArray) -> float:
    """Largest difference of two responses at the same times, as a share of the first one's largest deviation."""
    deviation = float(np.abs(simulated.values - simulated.values[0]).max())
    both = min(len(simulated), len(linear))  # a run that failed is shorter
    return (
        float(np.abs(simulated.values[:both] - linear.values[:both]).max()) / deviation
        if deviation
        else np.nan
    )

"""Numbers that a recorder writes where it has no value, such as -9999."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers
from orchestrator.studies.validation.channels import RecordedChannel
from orchestrator.studies.validation.questions import Question, QuestionKind

if TYPE_CHECKING:
    import xarray as xr

Samples = NDArray[np.intp]

_NINES = tuple(10.0**digits - 1 for digits in range(3, 9))
_WORDS = 32767.0, 32768.0, 65535.0, 2147483647.0, 2147483648.0
_CODES = np.array(_NINES + _WORDS)
"""Magnitudes: nines, and the ends of whole numbers of 2 and 4 bytes."""

_BEYOND_ALL = 1e20  # magnitude in any unit that no plant has


@dataclass(frozen=True)
class MissingCode:
    """A number of a column that stands for no value, and at which samples it does."""

    value: float
    samples: Samples  # indices


def missing_codes(values: Numbers) -> list[MissingCode]:
    """Return the codes for missing samples in a column.

    A usual code, such as -9999, is one where it lies farther from all other values than these lie from each other: P
    that passes through 999 kW is a power."""
    sizes = np.abs(values)
    coded = np.isin(sizes, _CODES) | (sizes >= _BEYOND_ALL)
    others = values[np.isfinite(values) & ~coded]
    if not coded.any() or not len(others):
        return []
    low, high = float(others.min()), float(others.max())
    far = np.maximum(low - values, values - high) > high - low
    return [
        MissingCode(float(value), np.flatnonzero(values == value))
        for value in np.unique(values[coded & far])
    ]


def without_codes(
    dataset: xr.Dataset, channels: Mapping[str, RecordedChannel]
) -> tuple[xr.Dataset, list[Question]]:
    """Return a recording whose codes for missing samples are no numbers, and what is said of each code."""
    found, said = dataset, []
    for role, channel in channels.items():
        if role == "time":
            continue
        values = np.array(dataset[channel.column].values, dtype=float)
        codes = missing_codes(values)
        for code in codes:
            values[code.samples] = np.nan
            figures = {
                "role": role,
                "column": channel.column,
                "value": code.value,
                "count": len(code.samples),
                "at": float(dataset["time"].values[code.samples[0]]),
            }
            said.append(Question(QuestionKind.MISSING_CODE, figures))
        if codes:
            found = found.assign({channel.column: ("time", values, dataset[channel.column].attrs)})
    return found, said

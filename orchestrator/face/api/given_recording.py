"""A recording as Python gives it: a run, its dataset, a table or an array over the time, a folder or a file."""

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from orchestrator.cases.form.given import users_level
from orchestrator.core.errors import InputError
from orchestrator.core.units import to_unit
from orchestrator.face.api.results import Run
from orchestrator.output.results.recording_reader import warn_of_early_end
from orchestrator.output.results.trajectory import open_trajectory
from orchestrator.studies.signals.signal_modes import RARE

Recorded = Any
"""`Run`, `xarray.Dataset`, `xarray.DataArray`, `pandas.DataFrame`, or a path; pandas is imported late."""

_SHOWN = 60  # characters of a wrong argument that an error shows
_IN_BRACKETS = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]\s*$")


def open_given(run: Recorded, fallback: str) -> tuple[xr.Dataset, str]:
    """Return a run's dataset and its name, which is ``fallback`` where the dataset has none of a scenario.

    Warns
    -----
    ResultsWarning
        If the run ended before its stop time.
    """
    if isinstance(run, str | Path):
        dataset, label = open_trajectory(Path(run)), str(run)
    else:
        dataset = run.dataset if isinstance(run, Run) else _as_dataset(run, fallback)
        if not isinstance(dataset, xr.Dataset):
            raise InputError(
                f"{fallback} is {_kind(run)}; give a run, its dataset, a DataFrame or DataArray over the time, the "
                "folder of a scenario's results, or the file of a recording (COMTRADE, CSV, Excel)"
            )
        label = str(dataset.attrs.get("scenario", fallback))
    if not dataset.sizes.get("time"):
        raise InputError(
            f"{label}: nothing was recorded over the time; give a run that came beyond its start"
        )
    warn_of_early_end(dataset, label)
    return dataset, label


def _as_dataset(given: Any, fallback: str) -> Any:
    """Return a table or an array over the time [s] as a dataset; anything else as it is.

    Raises an `InputError` where the index or the dimension is no time that ascends."""
    if isinstance(given, pd.Series):
        given = given.to_frame(str(given.name or fallback))
    if isinstance(given, pd.DataFrame):
        frame = given.set_index("time") if "time" in given.columns else given
        data = xr.Dataset(
            {str(name): ("time", frame[name].to_numpy()) for name in frame},
            {"time": _seconds(frame.index, fallback)},
        )
    elif isinstance(given, xr.DataArray):
        if given.dims != ("time",) or "time" not in given.coords:
            raise InputError(
                f"{fallback} is an array over {', '.join(map(str, given.dims)) or 'nothing'}; its one dimension must "
                "be 'time', with a coordinate in seconds"
            )
        data = given.to_dataset(name=str(given.name or fallback))
        data = data.assign_coords(time=_seconds(given["time"].to_index(), fallback))
    else:
        return given
    wrong = [name for name in data if data[name].dtype.kind not in "fiub"]
    if wrong:
        raise InputError(f"{fallback}: column {wrong[0]!r} holds no numbers; leave it out")
    return data


def _seconds(index: Any, fallback: str) -> Any:
    """An index as times [s]: numbers, or dates from the first on."""
    if isinstance(index, pd.DatetimeIndex):
        index = index - index[0]
    if isinstance(index, pd.TimedeltaIndex):
        index = index.total_seconds()
    rule = "give numbers in seconds, dates, or time differences that ascend"
    if index.dtype.kind not in "fiu":
        raise InputError(f"{fallback}: its index is no time; {rule}")
    if (
        isinstance(index, pd.RangeIndex)
        and index.name is None
        and (index.start, index.step) == (0, 1)
    ):
        raise InputError(
            f"{fallback}: its index counts the rows, and is no time; give the times in seconds as index or as a "
            "column 'time', such as frame.set_index(0.01 * frame.index)"
        )
    if not index.is_monotonic_increasing or not index.is_unique:
        raise InputError(f"{fallback}: the times of its index do not ascend; {rule}")
    times = index.to_numpy(dtype=float)
    name = "time" if index.name is None else str(index.name)
    apart = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if apart > RARE and not _IN_BRACKETS.search(name):
        text = f"question: {fallback}: its times are {apart:g} apart, perhaps in ms, and their name {name!r} says no "
        text += f"unit; they are taken as seconds: name the index '{name} [s]' or '{name} [ms]'"
        from orchestrator.face.api.scenario import UnusualDataWarning  # noqa: PLC0415 - imports the reading of cases

        warnings.warn(text, UnusualDataWarning, stacklevel=users_level())
    return times * _second(name, fallback)


def _second(name: str, fallback: str) -> float:
    """How many seconds the unit is that the name of an index has in brackets; 1 without one."""
    unit = _IN_BRACKETS.search(name)
    if unit is None:
        return 1.0
    try:
        return to_unit(f"1 {unit[1]}", "s")
    except ValueError as error:
        raise InputError(
            f"{fallback}: its index is named {name!r}, and a time is in s, ms or us; name its unit so"
        ) from error


def _kind(given: Any) -> str:
    """Return what was given, in few words."""
    text = repr(given)
    return text if len(text) <= _SHOWN and "\n" not in text else f"of type {type(given).__name__}"

"""The modes in a recorded signal."""

import re
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from orchestrator.cases.form.given import Time, moment, part_of_record, users_level
from orchestrator.core.asked import names as names_given
from orchestrator.core.asked import number_between, positive, text_or_none
from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.core.units import to_unit
from orchestrator.face.api.results import Run
from orchestrator.linear.signals.ambient import ambient_modes
from orchestrator.linear.signals.identification import sampling
from orchestrator.linear.signals.mode_doubts import straight_line
from orchestrator.output.results.recorded import warn_of_early_end
from orchestrator.output.results.trajectory import open_trajectory
from orchestrator.studies.oscillations.verdict import forced_frequencies
from orchestrator.studies.signals.ambient import AmbientModes, AmbientWindow
from orchestrator.studies.signals.angle_units import doubtful_angles
from orchestrator.studies.signals.comparison import (
    recorded,
    require_numbers,
    strongest_modes,
)
from orchestrator.studies.signals.signal_modes import RARE, SignalModes

Recorded = Any
"""`Run`, `xarray.Dataset`, `xarray.DataArray`, `pandas.DataFrame`, or a path; pandas is imported late."""

_SHOWN = 60  # characters of a wrong argument that an error shows
_IN_BRACKETS = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]\s*$")
_ONE_SIGNAL = "give one signal, 'a.b' or the difference 'a.b - c.d' of two"


def identify(
    run: Recorded, signal: str | None = None, start: Time = 2.0, stop: Time | None = None
) -> SignalModes:
    """Find the modes in a signal of a run by the matrix pencil method.

    Parameters
    ----------
    run
        A run, its dataset, a recording's file, or the folder of a scenario's results; or a DataFrame or DataArray over
        the time [s].
    signal
        ``"a.b"`` or ``"a.b - c.d"``; may be left out where there is one alone.
    start
        Beginning of the free response [s].
    stop
        End of the free response [s]; by default the end of the run.

    Raises
    ------
    InputError
        If there is no such run, it does not have the signal, or nothing but numbers of it between the two times.
    AnalysisError
        If the signal has too few samples between the two times, or does not oscillate.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> run = gfor.load("infinite_bus").scenario("dip").run(stop=2.0)
    >>> modes = gfor.identify(run, "gfor.omega", start=1.2)
    >>> print(f"{modes.table()['frequency_hz'][0]:.2f} Hz")
    2.83 Hz
    """
    text_or_none(signal, "signal", _ONE_SIGNAL)
    dataset, label = opened(run, "run")
    if signal is None:
        if len(dataset.data_vars) != 1:
            raise InputError(f"signal = None; {_ONE_SIGNAL}")
        (signal,) = map(str, dataset.data_vars)
    curve = recorded(dataset, signal, label)
    begin, end = part_of_record(curve["time"].values, start, stop, label)
    window = curve.sel(time=slice(begin, end))
    require_numbers(window, signal, label)
    modes = strongest_modes(curve, begin, end)
    times, line = window["time"].values, straight_line(window["time"].values, window.values)
    about = [text for text in doubtful_angles(dataset, signal) if "places" not in dataset.attrs]
    begin, end = float(times[0]), float(times[-1])
    return SignalModes(signal, begin, end, modes, sampling(times), line=line, about=tuple(about))


def ambient(
    run: Recorded,
    signals: str | Sequence[str],
    start: Time = 0.0,
    stop: Time | None = None,
    *,
    window: Time | None = None,
    level: float = 3.0,
    highest_hz: float = 2.5,
) -> AmbientModes:
    """Find the modes in signals that noise shakes, by covariance-driven stochastic subspace identification.

    Parameters
    ----------
    run
        A run, its dataset, the folder of a scenario's results, or a measured recording.
    signals
        One or several of ``"a.b"`` or ``"a.b - c.d"``; shapes are between them.
    start, stop
        The part of the record that is used [s]; by default all of it.
    window
        Length of the parts, each half a length after the one before [s]; by default one part.
    level
        Damping below which it is an alarm [%].
    highest_hz
        Of the modes that are looked for [Hz].

    Raises
    ------
    InputError
        If there is no such run, or it lacks a signal, or numbers of it.
    AnalysisError
        If no part is long and even enough.
    """
    rule = "a damping in percent from 0 to 100, such as 3.0"
    alarm = number_between(level, "%", "level", 0.0, 100.0, rule)
    highest_hz = positive(highest_hz, "highest_hz", "give a frequency above 0 in Hz, such as 2.5")
    dataset, label = opened(run, "run")
    names = list(names_given(signals, "signals"))
    if not names:
        raise InputError(f"signals = {signals!r}; {_ONE_SIGNAL}, or several")
    begin, end = part_of_record(dataset["time"].values, start, stop, label)
    length = end - begin if window is None else moment(window, "window")
    curves = [recorded(dataset, name, label).sel(time=slice(begin, end)) for name in names]
    for name, curve in zip(names, curves, strict=True):
        require_numbers(curve, name, label)
    times, values = curves[0]["time"].values, np.column_stack([curve.values for curve in curves])
    if not 0 < length <= end - begin + 1e-9:
        raise InputError(
            f"window = {window!r}: the record is used from {begin:g} to {end:g} s; give a shorter window"
        )
    found = []
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    for k in range(int(2 * (end - begin - length + step) / length + 1e-6) + 1):
        first = begin + 0.5 * k * length
        part = (times >= first - 1e-9) & (times <= first + length + 1e-9)
        try:
            modes = ambient_modes(times[part], values[part], highest_hz)
            steady = forced_frequencies(times[part], names, values[part]) if modes else []
            near = 2 / length
            told = [
                replace(m, forced=any(abs(m.frequency_hz - f) < near for f in steady))
                for m in modes
            ]
            found.append(AmbientWindow(first, first + length, told))
        except AnalysisError as error:
            found.append(AmbientWindow(first, first + length, (), str(error)))
    if all(one.failure for one in found):
        raise AnalysisError(f"{label}: {found[0].failure}")
    return AmbientModes(label, names, found, alarm)


def as_dataset(given: Any, otherwise: str) -> Any:
    """A table or an array over the time [s] as a dataset; anything else as it is.

    Raises an `InputError` where the index or the dimension is no time that ascends."""
    if isinstance(given, pd.Series):
        given = given.to_frame(str(given.name or otherwise))
    if isinstance(given, pd.DataFrame):
        frame = given.set_index("time") if "time" in given.columns else given
        data = xr.Dataset(
            {str(name): ("time", frame[name].to_numpy()) for name in frame},
            {"time": _seconds(frame.index, otherwise)},
        )
    elif isinstance(given, xr.DataArray):
        if given.dims != ("time",) or "time" not in given.coords:
            raise InputError(
                f"{otherwise} is an array over {', '.join(map(str, given.dims)) or 'nothing'}; its one dimension must "
                "be 'time', with a coordinate in seconds"
            )
        data = given.to_dataset(name=str(given.name or otherwise))
        data = data.assign_coords(time=_seconds(given["time"].to_index(), otherwise))
    else:
        return given
    wrong = [name for name in data if data[name].dtype.kind not in "fiub"]
    if wrong:
        raise InputError(f"{otherwise}: column {wrong[0]!r} holds no numbers; leave it out")
    return data


def _seconds(index: Any, otherwise: str) -> Any:
    """An index as times [s]: numbers, or dates from the first on."""
    if isinstance(index, pd.DatetimeIndex):
        index = index - index[0]
    if isinstance(index, pd.TimedeltaIndex):
        index = index.total_seconds()
    rule = "give numbers in seconds, dates, or time differences that ascend"
    if index.dtype.kind not in "fiu":
        raise InputError(f"{otherwise}: its index is no time; {rule}")
    if (
        isinstance(index, pd.RangeIndex)
        and index.name is None
        and (index.start, index.step) == (0, 1)
    ):
        raise InputError(
            f"{otherwise}: its index counts the rows, and is no time; give the times in seconds as index or as a "
            "column 'time', such as frame.set_index(0.01 * frame.index)"
        )
    if not index.is_monotonic_increasing or not index.is_unique:
        raise InputError(f"{otherwise}: the times of its index do not ascend; {rule}")
    times = index.to_numpy(dtype=float)
    name = "time" if index.name is None else str(index.name)
    apart = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if apart > RARE and not _IN_BRACKETS.search(name):
        text = f"question: {otherwise}: its times are {apart:g} apart, perhaps in ms, and their name {name!r} says no "
        text += f"unit; they are taken as seconds: name the index '{name} [s]' or '{name} [ms]'"
        from orchestrator.face.api.scenario import UnusualDataWarning  # noqa: PLC0415 - imports the reading of cases

        warnings.warn(text, UnusualDataWarning, stacklevel=users_level())
    return times * _second(name, otherwise)


def _second(name: str, otherwise: str) -> float:
    """How many seconds the unit is that the name of an index has in brackets; 1 without one."""
    unit = _IN_BRACKETS.search(name)
    if unit is None:
        return 1.0
    try:
        return to_unit(f"1 {unit[1]}", "s")
    except ValueError as error:
        raise InputError(
            f"{otherwise}: its index is named {name!r}, and a time is in s, ms or us; name its unit so"
        ) from error


def _kind(given: Any) -> str:
    """Return what was given, in few words."""
    text = repr(given)
    return text if len(text) <= _SHOWN and "\n" not in text else f"of type {type(given).__name__}"


def opened(run: Recorded, otherwise: str) -> tuple[xr.Dataset, str]:
    """A run's dataset and its name; ``otherwise`` names a dataset without a scenario's name.

    Warns
    -----
    ResultsWarning
        If the run ended before its stop time.
    """
    if isinstance(run, str | Path):
        dataset, label = open_trajectory(Path(run)), str(run)
    else:
        dataset = run.dataset if isinstance(run, Run) else as_dataset(run, otherwise)
        if not isinstance(dataset, xr.Dataset):
            raise InputError(
                f"{otherwise} is {_kind(run)}; give a run, its dataset, a DataFrame or DataArray over the time, the "
                "folder of a scenario's results, or the file of a recording (COMTRADE, CSV, Excel)"
            )
        label = str(dataset.attrs.get("scenario", otherwise))
    if not dataset.sizes.get("time"):
        raise InputError(
            f"{label}: nothing was recorded over the time; give a run that came beyond its start"
        )
    warn_of_early_end(dataset, label)
    return dataset, label

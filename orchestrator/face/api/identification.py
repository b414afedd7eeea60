"""The modes in a recorded signal: of a free response, or of what noise shakes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orchestrator.cases.form.given import Time, moment, part_of_record
from orchestrator.core.asked import names as names_given
from orchestrator.core.asked import number_between, positive, text_or_none
from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.face.api.given_recording import Recorded, open_given
from orchestrator.linear.signals.ambient import ambient_modes
from orchestrator.linear.signals.identification import sampling
from orchestrator.linear.signals.mode_doubts import straight_line
from orchestrator.studies.oscillations.verdict import forced_frequencies
from orchestrator.studies.signals.ambient import AmbientModes, AmbientWindow
from orchestrator.studies.signals.angle_units import doubtful_angles
from orchestrator.studies.signals.comparison import (
    recorded,
    require_numbers,
    strongest_modes,
)
from orchestrator.studies.signals.signal_modes import SignalModes

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
    dataset, label = open_given(run, "run")
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
    dataset, label = open_given(run, "run")
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

"""The modes in a recorded signal."""

from pathlib import Path

import xarray as xr

from orchestrator.analysis.identification import sampling
from orchestrator.analysis.mode_doubts import straight_line
from orchestrator.api.results import Run
from orchestrator.asked import text_or_none
from orchestrator.cases.given import Time, moment
from orchestrator.errors import InputError
from orchestrator.results.recorded import warn_of_early_end
from orchestrator.study.comparison import open_trajectory, recorded, require_numbers, strongest_modes
from orchestrator.study.signal_modes import SignalModes

_ONE_SIGNAL = "give one signal, 'a.b' or the difference 'a.b - c.d' of two"


def identify(
    run: Run | xr.Dataset | str | Path, signal: str, start: Time = 2.0, stop: Time | None = None
) -> SignalModes:
    """Find the modes in a signal of a run by the matrix pencil method.

    Parameters
    ----------
    run
        A run, its dataset, or the folder of a scenario's results.
    signal
        ``"a.b"`` or ``"a.b - c.d"``.
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
    if text_or_none(signal, "signal", _ONE_SIGNAL) is None:
        raise InputError(f"signal = None; {_ONE_SIGNAL}")
    dataset, label = opened(run, "run")
    curve = recorded(dataset, signal, label)
    begin, last = moment(start, "start"), float(curve["time"][-1])
    if begin >= last:
        raise InputError(f"start = {start!r}: {label} ends at t = {last:g} s; give an earlier start")
    end = last if stop is None else moment(stop, "stop")
    if end <= begin:
        raise InputError(f"stop = {stop!r}: it must come after start = {start!r}; give a later stop")
    require_numbers(curve.sel(time=slice(begin, end)), signal, label)
    modes = strongest_modes(curve, begin, end)
    window = curve.sel(time=slice(begin, end))
    times = window["time"].values
    line = straight_line(times, window.values)
    return SignalModes(signal, float(times[0]), float(times[-1]), modes, sampling(times), line)


def opened(run: Run | xr.Dataset | str | Path, otherwise: str) -> tuple[xr.Dataset, str]:
    """A run's dataset and its name; ``otherwise`` names a dataset without a scenario's name.

    Warns
    -----
    ResultsWarning
        If the run ended before its stop time.
    """
    if isinstance(run, str | Path):
        dataset, label = open_trajectory(Path(run)), str(run)
    else:
        dataset = run.dataset if isinstance(run, Run) else run
        if not isinstance(dataset, xr.Dataset):
            raise InputError(f"{otherwise} = {run!r}; give a run, its dataset, or the folder of a scenario's results")
        label = str(dataset.attrs.get("scenario", otherwise))
    if not dataset.sizes.get("time"):
        raise InputError(f"{label}: nothing was recorded over the time; give a run that came beyond its start")
    warn_of_early_end(dataset, label)
    return dataset, label

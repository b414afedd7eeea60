"""The modes in a recorded signal."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from orchestrator.analysis.identification import IdentifiedMode, Sampling, sampling
from orchestrator.analysis.mode_doubts import is_trend, nothing_swings, over_a_trend, short_window, straight_line
from orchestrator.api.results import Run
from orchestrator.api.values import Time, moment
from orchestrator.asked import text_or_none
from orchestrator.errors import InputError
from orchestrator.report.notebook import page
from orchestrator.results.mode_json import eigenvalue_json
from orchestrator.results.recorded import warn_of_early_end
from orchestrator.study.comparison import open_trajectory, recorded, require_numbers, strongest_modes

_ONE_SIGNAL = "give one signal, 'a.b' or the difference 'a.b - c.d' of two"


@dataclass(eq=False, repr=False)
class SignalModes:
    """A recorded signal as a sum of modes, the strongest first. `identify` makes it.

    Attributes
    ----------
    signal
        The signal, as it was asked for.
    start, stop
        Beginning and end of the part of the record that was used [s].
    modes
        Eigenvalue [rad/s], damping and amplitude [unit of the signal] of each mode.
    used
        Which samples of the record were used.
    line
        By how much the straight line through the samples changes from start to stop [unit of the signal].
    """

    signal: str
    start: float
    stop: float
    modes: Sequence[IdentifiedMode]
    used: Sampling
    line: float = 0.0

    def __iter__(self) -> Iterator[IdentifiedMode]:
        return iter(self.modes)

    def __len__(self) -> int:
        return len(self.modes)

    @property
    def interval(self) -> float:
        """Time between the samples used [s]."""
        return self.used.interval

    def is_trend(self, mode: IdentifiedMode) -> bool:
        """Whether a component is an offset or a slow trend, whose damping says nothing about growth.

        Parameters
        ----------
        mode
            One of `modes`. In the window, a trend changes by less than a factor e and turns by less than one radian.
        """
        return is_trend(mode, self.stop - self.start)

    @property
    def remarks(self) -> list[str]:
        """Sentences on the highest frequency that the samples can show, on the modes near it, on a window that is too
        short, on a trend that may hide modes, on a window
        without oscillations, and on each mode in doubt.
        """
        highest = 0.5 / self.interval
        texts = [
            f"The samples used, every {self.interval:g} s, show nothing above {highest:.4g} Hz: "
            "a faster oscillation appears as a slower one."
        ]
        near = [f"{m.frequency_hz:.4g} Hz" for m in self.modes if m.frequency_hz > highest / 2]
        if near:
            texts.append(
                f"Above a quarter of the sampling frequency of {1 / self.interval:.4g} Hz, and perhaps no frequency "
                f"of the system: {', '.join(near)}. To be sure, {self.used.remedy}."
            )
        length = self.stop - self.start
        about = [
            nothing_swings(self.modes, length),
            short_window(self.modes, self.start, self.stop),
            over_a_trend(self.modes, length, self.line),
        ]
        doubtful = [m for m in self.modes if m.doubts and not self.is_trend(m)]
        return [*texts, *filter(None, about), *(f"? {doubt_text(m)}." for m in doubtful)]

    def table(self) -> pd.DataFrame:
        """One row for every mode: eigenvalue [1/s, rad/s], frequency, damping ratio, amplitude [unit of the signal]."""
        figures = ["real", "imag", "frequency_hz", "damping_percent", "amplitude"]
        return pd.DataFrame(self.as_json(), columns=figures)

    def as_json(self) -> list[dict[str, Any]]:
        """The same as ``gfor identify --json`` prints, as JSON's types."""
        return [identified_mode_json(mode) for mode in self.modes]

    def __repr__(self) -> str:
        return f"<SignalModes of {self.signal} from {self.start:g} to {self.stop:g} s: {len(self)} modes>"

    def _repr_html_(self) -> str:
        return page(repr(self).strip("<>"), self.remarks, self.table())


def identified_mode_json(mode: IdentifiedMode) -> dict[str, Any]:
    """A mode of a signal as JSON's types."""
    figures = eigenvalue_json(mode.eigenvalue, mode.damping_percent)
    return figures | {"amplitude": mode.amplitude, "doubts": list(mode.doubts)}


def doubt_text(mode: IdentifiedMode) -> str:
    """What is doubtful about a mode, as one clause."""
    return f"{mode.frequency_hz:.4g} Hz is doubtful: {'; '.join(mode.doubts)}"


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

"""Recorded runs side by side: how far two differ in a signal, and the modes that each rings with."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from orchestrator.analysis.identification import IdentifiedMode, identify_modes
from orchestrator.errors import AnalysisError, InputError
from orchestrator.results.signals import signal

_WEAKEST = 1e-3


@dataclass(frozen=True)
class Comparison:
    """One signal of two runs over the time that both have.

    Attributes
    ----------
    deviations
        Largest deviation of each run from its own start [unit of the signal].
    largest, rms
        Difference between the runs [unit of the signal], the second interpolated to the first one's times.
    at
        Time of the largest difference [s].
    modes
        Strongest oscillation in each run from ``start`` on; None where none is found.
    """

    expression: str
    unit: str
    deviations: tuple[float, float]
    largest: float
    rms: float
    at: float
    modes: tuple[IdentifiedMode | None, IdentifiedMode | None]


def open_trajectory(path: Path) -> xr.Dataset:
    """A recorded run: ``trajectory.nc``, or the scenario's folder that holds it.

    Raises
    ------
    InputError
        If there is none.
    """
    file = path / "trajectory.nc" if path.is_dir() else path
    if not file.is_file():
        inside = sorted(p.parent.name for p in path.glob("*/trajectory.nc")) if path.is_dir() else []
        hint = f"choose a scenario in it: {', '.join(inside)}" if inside else "`gfor run` writes one a scenario"
        raise InputError(f"{path}: there is no trajectory.nc; {hint}")
    try:
        with xr.open_dataset(file) as dataset:
            return dataset.load()
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: it cannot be read as NetCDF: {error}") from error


def recorded(dataset: xr.Dataset, expression: str, label: str) -> xr.DataArray:
    """A signal of a run.

    Raises
    ------
    InputError
        If it was not recorded.
    """
    found = signal(dataset, expression)
    if found is None:
        names = ", ".join(map(str, list(dataset.data_vars)[:12]))
        raise InputError(f"{label}: signal {expression!r} was not recorded; there are: {names} …")
    return found


def strongest_modes(curve: xr.DataArray, start: float, stop: float | None = None) -> list[IdentifiedMode]:
    """What a signal rings with between two times [s], strongest first; see `identify_modes`.

    What has less than a thousandth of the strongest's amplitude is left out.
    """
    window = curve.sel(time=slice(start, stop))
    # Oscillations are small beside the value that they are around, and would count as noise beside it.
    found = identify_modes(window["time"].values, window.values - float(window.mean()))
    return [m for m in found if m.amplitude >= _WEAKEST * found[0].amplitude]


def compare(a: xr.Dataset, b: xr.Dataset, expression: str, start: float, labels: tuple[str, str]) -> Comparison:
    """Compare one signal of two runs; oscillations are looked for from ``start`` [s] on.

    Parameters
    ----------
    a, b
        Trajectories of the two runs.
    expression
        The signal: ``"a.b"`` or ``"a.b - c.d"``, see `signal`.
    start
        Oscillations are looked for from this time on [s].
    labels
        Names of the two runs for tables and errors.

    Raises
    ------
    InputError
        If a run does not have the signal, or they have no time in common.
    """
    first, second = (recorded(run, expression, label) for run, label in zip((a, b), labels, strict=True))
    end = min(float(first["time"][-1]), float(second["time"][-1]))
    times = first["time"].values
    times = times[(times >= float(second["time"][0])) & (times <= end)]
    if len(times) < 2:
        raise InputError(f"{labels[0]} and {labels[1]} have no time in common; nothing can be compared")
    y_1 = np.interp(times, first["time"].values, first.values)
    y_2 = np.interp(times, second["time"].values, second.values)
    difference = y_2 - y_1
    worst = int(np.argmax(np.abs(difference)))
    return Comparison(
        expression,
        str(first.attrs.get("units") or _unit(a, expression)),
        (float(np.abs(y_1 - y_1[0]).max()), float(np.abs(y_2 - y_2[0]).max())),
        float(abs(difference[worst])),
        float(np.sqrt(np.mean(difference**2))),
        float(times[worst]),
        (_strongest(first, start), _strongest(second, start)),
    )


def most_different(a: xr.Dataset, b: xr.Dataset, count: int = 10) -> list[str]:
    """Signals that both runs have, those first whose difference is largest beside their own deviation."""

    def share(name: str) -> float:
        one, other = (run[name].values[: min(a.sizes["time"], b.sizes["time"])] for run in (a, b))
        deviation = max(np.abs(one - one[0]).max(), np.abs(other - other[0]).max(), 1e-12)
        return float(np.abs(one - other).max() / deviation)

    common = [str(name) for name in a.data_vars if name in b.data_vars]
    return sorted(common, key=share, reverse=True)[:count]


def _unit(dataset: xr.Dataset, expression: str) -> str:
    return str(dataset[expression.split(" - ", maxsplit=1)[0].strip()].attrs.get("units", ""))


def _strongest(curve: xr.DataArray, start: float) -> IdentifiedMode | None:
    try:
        found = [m for m in strongest_modes(curve, start) if m.frequency_hz > 0.05]
    except AnalysisError:
        return None
    return found[0] if found else None

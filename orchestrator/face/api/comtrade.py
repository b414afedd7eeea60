"""Recorded signals as a COMTRADE recording."""

import json
from pathlib import Path

import xarray as xr

from orchestrator.core.asked import Names, names, positive
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.face.api.given_recording import open_given
from orchestrator.face.api.results import Run
from orchestrator.output.results.comtrade.writing import write_comtrade
from orchestrator.studies.signals.comparison import recorded


def export_comtrade(
    run: Run | xr.Dataset | str | Path,
    signals: Names = (),
    path: str | Path | None = None,
    form: str = "BINARY32",
    frequency: float | None = None,
) -> tuple[Path, Path]:
    """Write signals of a run as a COMTRADE recording, which tools for relays and fault records read.

    Parameters
    ----------
    run
        A run, its dataset, or the folder of a scenario's results.
    signals
        ``"a.b"`` or ``"a.b - c.d"``; by default all.
    path
        Of the ``.cfg``; by default ``trajectory.cfg`` beside the run's ``trajectory.nc``.
    form
        Of the samples: ``"ASCII"`` or ``"BINARY"`` (revision 1999), ``"BINARY32"`` or ``"FLOAT32"`` (revision 2013).
    frequency
        Rated frequency [Hz]; by default that of the run's components.

    Returns
    -------
    tuple of Path
        The ``.cfg`` and the ``.dat``.

    Raises
    ------
    InputError
        If there is no such run, it does not have a signal, or it is not recorded evenly.
    ResultsError
        If the files cannot be written.

    Examples
    --------
    >>> import tempfile, orchestrator as gfor
    >>> run = gfor.load("infinite_bus").scenario("dip").run(stop=0.1)
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in gfor.export_comtrade(run, ["gfor.omega"], f"{folder.name}/dip.cfg")]
    ['dip.cfg', 'dip.dat']
    """
    dataset, label = open_given(run, "run")
    chosen = names(signals, "signals") or [str(name) for name in dataset.data_vars]
    curves = {expression: _curve(dataset, expression, label) for expression in chosen}
    if path is None:
        if not isinstance(run, str | Path):
            raise InputError("path = None; give the path of the .cfg to be written")
        folder = Path(run) if Path(run).is_dir() else Path(run).parent
        path = folder / "trajectory.cfg"
    if frequency is None:
        rated = _rated_frequency(dataset)
    else:
        rated = positive(frequency, "frequency", "give a rated frequency above 0 in Hz, such as 50")
    target = path_of(path, "path")
    return write_comtrade(
        xr.Dataset(curves, attrs=dataset.attrs), list(curves), target, form, rated
    )


def _rated_frequency(dataset: xr.Dataset) -> float:
    """Return what the run's components were given as ``f_n`` [Hz]; every model's own is 50 Hz."""
    values = json.loads(str(dataset.attrs.get("values", "{}")))
    given = {float(value) for name, value in values.items() if name.endswith(".f_n")}
    return max(given, default=50.0)


def _curve(dataset: xr.Dataset, expression: str, label: str) -> xr.DataArray:
    """A signal with its unit, which a difference takes from its first part."""
    curve = recorded(dataset, expression, label)
    first = expression.split(" - ", maxsplit=1)[0].strip()
    unit = curve.attrs.get("units") or (
        dataset[first].attrs.get("units", "") if first in dataset else ""
    )
    return curve.assign_attrs(units=unit)

"""Opens a recorded run or a measured recording, whichever of them a path is."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import PARTIAL
from orchestrator.output.results.manifest import MANIFEST, ResultsWarning, checked
from orchestrator.output.results.readers import reader_of
from orchestrator.output.results.recording_reader import open_recording, open_whole
from orchestrator.output.results.recording_writer import FOLDER, TRAJECTORY, parts_of
from orchestrator.output.results.staging import unfinished

if TYPE_CHECKING:
    import xarray as xr


def open_trajectory(path: Path) -> xr.Dataset:
    """A recorded run: ``trajectory.nc``, or the scenario's folder that holds it; also one that is not finished.

    A file whose ending has a reader is a measured recording: COMTRADE, CSV, Excel, and what plug-ins read."""
    read = None if path.is_dir() else reader_of(path)
    if read is not None:
        return read(path)
    if parts_of(path / FOLDER):
        dataset = open_recording(path / FOLDER)
        if not dataset.sizes["time"]:
            raise InputError(f"{path}: nothing was recorded yet")
        reached = float(dataset["time"][-1])
        text = f"{path}: this recording is not finished; it reaches t = {reached:.6g} s"
        warnings.warn(text, ResultsWarning, stacklevel=2)
        return dataset
    file = path / TRAJECTORY if path.is_dir() else path
    if not path.exists() and path.suffix and not path.name.endswith(TRAJECTORY):
        raise InputError(
            f"{path}: there is no such file; give a recording's file, or the folder of a scenario's results"
        )
    if not file.is_file():
        raise InputError(f"{path}: there is no trajectory.nc; {_hint(path)}")
    if path.is_dir() or (path.parent / MANIFEST).is_file():
        checked(file.parent, [file.name])
    try:
        dataset = open_whole(file)
    except (OSError, ValueError) as error:
        raise InputError(
            f"{file}: it cannot be read as NetCDF, or is damaged; give the folder of a scenario's results, its "
            "trajectory.nc, a measured recording in COMTRADE (.cfg, .cff), in CSV (.csv) or Excel (.xlsx)"
        ) from error
    if not dataset.sizes.get("time"):
        raise InputError(f"{file}: nothing was recorded in it; run the scenario again")
    return dataset


def _hint(path: Path) -> str:
    inside = sorted(p.parent.name for p in path.glob("*/trajectory.nc")) if path.is_dir() else []
    if inside:
        return f"choose a scenario in it: {', '.join(inside)}"
    begun = [
        folder.name
        for folder in unfinished(path.parent)
        if folder.name.startswith(f"{path.name}{PARTIAL}")
    ]
    if begun:
        return f"its run did not end, or still goes on; what it recorded is in {', '.join(begun)} beside it"
    return "`gfor run` writes one a scenario"

"""Reads the recording of a run of ours from the disk: a whole one, or one that grows.

Whichever file a user names, also a measured one: `trajectory`."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.core.late import xr
from orchestrator.output.results.manifest import ResultsWarning
from orchestrator.output.results.netcdf import DAMAGED, Piece, name_of, opened, stored_name
from orchestrator.output.results.recording_writer import ENDED_EARLY, parts_of

IN_MEMORY = 256_000_000  # size of a recording up to which it is read as a whole [bytes]
_SHOWN = ("units", "long_name")
_OF_NETCDF = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_FillValue"}


def open_recording(folder: Path) -> xr.Dataset:
    """Return what an unfinished recording holds, also while it grows; signals are read when they are used."""
    parts = parts_of(folder)
    if not parts:
        raise InputError(f"{folder}: nothing was recorded yet")
    attributes: Mapping[str, Any] = {}
    units: dict[str, dict[str, Any]] = {}
    pieces: list[Piece] = []
    rows = 0
    for part in parts:
        if int(part.stem) != rows:
            raise InputError(
                f"{folder}: the rows from number {rows} on are missing; the run has to be made again"
            )
        try:
            with opened(part) as file:
                pieces.append(Piece(part, rows, len(file["time"])))
                if part == parts[0]:
                    attributes, units = dict(file.attrs), _columns(file)
        except DAMAGED as error:
            raise InputError(
                f"{part}: it cannot be read as part of a recording: {error}"
            ) from error
        rows += pieces[-1].rows
    return _read_when_used(pieces, attributes, units)


def open_whole(path: Path) -> xr.Dataset:
    """A finished recording: in memory if it is of moderate size, else with signals that are read when they are used.

    Other NetCDF files, such as a sweep's, are read as well."""
    found = _of_ours(path)
    if found is None:
        stored = xr.open_dataset(path, cache=False)
        found = stored.rename({name: name_of(str(name)) for name in stored.data_vars})
        found.set_close(stored.close)
    if found.nbytes > IN_MEMORY:
        return found
    with found:
        return found.load()


def in_memory(dataset: xr.Dataset) -> bool:
    """Return whether nothing of a recording needs its files any more."""
    return dataset.nbytes <= IN_MEMORY


def _of_ours(path: Path) -> xr.Dataset | None:
    """A file of `RecordingFolder.join`; xarray would look at all its columns for the length of each of them."""
    try:
        with opened(path) as file:
            if not _is_ours(file):
                return None
            attributes, units, rows = dict(file.attrs), _columns(file), len(file["time"])
            if rows * len(units) * 8 > IN_MEMORY:
                return _read_when_used([Piece(path, 0, rows)], attributes, units)
            data = {
                name: ("time", file[stored_name(name)][...], about) for name, about in units.items()
            }
    except DAMAGED:  # no HDF5, as NetCDF-3 is not, or damaged; xarray says which
        return None
    return xr.Dataset(data, attrs=attributes)


def _is_ours(file: Any) -> bool:
    known = _OF_NETCDF.union(_SHOWN)
    shape = getattr(file.get("time"), "shape", ())
    return len(shape) == 1 and all(
        getattr(file[name], "shape", ()) == shape
        and file[name].dtype == float
        and known.issuperset(file[name].attrs)
        for name in file
    )


def _columns(file: Any) -> dict[str, dict[str, Any]]:
    """Unit and long name of all columns, by name, the time among them."""
    found = {}
    for stored in file:
        attributes = dict(file[stored].attrs)
        found[name_of(stored)] = {key: attributes[key] for key in _SHOWN if key in attributes}
    return found


def _read_when_used(
    pieces: Sequence[Piece], attributes: Mapping[str, Any], units: Mapping[str, Mapping[str, Any]]
) -> xr.Dataset:
    from orchestrator.output.results.xarray_columns import dataset_of  # noqa: PLC0415 - imports xarray

    return dataset_of(pieces, attributes, units)


def warn_of_early_end(dataset: xr.Dataset, label: str) -> None:
    """Warn, where the caller of the caller stands, about a run that ended before its stop time."""
    reason = dataset.attrs.get(ENDED_EARLY)
    if reason is not None:
        times = dataset["time"].values
        reached = f", at t = {float(times[-1]):.6g} s" if len(times) else ""
        warnings.warn(
            f"{label}: its run ended early{reached}: {reason}", ResultsWarning, stacklevel=3
        )

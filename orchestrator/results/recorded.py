"""What was recorded, read from the disk: a run's whole recording, or one that grows."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from orchestrator.errors import InputError
from orchestrator.results.manifest import ResultsWarning
from orchestrator.results.netcdf import DAMAGED, name_of, stored_name
from orchestrator.results.recording import ENDED_EARLY, parts_of

IN_MEMORY = 256_000_000
"""Size of a recording up to which it is read as a whole [bytes]."""

_SHOWN = ("units", "long_name")
_OF_NETCDF = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_FillValue"}


@dataclass(frozen=True)
class _Piece:
    """A file with some of the rows: the number of its first one, and how many they are."""

    path: Path
    first: int
    rows: int


class _Column(xr.backends.BackendArray):
    """A column of all files of a recording, of which the rows that are asked for are read."""

    def __init__(self, pieces: Sequence[_Piece], name: str) -> None:
        self._pieces, self._name = pieces, name
        self.shape, self.dtype = (sum(piece.rows for piece in pieces),), np.dtype(float)

    def __getitem__(self, key: Any) -> Any:
        return xr.core.indexing.explicit_indexing_adapter(
            key, self.shape, xr.core.indexing.IndexingSupport.BASIC, self._read
        )

    def _read(self, key: tuple[Any, ...]) -> Any:
        asked = range(self.shape[0])[key[0]]
        if isinstance(asked, int):
            return self._rows(asked, asked + 1)[0]
        if not asked:
            return np.empty(0)
        begin, end = min(asked[0], asked[-1]), max(asked[0], asked[-1]) + 1
        return self._rows(begin, end)[:: asked.step]

    def _rows(self, begin: int, end: int) -> NDArray[np.float64]:
        found, stored = np.empty(end - begin), stored_name(self._name)
        for piece in self._pieces:
            first, last = max(begin, piece.first), min(end, piece.first + piece.rows)
            if first < last:
                try:
                    with _opened(piece.path) as file:
                        found[first - begin : last - begin] = file[stored][first - piece.first : last - piece.first]
                except DAMAGED as error:
                    raise InputError(f"{piece.path}: {self._name!r} cannot be read: {error}") from error
        return found


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A file of HDF5, to be read."""
    import h5py  # noqa: PLC0415 - a tenth of a second that only recordings need

    with h5py.File(path, "r") as file:
        yield file


def open_recording(folder: Path) -> xr.Dataset:
    """What an unfinished recording holds, also while it grows; signals are read when they are used.

    Raises
    ------
    InputError
        If there is none, or a file of it is missing or cannot be read.
    """
    parts = parts_of(folder)
    if not parts:
        raise InputError(f"{folder}: nothing was recorded yet")
    attributes: Mapping[str, Any] = {}
    units: dict[str, dict[str, Any]] = {}
    pieces: list[_Piece] = []
    rows = 0
    for part in parts:
        if int(part.stem) != rows:
            raise InputError(f"{folder}: the rows from number {rows} on are missing; the run has to be made again")
        try:
            with _opened(part) as file:
                pieces.append(_Piece(part, rows, len(file["time"])))
                if part == parts[0]:
                    attributes, units = dict(file.attrs), _columns(file)
        except DAMAGED as error:
            raise InputError(f"{part}: it cannot be read as part of a recording: {error}") from error
        rows += pieces[-1].rows
    return _dataset(pieces, attributes, units)


def open_whole(path: Path) -> xr.Dataset:
    """A finished recording: in memory if it is of moderate size, else with signals that are read when they are used.

    Other NetCDF files, such as a sweep's, are read as well.
    """
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
    """Whether nothing of a recording needs its files any more."""
    return dataset.nbytes <= IN_MEMORY


def _of_ours(path: Path) -> xr.Dataset | None:
    """A file of `RecordingFolder.join`; xarray would look at all its columns for the length of each of them."""
    try:
        with _opened(path) as file:
            if not _is_ours(file):
                return None
            attributes, units, rows = dict(file.attrs), _columns(file), len(file["time"])
            if rows * len(units) * 8 > IN_MEMORY:
                return _dataset([_Piece(path, 0, rows)], attributes, units)
            data = {name: ("time", file[stored_name(name)][...], about) for name, about in units.items()}
    except DAMAGED:  # no HDF5, as NetCDF-3 is not, or damaged; xarray says which
        return None
    return xr.Dataset(data, attrs=attributes)


def _is_ours(file: Any) -> bool:
    known = _OF_NETCDF.union(_SHOWN)
    shape = getattr(file.get("time"), "shape", ())
    return len(shape) == 1 and all(
        getattr(file[name], "shape", ()) == shape and file[name].dtype == float and known.issuperset(file[name].attrs)
        for name in file
    )


def _columns(file: Any) -> dict[str, dict[str, Any]]:
    """Unit and long name of all columns, by name, the time among them."""
    found = {}
    for stored in file:
        attributes = dict(file[stored].attrs)
        found[name_of(stored)] = {key: attributes[key] for key in _SHOWN if key in attributes}
    return found


def _dataset(
    pieces: Sequence[_Piece], attributes: Mapping[str, Any], units: Mapping[str, Mapping[str, Any]]
) -> xr.Dataset:
    """Columns that are read when they are used, over the time.

    Parameters
    ----------
    pieces
        Files with the rows, in their order.
    attributes
        Of the whole.
    units
        Attributes of columns, by name; those of ``time`` as well.
    """
    data = {
        name: ("time", xr.core.indexing.LazilyIndexedArray(_Column(pieces, name)), about)
        for name, about in units.items()
        if name != "time"
    }
    time = _Column(pieces, "time")[xr.core.indexing.BasicIndexer((slice(None),))]
    return xr.Dataset(data, coords={"time": ("time", time, units["time"])}, attrs=attributes)


def warn_of_early_end(dataset: xr.Dataset, label: str) -> None:
    """Warn, where the caller of the caller stands, about a run that ended before its stop time."""
    reason = dataset.attrs.get(ENDED_EARLY)
    if reason is not None:
        times = dataset["time"].values
        reached = f", at t = {float(times[-1]):.6g} s" if len(times) else ""
        warnings.warn(f"{label}: its run ended early{reached}: {reason}", ResultsWarning, stacklevel=3)

"""Columns of a recording for xarray, read when they are used."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from orchestrator.core.errors import InputError
from orchestrator.output.results.netcdf import DAMAGED, Piece, opened, stored_name


class _Column(xr.backends.BackendArray):
    """A column of all files of a recording, of which the rows that are asked for are read."""

    def __init__(self, pieces: Sequence[Piece], name: str) -> None:
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
                    with opened(piece.path) as file:
                        found[first - begin : last - begin] = file[stored][
                            first - piece.first : last - piece.first
                        ]
                except DAMAGED as error:
                    raise InputError(
                        f"{piece.path}: {self._name!r} cannot be read: {error}"
                    ) from error
        return found


def dataset_of(
    pieces: Sequence[Piece], attributes: Mapping[str, Any], units: Mapping[str, Mapping[str, Any]]
) -> xr.Dataset:
    """Columns that are read when they are used, over the time.

    ``pieces``: files with the rows, in their order.
    ``units``: attributes of columns, by name; those of ``time`` as well."""
    data = {
        name: ("time", xr.core.indexing.LazilyIndexedArray(_Column(pieces, name)), about)
        for name, about in units.items()
        if name != "time"
    }
    time = _Column(pieces, "time")[xr.core.indexing.BasicIndexer((slice(None),))]
    return xr.Dataset(data, coords={"time": ("time", time, units["time"])}, attrs=attributes)

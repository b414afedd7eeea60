"""Files of a recording, each with some of its rows."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Piece:
    """A file with some of the rows: the number of its first one, and how many they are."""

    path: Path
    first: int
    rows: int


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """A file of HDF5, to be read."""
    import h5py  # noqa: PLC0415 - a tenth of a second that only recordings need

    with h5py.File(path, "r") as file:
        yield file

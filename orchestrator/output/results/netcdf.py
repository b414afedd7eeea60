"""NetCDF-4 files of columns over the time, in chunks that are compressed; HDF5 itself never writes to the disk.

When the disk is full, HDF5 ends the whole process. So its files are made in memory, or in a file whose place on the
disk was reserved before."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import RawIOBase
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.safe_files import replacing


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


LEVEL = 1  # of the compression: higher ones take twice the time for three parts in a hundred
_SLACK = 1_000_000  # what a file needs beside its columns, at most [bytes]

Attributes = Mapping[str, str | float]

# what h5py raises on a file that is cut short or damaged
DAMAGED = (OSError, KeyError, RuntimeError, ValueError)


def stored_name(name: str) -> str:
    """A column's name in a file: a ``/``, which FMI allows and HDF5 takes for a group, is written as ``%2F``."""
    return name.replace("%", "%25").replace("/", "%2F")


def name_of(stored: str) -> str:
    return stored.replace("%2F", "/").replace("%25", "%")


def netcdf_image(
    names: Sequence[str],
    times: NDArray[np.float64],
    values: NDArray[np.float64],
    units: Mapping[str, Attributes],
    attributes: Attributes,
    chunk: int,
) -> bytes:
    """A NetCDF-4 file as bytes.

    ``times``: [s], shape (n,).
    ``values``: shape (n, number of names).
    ``units``: attributes of columns, by name; those of ``time`` as well."""
    import h5py  # noqa: PLC0415 - a tenth of a second that only recordings need

    with h5py.File("image", "w", driver="core", backing_store=False, track_order=True) as file:
        columns = create_columns(file, names, len(times), units, attributes, chunk)
        for column, data in zip(columns, (times, *values.T), strict=True):
            if len(times):
                column[...] = data
        file.flush()
        return bytes(file.id.get_file_image())


def create_columns(
    file: Any,
    names: Sequence[str],
    rows: int,
    units: Mapping[str, Attributes],
    attributes: Attributes,
    chunk: int,
) -> list[Any]:
    """Empty columns of an HDF5 file, the time first, in the form that NetCDF-4 asks for."""
    form = {
        "shape": (rows,),
        "dtype": "<f8",
        "chunks": (chunk,),
        "maxshape": (rows or None,),
        "compression": "gzip",
        "compression_opts": LEVEL,
        "shuffle": True,
        "track_order": True,
    }
    time = file.create_dataset("time", **form)
    time.make_scale("time")
    columns = [time]
    for name in names:
        column = file.create_dataset(stored_name(name), **form)
        column.dims[0].attach_scale(time)
        column.attrs["_FillValue"] = np.array([np.nan])
        columns.append(column)
    for name, column in zip(("time", *names), columns, strict=True):
        column.attrs.update(units.get(name, {}))
    file.attrs.update(attributes)
    return columns


class ReservedFile(RawIOBase):
    """A file of a size that is reserved, for HDF5 to write into: no write can fail for want of room.

    Should one fail all the same, `error` keeps it and the rest is not written."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        super().__init__()
        self._file, self.size = file, 0
        self.error: OSError | None = None
        _reserve(file, size)

    def readinto(self, buffer: Any) -> int:
        """Read; behind the end there are zeros."""
        view = memoryview(buffer).cast("B")
        content = self._file.read(len(view))
        view[: len(content)] = content
        view[len(content) :] = bytes(len(view) - len(content))
        return len(view)

    def write(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        try:
            if self.error is None:
                self._file.write(view)
        except OSError as error:
            self.error = error
        self.size = max(self.size, self._file.tell())
        return len(view)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place; the end is that of what was written."""
        return (
            self._file.seek(self.size + offset)
            if whence == os.SEEK_END
            else self._file.seek(offset, whence)
        )

    def tell(self) -> int:
        return self._file.tell()

    def truncate(self, size: int | None = None) -> int:
        self.size = self._file.tell() if size is None else size
        return self.size

    def flush(self) -> None:
        """The file is flushed at its end."""


def _reserve(file: BinaryIO, size: int) -> None:
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, size)
        return
    zeros = bytes(1 << 20)
    for begin in range(0, size, len(zeros)):
        file.write(zeros[: size - begin])
    file.flush()
    file.seek(0)


def join_netcdf(
    parts: Sequence[Path],
    path: Path,
    names: Sequence[str],
    units: Mapping[str, Attributes],
    attributes: Attributes,
) -> None:
    """Join files of `netcdf_image`, of whole chunks but for the last, to one; chunks are copied as they are."""
    import h5py  # noqa: PLC0415 - as above

    room = sum(part.stat().st_size for part in parts) + _SLACK
    with replacing(path) as partial, partial.open("w+b", buffering=0) as raw:
        target = ReservedFile(raw, room)
        with h5py.File(target, "w", track_order=True) as file:
            rows = [_rows(part) for part in parts]
            columns = create_columns(file, names, sum(rows), units, attributes, max(rows))
            begin = 0
            for part, count in zip(parts, rows, strict=True):
                with opened(part) as source:
                    for column, name in zip(columns, ("time", *names), strict=True):
                        _copy(source[stored_name(name)], column, begin, count)
                begin += count
        if target.error is not None:
            raise target.error
        raw.truncate(target.size)


def _rows(part: Path) -> int:
    with opened(part) as file:
        return len(file["time"])


def _copy(source: Any, target: Any, begin: int, count: int) -> None:
    """Rows of one column: as compressed bytes where they are a whole chunk of both."""
    if source.chunks == target.chunks == (count,) and begin % count == 0:
        mask, content = source.id.read_direct_chunk((0,))
        target.id.write_direct_chunk((begin,), content, mask)
    elif count:
        target[begin : begin + count] = source[...]

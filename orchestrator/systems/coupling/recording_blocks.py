"""Blocks of recorded rows: how many rows wait in memory, for how long, and what takes them then: memory, or a sink such
as a folder on the disk (`orchestrator.output.results.recording_writer`)."""

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Block = tuple[int, NDArray[np.float64], NDArray[np.float64]]
"""Number of its first row; times [s], shape (n,); values, shape (n, number of names)."""


class RowSink(Protocol):
    def begin(self, names: Sequence[str]) -> None:
        """Called once before the first block, with the names of the columns."""

    def keep(self, first: int, times: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        """Take a block; one that was not full comes again, longer, with the same number of its first row."""

    def resume(self, names: Sequence[str], rows: int) -> Iterator[Block]:
        """Forget all rows from number ``rows`` on, and give the blocks before; the last one may be continued."""


class MemoryRows:
    """Each ``every``-th row of the blocks that it is given, as arrays that grow."""

    def __init__(self, columns: int, every: int = 1) -> None:
        self._columns, self._every = columns, every
        self._times: list[NDArray[np.float64]] = []
        self._values: list[NDArray[np.float64]] = []

    def clear(self) -> None:
        self._times, self._values = [], []

    def keep(self, first: int, times: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        begin = -first % self._every
        self._times.append(times[begin :: self._every].copy())
        self._values.append(values[begin :: self._every].copy())

    def joined(
        self, first: int, times: NDArray[np.float64], values: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and values of all that is kept, and of a last block that is not complete."""
        if len(self._times) > 1:
            self._times = [np.concatenate(self._times)]
            self._values = [np.concatenate(self._values)]
        begin = -first % self._every
        rest = times[begin :: self._every], values[begin :: self._every]
        if not self._times:
            return rest
        if not len(rest[0]):
            return self._times[0], self._values[0]
        return np.concatenate([self._times[0], rest[0]]), np.concatenate([self._values[0], rest[1]])


BLOCK_ROWS = 8192  # most rows of a block
# size of the largest block; the more is recorded, the fewer rows a block has
_BLOCK_BYTES = 8_000_000
_FEWEST_ROWS = 64
# rows of a block that is not full wait for at least so long until they are handed to the sink [s]
PATIENCE = 5.0
# they wait longer where handing them over would take a larger part of the time than this
_SHARE = 0.01


def rows_of_block(columns: int) -> int:
    """Return how many rows a block has, with a time beside this many values in each."""
    width = np.dtype(float).itemsize * (columns + 1)
    return max(_FEWEST_ROWS, min(BLOCK_ROWS, _BLOCK_BYTES // width))


def patience_after(seconds: float) -> float:
    """Return how long rows wait after a block took so long to hand over [s]."""
    return max(PATIENCE, seconds / _SHARE)

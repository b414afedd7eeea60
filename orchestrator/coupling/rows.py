"""Where recorded rows go: memory, or whatever else takes blocks of them."""

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

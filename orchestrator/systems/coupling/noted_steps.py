"""Variables that the loop in C reads after each communication step, for an observer that looks at many steps at once.

``inner_loop.c`` has the same two structures."""

import ctypes
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.devices.fmi.component import Component, RealBatch


class _Reading(ctypes.Structure):
    _fields_ = (
        ("component", ctypes.c_void_p),
        ("get_real", ctypes.c_void_p),
        ("references", ctypes.c_void_p),
        ("n", ctypes.c_int64),
    )


class RowsInC(ctypes.Structure):
    """The rows of one observer, as the loop fills them."""

    _fields_ = (
        ("readings", ctypes.c_void_p),
        ("values", ctypes.c_void_p),
        ("n_readings", ctypes.c_int64),
        ("width", ctypes.c_int64),
        ("most", ctypes.c_int64),
        ("filled", ctypes.c_int64),
        ("index", ctypes.c_int64),
    )


class NotedSteps:
    """Rows of variables, one for each communication step since somebody last took them.

    ``batches``: What is read, one after the other in each row. ``most``: Steps after which the rows are taken at the
    latest; the loop does not read beyond. ``time``: Of a communication point [s]."""

    def __init__(
        self, batches: Sequence[RealBatch], most: int, time: Callable[[int], float]
    ) -> None:
        self._batches, self._time = list(batches), time
        self._values = np.zeros((most, sum(len(batch.names) for batch in batches)))
        self._readings = (_Reading * len(batches))()
        for reading, batch in zip(self._readings, batches, strict=True):
            reading.component, reading.references, reading.n, _ = batch.arguments
            reading.get_real = ctypes.cast(batch.component.get_real, ctypes.c_void_p).value
        self._in_c = RowsInC(
            readings=ctypes.addressof(self._readings),
            values=self._values.ctypes.data,
            n_readings=len(batches),
            width=self._values.shape[1],
            most=most,
        )
        self.address: int | None = ctypes.addressof(self._in_c)  # None once nobody takes them

    def component(self, reading: int) -> Component:
        """The component of a batch, by the batch's place."""
        return self._batches[reading].component

    def take(self) -> tuple[list[int], list[float], NDArray[np.float64]]:
        """Return indices, times [s] and rows of the steps that wait; the rows hold until the next step."""
        filled, self._in_c.filled = self._in_c.filled, 0
        indices = list(range(self._in_c.index - filled + 1, self._in_c.index + 1))
        return indices, [self._time(index) for index in indices], self._values[:filled]

    def close(self) -> None:
        """Let the loop read no more."""
        self.address = None

"""Where the coupled outputs went between two looks at them: what no recording at longer intervals can tell."""

import numpy as np
from numpy.typing import NDArray

_LOW, _HIGH, _LAST, _CHANGE, _TURNS = range(5)


class Tracks:
    """Extremes of every coupled output over the communication steps since the last look, and how often it turned.

    The inner loop keeps them, in C as in Python; ``inner_loop.c`` has the same five numbers an output."""

    def __init__(self, count: int, more: int = 0) -> None:
        self._whole = np.zeros((count + more, 5))
        self._table = self._whole[:count]

    @property
    def low(self) -> NDArray[np.float64]:
        return self._table[:, _LOW]

    @property
    def high(self) -> NDArray[np.float64]:
        return self._table[:, _HIGH]

    @property
    def turns(self) -> NDArray[np.float64]:
        """How often each output went the other way; an oscillation does so twice a period."""
        return self._table[:, _TURNS]

    def address(self, first: int) -> int:
        """Where in memory the numbers of an output begin."""
        return int(self._whole.ctypes.data + first * self._whole.strides[0])

    def look(self, y: NDArray[np.float64]) -> None:
        """Begin anew from these values of the outputs."""
        self._table[:, _LOW] = self._table[:, _HIGH] = self._table[:, _LAST] = y
        self._table[:, _TURNS] = 0.0

    def saved(self) -> NDArray[np.float64]:
        """All that is known of the time since the last look, for `restore`."""
        return self._table.copy()

    def restore(self, saved: NDArray[np.float64]) -> None:
        self._table[:] = saved

    def follow(self, window: slice, values: NDArray[np.float64]) -> int | None:
        """Note new values of some outputs; the index of the first that is no finite number, if there is one."""
        finite = np.isfinite(values)
        if not finite.all():
            return int(np.argmin(finite))
        part = self._whole[window]
        change = values - part[:, _LAST]
        np.minimum(part[:, _LOW], values, out=part[:, _LOW])
        np.maximum(part[:, _HIGH], values, out=part[:, _HIGH])
        part[:, _TURNS] += change * part[:, _CHANGE] < 0
        np.copyto(part[:, _CHANGE], change, where=change != 0)
        part[:, _LAST] = values
        return None

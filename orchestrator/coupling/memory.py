"""Arrays in memory of their own: two threads that write to one line of the processor's cache wait for each other."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

LINE = 128  # bytes that a processor may fetch together: two lines of 64


def apart(count: int, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """An array of zeros, shape (count,), that shares no line with anything else."""
    size = count * np.dtype(dtype).itemsize
    memory = np.zeros(size + 2 * LINE, dtype=np.uint8)
    first = -memory.ctypes.data % LINE
    return memory[first : first + size].view(dtype)

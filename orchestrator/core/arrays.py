"""Names for arrays of numbers in signatures, and their size."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]  # real numbers, of any shape
Matrix = NDArray[np.float64]  # real numbers in rows and columns
Complex = NDArray[np.complex128]  # complex numbers, of any shape
Vector = NDArray[Any]  # real or complex numbers
Flags = NDArray[np.bool_]  # yes or no, of any shape


def rms(values: Vector) -> float:
    """Return the root mean square of real or complex numbers; 0 of none."""
    return float(np.sqrt(np.mean(np.abs(values) ** 2))) if len(values) else 0.0

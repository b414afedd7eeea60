"""Names for arrays of numbers in signatures."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
"""Real numbers, of any shape."""

Matrix = NDArray[np.float64]
"""Real numbers in rows and columns."""

Complex = NDArray[np.complex128]
"""Complex numbers, of any shape."""

Vector = NDArray[Any]
"""Real or complex numbers."""

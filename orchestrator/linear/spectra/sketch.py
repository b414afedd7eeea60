"""Short images of long vectors that keep their lengths and angles, so that angles cost little.

To make a vector orthogonal to many others reads all of them twice, for the angles and for what is taken away. Angles of
short images make vectors that are orthogonal in their images alone: they are as independent, and the others are read
once. Balabanov and Grigori, "Randomized Gram–Schmidt process with application to GMRES", SIAM Journal on Scientific
Computing 44 (2022), A1450."""

from functools import lru_cache

import numpy as np
import scipy.sparse as sp

_PLACES = 8
"""Elements of an image to which each element of a vector is added, with a random sign."""


@lru_cache(maxsize=2)
def sketch(size: int, rows: int) -> sp.csc_array:
    """Return S of shape (rows, size): S·x has nearly the length of x, whatever x is.

    Lengths of all vectors of a space of k dimensions change by a part of about √(k/rows) at most. Where vectors have no
    more elements than rows are asked for, S is the identity."""
    if rows >= size:
        return sp.csc_array(sp.eye_array(size))
    random = np.random.default_rng(0)  # the same search gives the same answer
    signs = random.choice((-1.0, 1.0), size=(_PLACES, size)) / np.sqrt(_PLACES)
    places = random.integers(rows, size=(_PLACES, size))
    columns = np.tile(np.arange(size), _PLACES)
    return sp.csc_array((signs.ravel(), (places.ravel(), columns)), shape=(rows, size))

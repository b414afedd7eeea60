"""Similarity of two modes by their eigenvectors, which does not depend on the order of eigenvalues.

With lᴴ·r = 1 for both, |l_aᴴ·r_b|·|l_bᴴ·r_a| is 1 for a mode and itself, 0 for two modes of the same matrix, and does
not depend on the units of the states, as a comparison of mode shapes alone would."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.arrays import Vector


def similarity(left_a: Vector, right_a: Vector, left_b: Vector, right_b: Vector) -> NDArray[np.float64]:
    """|l_aᴴ·r_b|·|l_bᴴ·r_a| of every mode a with every mode b, shape (m_a, m_b)."""
    forth = left_a.conj() @ right_b.T
    back = (left_b.conj() @ right_a.T).T
    return np.asarray(np.abs(forth * back), dtype=float)

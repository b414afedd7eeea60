"""A − σI of one linear model at many points σ: the sparse equations are put together once, and factorised at each."""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.analysis.linear_model import LinearModel
from orchestrator.arrays import Vector
from orchestrator.errors import AnalysisError


class Factors:
    def __init__(self, lu: spla.SuperLU, states: int) -> None:
        self._lu, self._n = lu, states

    def solve(self, right: Vector, *, adjoint: bool = False) -> Vector:
        """X with (A − σI)·X = right, or (A − σI)ᴴ·X = right."""
        whole = np.zeros((self._lu.shape[0], right.shape[1]), dtype=complex)
        whole[: self._n] = right
        solution: Vector = self._lu.solve(whole, "H" if adjoint else "N")[: self._n]
        return solution

    @property
    def log_determinant(self) -> complex:
        """Log det(A − σI), but for a constant of the model; its imaginary part lacks whole turns."""
        diagonal = self._lu.U.diagonal()
        flips = _odd(self._lu.perm_r) ^ _odd(self._lu.perm_c)
        return complex(np.log(diagonal.astype(complex)).sum() + 1j * np.pi * flips)


class ShiftedEquations:
    def __init__(self, model: LinearModel) -> None:
        n, m = model.G.shape
        parts = sp.block_array([[model.F, model.G], [model.H, model.K - sp.eye_array(m)]], format="coo")
        rows, columns = (np.concatenate([place, np.arange(n)]) for place in parts.coords)
        values = np.concatenate([parts.data, np.zeros(n)])  # a diagonal element that is 0 needs its place, too
        whole = sp.coo_array((values, (rows, columns)), shape=(n + m, n + m)).tocsc()
        column_of = np.repeat(np.arange(n + m), np.diff(whole.indptr))
        self._diagonal = np.flatnonzero((whole.indices == column_of) & (column_of < n))
        self._whole, self._n = whole.astype(complex), n

    def at(self, sigma: complex) -> Factors:
        shifted = self._whole.copy()
        shifted.data[self._diagonal] -= sigma
        try:
            return Factors(spla.splu(shifted, options={"Equil": False}), self._n)
        except RuntimeError as error:
            raise AnalysisError(f"{sigma:.6g} is an eigenvalue itself; look from a point beside it") from error


def _odd(permutation: NDArray[np.int32]) -> bool:
    """Whether a permutation is odd: an even number of its cycles lacks to its length."""
    n = len(permutation)
    cycles = sp.coo_array((np.ones(n), (np.arange(n), permutation)), shape=(n, n))
    count, _ = sp.csgraph.connected_components(cycles, directed=False)
    return bool((n - count) % 2)

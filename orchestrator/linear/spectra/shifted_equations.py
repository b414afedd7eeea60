"""A − σI of one linear model at many points σ, and how many modes grow, without finding them.

The sparse equations are put together once, and factorised at each point. The number of growing modes is that of the
turns of det(A − sI) along the imaginary axis. It does not come from any search, so it shows whether a search has missed
a mode. The logarithm of the determinant is followed from point to point, and points are added where it changes quickly.
The eigenvalues of the components alone are divided out first: what is left comes to rest far from 0."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.arrays import Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel


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
        parts = sp.block_array(
            [[model.F, model.G], [model.H, model.K - sp.eye_array(m)]], format="coo"
        )
        rows, columns = (np.concatenate([place, np.arange(n)]) for place in parts.coords)
        # a diagonal element that is 0 needs its place, too
        values = np.concatenate([parts.data, np.zeros(n)])
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
            raise AnalysisError(
                f"{sigma:.6g} is an eigenvalue itself; look from a point beside it"
            ) from error


def _odd(permutation: NDArray[np.int32]) -> bool:
    """Return whether a permutation is odd: an even number of its cycles lacks to its length."""
    n = len(permutation)
    cycles = sp.coo_array((np.ones(n), (np.arange(n), permutation)), shape=(n, n))
    count, _ = sp.csgraph.connected_components(cycles, directed=False)
    return bool((n - count) % 2)


# eigenvalues to the right of this count as growing [1/s]: what is closer to 0 may be the free angle
GROWING = 2e-3

_STEP = 0.7
"""Largest change of the logarithm between two points, and from one half of the way to the other. An angle alone could
make a whole turn unseen; the size of the determinant shows it."""

_HALVINGS = 40
"""How often the way between two points is halved; a line that is closer to an eigenvalue than that cannot be
followed."""

_FARTHEST = 1e7  # end of the imaginary axis [rad/s]: beyond it no part of a system answers any more
_FIRST = 160  # points to begin with, from 1e-3 rad/s to the end


def count_growing(equations: ShiftedEquations, alone: Sequence[complex] | Vector) -> int:
    """Number of eigenvalues to the right of `GROWING`, at any frequency; a pair counts twice.

    ``alone``: all eigenvalues of its components, each alone with its inputs held [rad/s]. Far from 0, the system's
    determinant is theirs."""
    poles = np.asarray(alone, dtype=complex)

    def logarithm(s: complex) -> complex:
        return equations.at(s).log_determinant - complex(np.log(s - poles).sum())

    axis = (GROWING + 1j * np.concatenate([[0.0], np.geomspace(1e-3, _FARTHEST, _FIRST)])).tolist()
    values = [logarithm(s) for s in axis]
    turn = 0.0
    for (s_0, f_0), (s_1, f_1) in pairwise(zip(axis, values, strict=True)):
        waiting = [(s_0, f_0, s_1, f_1, 0)]
        while waiting:
            a, f_a, b, f_b, depth = waiting.pop()
            middle = (a + b) / 2
            f = logarithm(middle)
            first, second = _wrapped(f - f_a), _wrapped(f_b - f)
            if max(abs(first), abs(second), abs(second - first)) <= _STEP:
                turn += (first + second).imag
            elif depth == _HALVINGS:
                raise AnalysisError(
                    f"an eigenvalue lies at {a:.6g} rad/s, on the line where growth begins"
                )
            else:
                waiting += [(middle, f, b, f_b, depth + 1), (a, f_a, middle, f, depth + 1)]
    return int((poles.real > GROWING).sum()) - round(turn / np.pi)


def _wrapped(change: complex) -> complex:
    """The same logarithm with an angle from −π to π [rad]."""
    return complex(change.real, (change.imag + np.pi) % (2 * np.pi) - np.pi)

"""A − σI of one linear model at many points σ, and how many modes grow, without finding them.

The equations are put together once, and factorised at each point: by blocks and a hub where the model has one, sparse
elsewhere. The number of growing modes is that of the turns of det(A − sI) along the imaginary axis. It does not come
from any search, so it shows whether a search has missed a mode. The logarithm of the determinant is followed from point
to point, and points are added where it changes quickly. As many poles as there are modes are divided out first: the
eigenvalues of the components alone, some of them replaced by known modes beside them. What is left comes to rest far
from 0, and changes the less the more alike poles and modes are; the count does not depend on the poles."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.arrays import Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.hub_elimination import HubFactors
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.separate_blocks import SparseFactors


class Factors:
    """Equations of states and wires at one point, with a sparse factorisation."""

    def __init__(self, lu: spla.SuperLU, states: int) -> None:
        self._factors, self._states, self._size = SparseFactors(lu), states, lu.shape[0]

    def solve(self, right: Vector, *, adjoint: bool = False) -> Vector:
        """X with (A − σI)·X = right, or (A − σI)ᴴ·X = right."""
        whole = np.zeros((self._size, right.shape[1]), dtype=complex)
        whole[: self._states] = right
        return self._factors.solve(whole, "H" if adjoint else "N")[: self._states]

    @property
    def log_determinant(self) -> complex:
        """Log det(A − σI), but for a constant of the model; its imaginary part lacks whole turns."""
        return self._factors.log_determinant


@dataclass(frozen=True)
class FactorsByHub:
    """The same by blocks and a hub; the constant is the same as that of the sparse factors."""

    factors: HubFactors

    def solve(self, right: Vector, *, adjoint: bool = False) -> Vector:
        """See `Factors.solve`."""
        factors = self.factors
        return (factors.solve_adjoint_exactly if adjoint else factors.solve_exactly)(right)

    @property
    def log_determinant(self) -> complex:
        """See `Factors.log_determinant`."""
        return self.factors.log_determinant


class ShiftedEquations:
    def __init__(self, model: LinearModel) -> None:
        n, self._hub = len(model.names), model.hub
        parts = sp.coo_array(_whole_of(model) if self._hub is None else self._hub.whole)
        size = parts.shape[0]
        rows, columns = (np.concatenate([place, np.arange(n)]) for place in parts.coords)
        # a diagonal element that is 0 needs its place, too
        values = np.concatenate([parts.data, np.zeros(n)])
        whole = sp.coo_array((values, (rows, columns)), shape=(size, size)).tocsc()
        column_of = np.repeat(np.arange(size), np.diff(whole.indptr))
        self._diagonal = np.flatnonzero((whole.indices == column_of) & (column_of < n))
        self._whole, self._n = whole.astype(complex), n

    def at(self, sigma: complex) -> Factors | FactorsByHub:
        found = None if self._hub is None else self._hub.at(complex(sigma))
        return self._sparse_at(sigma) if found is None else FactorsByHub(found)

    def _sparse_at(self, sigma: complex) -> Factors:
        shifted = self._whole.copy()
        shifted.data[self._diagonal] -= sigma
        try:
            return Factors(spla.splu(shifted, options={"Equil": False}), self._n)
        except RuntimeError as error:
            raise AnalysisError(
                f"{sigma:.6g} is an eigenvalue itself; look from a point beside it"
            ) from error


def _whole_of(model: LinearModel) -> sp.coo_array:
    """The equations of states and wires."""
    wires = model.K.shape[0]
    quadrants = [[model.F, model.G], [model.H, model.K - sp.eye_array(wires)]]
    return sp.block_array(quadrants, format="coo")


# eigenvalues to the right of this count as growing [1/s]: what is closer to 0 may be the free angle
GROWING = 2e-3

_STEP = 0.7
"""Largest change of the logarithm between two points, and from one half of the way to the other. An angle alone could
make a whole turn unseen; the size of the determinant shows it."""

_HALVINGS = 40
"""How often the way between two points is halved; a line that is closer to an eigenvalue than that cannot be
followed."""

_ON_THE_LINE = 2 * GROWING
"""A known eigenvalue nearer to the imaginary axis than this [1/s] is no pole: a pole on the line cannot be passed."""

_BESIDE = 0.1
"""At the height of a pole nearer to the line than this part of it there is a point: a mode across the line from a pole
next to it would be unseen from afar."""

_OF_A_CROWD = 2
"""So many poles that oscillate have a point together, whatever they are damped: where many modes cross the line in one
stretch, a turn of the determinant from one point to the next would be taken for none."""

_SAME_HEIGHT = 1e-4  # heights that differ by a smaller part have one point

_FARTHEST = 1e7  # end of the imaginary axis [rad/s]: beyond it no part of a system answers any more
_FIRST = 160  # points to begin with, from 1e-3 rad/s to the end


def count_growing(
    equations: ShiftedEquations,
    alone: Sequence[complex] | Vector,
    known: Sequence[complex] | Vector = (),
) -> int:
    """Number of eigenvalues to the right of `GROWING`, at any frequency; a pair counts twice.

    ``alone``: all eigenvalues of its components, each alone with its inputs held [rad/s]. Far from 0, the system's
    determinant is theirs.
    ``known``: eigenvalues with Im λ > 0 that the system is thought to have [rad/s]. They spare points, and right or
    wrong they leave the count as it is."""
    poles = _with_known(np.asarray(alone, dtype=complex), np.asarray(known, dtype=complex))

    def logarithm(s: complex) -> complex:
        return equations.at(s).log_determinant - complex(np.log(s - poles).sum())

    axis = (GROWING + 1j * _heights(poles)).tolist()
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


def _heights(poles: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Heights of the first points on the line [rad/s], rising from 0."""
    beside = poles[np.abs(poles.real - GROWING) < _BESIDE * poles.imag].imag
    crowd = np.sort(poles[np.abs(poles.real) < poles.imag].imag)[::_OF_A_CROWD]
    among = np.sort(np.concatenate([np.geomspace(1e-3, _FARTHEST, _FIRST), beside, crowd]))
    apart = np.diff(among, prepend=0.0) > _SAME_HEIGHT * among
    return np.concatenate([[0.0], among[apart & (among <= _FARTHEST)]])


def _with_known(alone: Vector, known: Vector) -> NDArray[np.complex128]:
    """Replace pairs among ``alone`` by the known ones nearest to them, both of a pair; the number of values stays."""
    upper = alone[alone.imag > 0]
    lower, real = alone[alone.imag < 0], alone[alone.imag == 0]
    if len(upper) != len(lower):  # no real system's
        return alone
    pairs = upper.copy()
    free = np.ones(len(pairs), dtype=bool)
    for value in known[(known.imag > 0) & (np.abs(known.real) > _ON_THE_LINE)]:
        if not free.any():
            break
        place = int(np.argmin(np.where(free, np.abs(upper - value), np.inf)))
        pairs[place], free[place] = value, False
    return np.concatenate([real, pairs, pairs.conj()]).astype(complex)


def _wrapped(change: complex) -> complex:
    """The same logarithm with an angle from −π to π [rad]."""
    return complex(change.real, (change.imag + np.pi) % (2 * np.pi) - np.pi)

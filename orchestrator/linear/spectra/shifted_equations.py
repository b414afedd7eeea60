"""A − σI of one linear model at many points, and how many modes grow, without finding them.

Points are given in the plane of λ [rad/s]: of a step map, σ = exp(λ·H). The equations are put together once, and
factorised at each point: by blocks and a hub where the model has one, sparse elsewhere. The number of growing modes is
that of the turns of det(A − sI) along the imaginary axis. It does not come from any search, so it shows whether a
search has missed a mode. The logarithm of the determinant is followed from point to point, and points are added where
it changes quickly. As many poles as there are modes are divided out first: the eigenvalues of the components alone,
some of them replaced by known modes beside them. What is left comes to rest far from 0, and changes the less the more
alike poles and modes are; the count does not depend on the poles."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.arrays import Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.hub_elimination import HubFactors
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.separate_blocks import SparseFactors

Points = NDArray[np.complex128]


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


_ROUND = 65  # points on a circle whose image is looked at


class ShiftedEquations:
    def __init__(self, model: LinearModel) -> None:
        self.model = model
        n, self._hub = len(model.names), model.hub
        parts = sp.coo_array(_whole_of(model) if self._hub is None else self._hub.whole)
        size = parts.shape[0]
        rows, columns = (np.concatenate([place, np.arange(n)]) for place in parts.coords)
        # a diagonal element that is 0 needs its place, too
        values = np.concatenate([parts.data, np.zeros(n)])
        whole = sp.coo_array((values, (rows, columns)), shape=(size, size)).tocsc()
        column_of = np.repeat(np.arange(size), np.diff(whole.indptr))
        self._diagonal = np.flatnonzero((whole.indices == column_of) & (column_of < n))
        self._whole, self._n, self._step = whole.astype(complex), n, model.step_size

    def log_determinants(self, points: Points) -> Points:
        """Log det(A − sI) at each point of a continuous model; see `Determinants`."""
        if self._step is not None:
            raise ValueError("a step map's determinant turns along a circle, and not along a line")
        return np.array([self.at(s).log_determinant for s in points.tolist()])

    def at(self, rate: complex) -> Factors | FactorsByHub:
        """The equations at a point λ [rad/s]."""
        sigma = self._own(rate)
        found = None if self._hub is None else self._hub.at(complex(sigma))
        return self._sparse_at(sigma) if found is None else FactorsByHub(found)

    def rates_around(self, rate: complex, nu: Vector) -> NDArray[np.complex128]:
        """Eigenvalues λ [rad/s] from those of (A − σI)⁻¹ at a point."""
        own = np.asarray(self._own(rate) + 1 / nu, dtype=complex)
        return own if self._step is None else np.asarray(np.log(own) / self._step)

    def reach(self, rate: complex, radius: float) -> float:
        """Distance from a point's σ of the farthest point of a circle around λ [rad/s]."""
        if self._step is None:
            return radius
        circle = rate + radius * np.exp(1j * np.linspace(0, 2 * np.pi, _ROUND))
        return float(np.abs(np.exp(circle * self._step) - self._own(rate)).max())

    def _own(self, rate: complex) -> complex:
        return rate if self._step is None else complex(np.exp(rate * self._step))

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

_MULTIPLIED = 16
"""So many distances [rad/s] are multiplied before a logarithm is taken: at most 1e9 and at least 1e-9 each, they stay
far inside of what a number holds."""

_BESIDE = 0.1
"""At the height of a pole nearer to the line than this part of it there is a point: a mode across the line from a pole
next to it would be unseen from afar."""

_OF_A_CROWD = 2
"""So many poles that oscillate have a point together, whatever they are damped: where many modes cross the line in one
stretch, a turn of the determinant from one point to the next would be taken for none."""

_SAME_HEIGHT = 1e-4  # heights that differ by a smaller part have one point

_FARTHEST = 1e7  # end of the imaginary axis [rad/s]: beyond it no part of a system answers any more
_FIRST = 160  # points to begin with, from 1e-3 rad/s to the end


class Determinants(Protocol):
    """Gives log det(A − sI) at points s, but for a constant; imaginary parts lack whole turns."""

    def log_determinants(self, points: Points) -> Points: ...


def count_growing(
    equations: Determinants,
    alone: Sequence[complex] | Vector,
    known: Sequence[complex] | Vector = (),
    *,
    line: float = GROWING,
    clear: float = GROWING,
) -> int:
    """Number of eigenvalues of a continuous model to the right of a line, at any frequency; a pair counts twice.

    ``alone``: all eigenvalues of its components, each alone with its inputs held [rad/s]. Far from 0, the system's
    determinant is theirs.
    ``known``: eigenvalues with Im λ > 0 that the system is thought to have [rad/s]. They spare points, and right or
    wrong they leave the count as it is.
    ``line``: the real part of all its points [1/s].
    ``clear``: a known eigenvalue nearer to the line than this [1/s] is no pole, as a pole on it cannot be passed."""
    alone, known = np.asarray(alone, dtype=complex), np.asarray(known, dtype=complex)
    poles = _with_known(alone, known[np.abs(known.real - line) > clear])

    def logarithms(points: Points) -> Points:
        return equations.log_determinants(points) - sum_of_logarithms(points, poles)

    axis: Points = np.asarray(line + 1j * _heights(poles, line), dtype=complex)
    values = logarithms(axis)
    starts, ends = (axis[:-1], values[:-1]), (axis[1:], values[1:])
    turn = 0.0
    for _ in range(_HALVINGS + 1):
        middle = (starts[0] + ends[0]) / 2
        f = logarithms(middle)
        first, second = _wrapped(f - starts[1]), _wrapped(ends[1] - f)
        largest = np.max(np.abs([first, second, second - first]), axis=0)
        open_ = ~(largest <= _STEP)
        turn += float((first + second).imag[~open_].sum())
        if not open_.any():
            return int((poles.real > line).sum()) - round(turn / np.pi)
        halves = (middle[open_], f[open_])
        starts, ends = (
            _joined((starts[0][open_], starts[1][open_]), halves),
            _joined(halves, (ends[0][open_], ends[1][open_])),
        )
    raise AnalysisError(
        f"an eigenvalue lies at {starts[0][0]:.6g} rad/s, on the line where growth begins"
    )


def _joined(one: tuple[Points, Points], other: tuple[Points, Points]) -> tuple[Points, Points]:
    """Points with their values, and others behind them."""
    return np.concatenate([one[0], other[0]]), np.concatenate([one[1], other[1]])


def sum_of_logarithms(points: Points, poles: Points) -> Points:
    """Σ ln(s − p) at each point s, but for whole turns."""
    found = np.zeros(len(points), dtype=complex)
    for some in in_parts(poles):
        found += np.log((points - some[:, None]).prod(axis=0))
    return found


def in_parts(values: NDArray[Any]) -> list[NDArray[Any]]:
    """The values in parts of as many as may be multiplied before a logarithm is taken."""
    return np.split(values, range(_MULTIPLIED, len(values), _MULTIPLIED))


def _heights(poles: Points, line: float) -> NDArray[np.float64]:
    """Heights of the first points on the line [rad/s], rising from 0."""
    beside = poles[np.abs(poles.real - line) < _BESIDE * poles.imag].imag
    crowd = np.sort(poles[np.abs(poles.real) < poles.imag].imag)[::_OF_A_CROWD]
    among = np.sort(np.concatenate([np.geomspace(1e-3, _FARTHEST, _FIRST), beside, crowd]))
    apart = np.diff(among, prepend=0.0) > _SAME_HEIGHT * among
    return np.concatenate([[0.0], among[apart & (among <= _FARTHEST)]])


def _with_known(alone: Points, known: Points) -> Points:
    """Replace pairs among ``alone`` by the known ones nearest to them, both of a pair; the number of values stays."""
    upper = alone[alone.imag > 0]
    lower, real = alone[alone.imag < 0], alone[alone.imag == 0]
    if len(upper) != len(lower):  # no real system's
        return alone
    pairs = upper.copy()
    free = np.ones(len(pairs), dtype=bool)
    for value in known[known.imag > 0]:
        if not free.any():
            break
        place = int(np.argmin(np.where(free, np.abs(upper - value), np.inf)))
        pairs[place], free[place] = value, False
    return np.concatenate([real, pairs, pairs.conj()]).astype(complex)


def _wrapped(change: Points) -> Points:
    """The same logarithms with angles from −π to π [rad]."""
    wrapped: Points = change.real + 1j * ((change.imag + np.pi) % (2 * np.pi) - np.pi)
    return wrapped

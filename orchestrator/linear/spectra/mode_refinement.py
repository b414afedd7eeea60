"""Modes of a model from those of a similar one, and critical modes beside them.

The first are found by two-sided inverse iteration in the space of all of them: the known eigenvectors of both sides,
improved by one solution each at a point near their eigenvalues, span a small space; its eigenvalues are those of the
model up to the square of what the vectors still lack.

Where the modes of one operating point are made from those of another, a mode that was not critical there, or not there
at all, is missed. With the known modes projected out, Arnoldi's method around a few points finds what else lies
nearby; mostly nothing. Where many vectors are taken at once it is the search for critical modes itself that does so."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy.linalg
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.arrays import Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.critical_modes import eigenvalues_beside
from orchestrator.linear.spectra.modes import to_continuous
from orchestrator.linear.spectra.region_cells import RegionCell
from orchestrator.linear.spectra.shifted_equations import ShiftedEquations

_ROUNDS = 8
# the eigenvalues have settled where a round moves none of them by more than this part
_SETTLED = 1e-8
# what A·r may differ from λ·r by, as a part of λ and r. The eigenvalue has the square of it.
_REST = 1e-4
_SPREAD = 1.1  # eigenvalues whose sizes differ by up to this factor share a point
# by this part the point lies beside its eigenvalues' middle: on one nothing could be solved
_BESIDE = 1e-3


@dataclass(frozen=True)
class RefinedModes:
    """Eigenvalues λ [rad/s], shape (m,), with left and right eigenvectors as columns, shape (n, m)."""

    values: NDArray[np.complex128]
    left: Vector
    right: Vector
    # whether the last round left them where they were, with vectors that fit; others are not to be trusted
    settled: bool


def refine(
    model: LinearModel,
    equations: ShiftedEquations,
    values: NDArray[np.complex128],
    left: Vector,
    right: Vector,
) -> RefinedModes:
    """Modes of a model, continuous or a step map, from values and vectors that are nearly so."""
    settled = False
    for _ in range(_ROUNDS):
        new_left, new_right = left.copy(), right.copy()
        for members in _groups(values):
            middle = values[members].mean()
            factors = equations.at(middle * (1 + _BESIDE * (1 + 1j)))
            new_right[:, members] = factors.solve(right[:, members])
            new_left[:, members] = factors.solve(left[:, members], adjoint=True)
        new_right, new_left = (np.linalg.qr(vectors)[0] for vectors in (new_right, new_left))
        small, mass = new_left.conj().T @ model.apply(new_right), new_left.conj().T @ new_right
        if not np.isfinite(small + mass).all():
            break
        found, of_left, of_right = scipy.linalg.eig(small, mass, left=True, right=True)
        if not np.isfinite(found).all():
            break
        found, alive = to_continuous(found, model.step_size)
        if not alive.all():
            break
        order = _in_order_of(values, found)
        before, values = values, found[order]
        left, right = new_left @ of_left[:, order], new_right @ of_right[:, order]
        still = bool(np.all(np.abs(values - before) <= _SETTLED * np.abs(values)))
        # Eigenvalues have the square of the vectors' accuracy, and a state that is much faster than its mode shows
        # what a vector lacks enlarged: the values may stand still some rounds before the vectors are right.
        settled = still and _are_eigenvectors(model, values, right)
        if settled:
            break
    return RefinedModes(values, left, right, settled)


def _groups(values: NDArray[np.complex128]) -> list[NDArray[np.int64]]:
    """Places of eigenvalues of similar size."""
    order = np.argsort(np.abs(values), kind="stable")
    groups: list[list[int]] = []
    for k in order.tolist():
        if groups and abs(values[k]) <= _SPREAD * abs(values[groups[-1][0]]):
            groups[-1].append(k)
        else:
            groups.append([k])
    return [np.array(group, dtype=np.int64) for group in groups]


def _in_order_of(
    before: NDArray[np.complex128], found: NDArray[np.complex128]
) -> NDArray[np.int64]:
    """Places of what was found, each next to what it was before."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - half a second to import

    apart = np.abs(before[:, None] - found[None, :])
    apart[~np.isfinite(apart)] = np.finfo(float).max ** 0.5
    return np.asarray(linear_sum_assignment(apart)[1], dtype=np.int64)


def _are_eigenvectors(model: LinearModel, values: NDArray[np.complex128], right: Vector) -> bool:
    """Return whether A·r is λ·r, as far as rounding lets it be; of a step map, what is left over is by its step."""
    own = values if model.step_size is None else np.exp(values * model.step_size)
    rest = np.abs(model.apply(right) - right * own).max(axis=0) / (model.step_size or 1.0)
    return bool(np.all(rest <= _REST * np.maximum(1.0, np.abs(values)) * np.abs(right).max(axis=0)))


_STRETCH = 3.0  # ratio of the ends of a stretch of frequencies around each point
_GROWTH = 0.3  # how far into instability the search reaches: to this negative damping ratio
_AT_A_TIME = (2, 64)
"""Numbers of unknown eigenvalues to find around one point: the first, and the largest where that does not reach far
enough."""


_SMALLEST = (
    1e-4  # smallest size of a part of the region that is cut again, relative to its distance from 0
)
_ROUGH = 1e-3  # accuracy of what is found: enough to say whether something is there


def misses_modes(
    equations: ShiftedEquations, known: RefinedModes, lowest: float, highest: float, damping: float
) -> list[complex]:
    """Eigenvalues [rad/s] of a region beside the known ones.

    ``lowest`` and ``highest``: range of Im λ [rad/s], above 0.
    ``damping``: damping ratio below which nothing may be missed, down to −0.3. What is found is rough."""
    norms = np.einsum("ij,ij->j", known.left.conj(), known.right)
    left = (known.left / norms.conj()).conj().T
    region = RegionCell(lowest, highest, -_GROWTH, damping)
    if equations.model.is_searched_in_blocks:
        return eigenvalues_beside(equations.model, (left, known.right), region)
    edges = np.geomspace(
        lowest, highest, 1 + int(np.ceil(np.log(highest / lowest) / np.log(_STRETCH)))
    ).tolist()
    waiting = [replace(region, low=low, high=high) for low, high in pairwise(edges)]
    found: list[complex] = []
    while waiting:
        cell = waiting.pop(0)
        values = _unknown(equations, left, known.right, cell)
        if values is None:
            waiting += cell.halves()
        else:
            found += [value for value in values if cell.holds(value)]
    return found


def _unknown(
    equations: ShiftedEquations, left: Vector, right: Vector, cell: RegionCell
) -> list[complex] | None:
    """All unknown eigenvalues of a cell, and some others; None where they are too many for one search."""
    centre, n = cell.centre, right.shape[0]
    factors, reach = equations.at(centre), equations.reach(centre, cell.radius)

    def solve(vector: Vector) -> Vector:
        rest = vector.reshape(n, 1)
        rest = factors.solve(rest - right @ (left @ rest))
        found: Vector = (rest - right @ (left @ rest))[:, 0]
        return found

    # the same search gives the same answer
    start = np.random.default_rng(0).standard_normal((n,)).astype(complex)
    inverse = spla.LinearOperator((n, n), matvec=solve, dtype=complex)
    count, most = _AT_A_TIME
    while count <= min(most, n - 2):
        try:
            nu = spla.eigs(
                inverse,
                k=count,
                ncv=min(n, max(24, 3 * count)),
                v0=start,
                tol=_ROUGH,
                return_eigenvectors=False,
            )
        except spla.ArpackNoConvergence as error:
            raise AnalysisError(
                f"the search for modes around {centre:.3g} rad/s does not converge; compute the full spectrum"
            ) from error
        values = equations.rates_around(centre, nu)
        if (1 / np.abs(nu)).max() > reach:
            return [complex(value) for value in values]
        count *= 2
    if cell.radius < _SMALLEST * abs(centre):
        raise AnalysisError(
            f"more than {most} modes lie at {centre:.4g} rad/s; compute the full spectrum instead"
        )
    return None

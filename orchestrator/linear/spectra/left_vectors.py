"""Left eigenvectors of a few eigenvalues that are known, by inverse iteration from a point beside each.

A second search, in the adjoint equations, costs as much as the first one, whatever the number of vectors. Beside an
eigenvalue one factorisation and a few solutions give its vector."""

from collections.abc import Callable, Iterator

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from orchestrator.core.arrays import Vector
from orchestrator.linear.models.linear_model import LinearModel

MOST_POINTS = 4
"""Points beside eigenvalues up to which this costs less than a search in the adjoint equations: one is a factorisation,
and a search of 200 vectors takes as long as seven of them (2,869 buses), one of 144 as long as three and a half (9,241
buses)."""

_TOGETHER = 0.1
"""Eigenvalues nearer to each other than this part of their distance from the point of the search share a point, and
their vectors are found as one space."""

_BESIDE = 1e-5
"""Distance of a point from its eigenvalues, as a part of theirs from the point of the search. Each solution leaves of
other vectors as much as this distance is of theirs; what it loses in digits so close lies along the vector itself."""

_SOLUTIONS = 12  # from one point, at most

_SETTLED = 1e-7  # part of the vectors by which the last solution may have moved their space


def left_vectors(model: LinearModel, sigma: complex, nu: NDArray[np.complex128]) -> Vector | None:
    """Left eigenvectors as columns, shape (n, m), in the order of the eigenvalues, or vectors of the same space.

    They are to be proved: another eigenvalue beside the point leaves its part in them.

    Parameters
    ----------
    sigma
        Point of the search, in the plane of the eigenvalues μ of the model's matrix.
    nu
        1/(μ − σ) of the eigenvalues, shape (m,).

    Returns
    -------
    None where too many points would be needed, or the equations are not those of a large system with a hub.
    """
    mu, reach = sigma + 1 / nu, np.abs(1 / nu)
    groups = list(_groups(mu, reach))
    if len(groups) > MOST_POINTS:
        return None
    random = np.random.default_rng(0)  # the same search gives the same answer
    found = np.empty((len(model.names), len(nu)), dtype=complex)
    for members in groups:
        solve = model.solver_beside(complex(mu[members].mean() + _BESIDE * reach[members].mean()))
        if solve is None:
            return None
        found[:, members] = _space(solve, random.standard_normal((len(found), len(members))))
    return found


def _space(solve: Callable[[Vector], Vector], vectors: Vector) -> Vector:
    """Return a basis of the space into which repeated solutions turn as many vectors."""
    basis = np.linalg.qr(vectors.astype(complex))[0]
    for _ in range(_SOLUTIONS):
        before, basis = basis, np.linalg.qr(solve(basis))[0]
        if np.linalg.norm(before - basis @ (basis.conj().T @ before)) <= _SETTLED:
            break
    return basis


def _groups(mu: NDArray[np.complex128], reach: NDArray[np.float64]) -> Iterator[NDArray[np.int64]]:
    """Yield the places of eigenvalues that lie `_TOGETHER`."""
    near = np.abs(mu[:, None] - mu[None, :]) <= _TOGETHER * np.minimum.outer(reach, reach)
    count, group = sp.csgraph.connected_components(sp.csr_array(near), directed=False)
    for number in range(count):
        yield np.flatnonzero(group == number)

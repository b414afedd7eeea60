"""Eigenvalues that are zero, and the states in which they lie, from the sparse equations of a system of any size.

A zero that many have is found by no search with a few vectors. Beside 0 the zeros are by far the largest eigenvalues of
(A − σI)⁻¹: a space of as many vectors and more turns to theirs in a few solutions, from both sides. The participation
of a state in all of them together does not depend on how their eigenvectors are chosen."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from orchestrator.core.arrays import Vector
from orchestrator.core.threads import one_thread
from orchestrator.linear.models.linear_model import LinearModel, ShiftedSolver
from orchestrator.linear.spectra.modes import ZERO

_BESIDE = 1e-2  # σ [rad/s]
_WIDTHS = (8, 64, 256)  # vectors of the space: more are taken where half of them or more are zeros
_ROUNDS = 4
"""Solutions for each vector: next to 0 by 2e-3 rad/s, what is no zero of a space of 64 is less than 1e-5 rad/s of 35
zeros then (11,330 states)."""

_PARTAKES = 0.3
"""Participation from which on a state is named: of n regulators in parallel, each has 1 − 1/n. The free angle's share
is spread over all machines."""


@dataclass(frozen=True)
class ZeroSpace:
    """How many eigenvalues of a continuous model are zero, and the states that take part most."""

    count: int
    states: tuple[str, ...]


def zero_space(model: LinearModel) -> ZeroSpace:
    """The zeros of a continuous model, but for those of states that nothing moves."""
    coupled = model.coupled
    n, solver = len(coupled.names), coupled.shifted(complex(_BESIDE))
    for width in _WIDTHS:
        # the same search gives the same answer
        start = np.random.default_rng(0).standard_normal((n, min(width, n))) + 0j
        with one_thread():
            right = _turned(solver, start)
            nu, vectors = np.linalg.eig(right.conj().T @ _solved(solver, right))
        zeros = np.abs(_BESIDE + 1 / nu) <= ZERO
        if 2 * zeros.sum() < width or width >= n:
            break
    count = int(zeros.sum())
    if count < 2:
        return ZeroSpace(count, ())
    right = right @ scipy.linalg.orth(vectors[:, zeros])
    with one_thread():
        left = _turned(solver, right, adjoint=True)
    taking = ((right @ np.linalg.pinv(left.conj().T @ right)) * left.conj()).sum(axis=1).real
    most = [k for k in np.argsort(-taking, kind="stable").tolist() if taking[k] >= _PARTAKES]
    return ZeroSpace(count, tuple(coupled.names[k] for k in most))


def _turned(solver: ShiftedSolver, vectors: Vector, *, adjoint: bool = False) -> Vector:
    for _ in range(_ROUNDS):
        vectors = np.linalg.qr(_solved(solver, vectors, adjoint=adjoint))[0]
    return vectors


def _solved(solver: ShiftedSolver, vectors: Vector, *, adjoint: bool = False) -> Vector:
    solve = solver.solve_adjoint_exactly if adjoint else solver.solve_exactly
    if solver.takes_many:
        return solve(vectors)
    return np.stack([solve(column) for column in vectors.T], axis=1)

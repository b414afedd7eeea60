"""Modes of a model from those of a similar one, by two-sided inverse iteration in the space of all of them.

The known eigenvectors of both sides, improved by one solution each at a point near their eigenvalues, span a small
space; its eigenvalues are those of the model up to the square of what the vectors still lack."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.shifted_equations import ShiftedEquations
from orchestrator.arrays import Vector

_ROUNDS = 8
_SETTLED = 1e-8  # the eigenvalues have settled where a round moves none of them by more than this part
_REST = 1e-4  # what A·r may differ from λ·r by, as a part of λ and r. The eigenvalue has the square of it.
_SPREAD = 1.1  # eigenvalues whose sizes differ by up to this factor share a point
_BESIDE = 1e-3
"""The point lies beside the middle of its eigenvalues by this part: on one of them nothing could be solved."""


@dataclass(frozen=True)
class RefinedModes:
    """Eigenvalues λ [rad/s], shape (m,), with left and right eigenvectors as columns, shape (n, m)."""

    values: NDArray[np.complex128]
    left: Vector
    right: Vector
    settled: bool  # Whether the last round left them where they were. Others are not to be trusted.


def refine(
    model: LinearModel, equations: ShiftedEquations, values: NDArray[np.complex128], left: Vector, right: Vector
) -> RefinedModes:
    """Modes of a continuous model, from values and vectors that are nearly so."""
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
        order = _in_order_of(values, found)
        before, values = values, found[order]
        left, right = new_left @ of_left[:, order], new_right @ of_right[:, order]
        settled = bool(np.all(np.abs(values - before) <= _SETTLED * np.abs(values)))
        if settled:
            break
    return RefinedModes(values, left, right, settled and _are_eigenvectors(model, values, right))


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


def _in_order_of(before: NDArray[np.complex128], found: NDArray[np.complex128]) -> NDArray[np.int64]:
    """Places of what was found, each next to what it was before."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - half a second to import

    apart = np.abs(before[:, None] - found[None, :])
    apart[~np.isfinite(apart)] = np.finfo(float).max ** 0.5
    return np.asarray(linear_sum_assignment(apart)[1], dtype=np.int64)


def _are_eigenvectors(model: LinearModel, values: NDArray[np.complex128], right: Vector) -> bool:
    """Whether A·r is λ·r, as far as rounding lets it be."""
    moved = model.apply(right)
    rest = np.abs(moved - right * values).max(axis=0)
    return bool(np.all(rest <= _REST * np.maximum(1.0, np.abs(values)) * np.abs(right).max(axis=0)))

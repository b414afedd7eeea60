"""What a change of a linear model does to one eigenvalue, to first order, from its left and right eigenvectors."""

import numpy as np
import scipy.linalg

from orchestrator.analysis.linear_model import LinearModel
from orchestrator.arrays import Vector


def eigenvalue_shift(
    model: LinearModel, varied: LinearModel, eigenvalue: complex, left: Vector, right: Vector
) -> complex:
    """Δλ = lᴴ·(A' − A)·r [rad/s]; of a step map divided by μ·H, as λ = ln μ / H."""
    change = complex(np.vdot(left, _apply(varied, right) - _apply(model, right)))
    if model.step_size is not None:
        change /= complex(np.exp(eigenvalue * model.step_size)) * model.step_size
    return change


def shift_of_slowest(model: LinearModel, varied: LinearModel, radius: float) -> float:
    """|Δ| of the sum of all eigenvalues nearer to zero than a radius [rad/s], to first order.

    A slow eigenvalue beside the free angle's zero is nearly double: each one alone moves by the root of an error, in
    opposite directions, and their sum by the error itself."""
    step, A, changed = model.step_size, model.A, varied.A

    def is_near(real: float, imaginary: float = 0.0) -> bool:
        value = complex(real, imaginary)
        rate = value if step is None else np.log(value) / step if value else complex(np.inf)
        return bool(abs(rate) <= radius)

    _, right, count = scipy.linalg.schur(A, sort=is_near)
    _, left, _ = scipy.linalg.schur(A.T, sort=is_near)
    left, right = left[:, :count], right[:, :count]
    moved = np.trace(np.linalg.solve(left.T @ right, left.T @ (changed - A) @ right))
    return float(abs(moved) / (step or 1.0))


def _apply(model: LinearModel, z: Vector) -> Vector:
    """A·z for a complex z: the factors inside are real."""
    result: Vector = model.apply(z.real.copy()) + 1j * model.apply(z.imag.copy())
    return result

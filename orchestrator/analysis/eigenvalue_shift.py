"""What a change of a linear model does to one eigenvalue, to first order, from its left and right eigenvectors."""

import numpy as np

from orchestrator.analysis.linear_model import LinearModel
from orchestrator.arrays import Vector


def eigenvalue_shift(
    model: LinearModel, varied: LinearModel, eigenvalue: complex, left: Vector, right: Vector
) -> complex:
    """Δλ = lᴴ·(A' − A)·r [rad/s]; of a step map divided by μ·H, as λ = ln μ / H.

    Parameters
    ----------
    model, varied
        With the same states, in the same order: that with the eigenvalue, and the changed one.
    eigenvalue
        λ of ``model`` [rad/s].
    left, right
        Its eigenvectors, shape (n,), with lᴴ·r = 1.
    """
    change = complex(np.vdot(left, _apply(varied, right) - _apply(model, right)))
    if model.step_size is not None:
        change /= complex(np.exp(eigenvalue * model.step_size)) * model.step_size
    return change


def _apply(model: LinearModel, z: Vector) -> Vector:
    """A·z for a complex z: the factors inside are real."""
    result: Vector = model.apply(z.real.copy()) + 1j * model.apply(z.imag.copy())
    return result

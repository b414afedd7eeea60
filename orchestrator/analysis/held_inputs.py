"""The exact map of a continuous linear model over a time in which its inputs are held."""

import numpy as np
import scipy.linalg

from orchestrator.arrays import Matrix


def over_held_inputs(A: Matrix, B: Matrix, duration: float) -> tuple[Matrix, Matrix]:
    """A and B of x⁺ = A·x + B·u over a duration [s], from those of ẋ = A·x + B·u, by one matrix exponential."""
    n, m = B.shape
    whole = scipy.linalg.expm(duration * np.block([[A, B], [np.zeros((m, n + m))]]))
    return whole[:n, :n], whole[:n, n:]

"""Maps of linear models over a time in which inputs are held, or follow straight lines in parts that are held."""

from typing import NamedTuple

import numpy as np
import scipy.linalg

from orchestrator.core.arrays import Matrix


def over_held_inputs(A: Matrix, B: Matrix, duration: float) -> tuple[Matrix, Matrix]:
    """A and B of x⁺ = A·x + B·u over a duration [s], from those of ẋ = A·x + B·u, by one matrix exponential."""
    n, m = B.shape
    whole = scipy.linalg.expm(duration * np.block([[A, B], [np.zeros((m, n + m))]]))
    return whole[:n, :n], whole[:n, n:]


class LineMap(NamedTuple):
    """x⁺ = A·x + B·(u₀ + u₁)/2 + E·(u₁ − u₀) over a step, with inputs that go from u₀ to u₁."""

    A: Matrix
    B: Matrix
    E: Matrix


def over_parts(A: Matrix, B: Matrix, parts: int) -> LineMap:
    """The map over a step that is done in equal parts, each with the inputs of its middle."""
    mean, slope = np.zeros_like(B), np.zeros_like(B)
    for j in range(parts):
        mean = A @ mean + B
        slope = A @ slope + ((j + 0.5) / parts - 0.5) * B
    return LineMap(np.linalg.matrix_power(A, parts), mean, slope)

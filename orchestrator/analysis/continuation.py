"""Following one mode by its eigenvectors while a parameter changes. The linear model can be computed for any value of
the parameter.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.analysis.critical_modes import DENSE, nearest_pairs
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.modes import eigenvectors, in_range
from orchestrator.analysis.similarity import similarity
from orchestrator.arrays import Vector
from orchestrator.errors import AnalysisError

_SAME = 0.6
"""Least similarity with which two modes of neighbouring models count as the same mode."""

_SHORTEST = 1 / 64
"""Length of the shortest stride, as a part of the path."""

_NEIGHBOURS = 8

_DEFECTIVE = 1e-12
"""Below this lᴴ·r is rounding: equal stages side by side share one eigenvector, and such a mode is like no other."""


@dataclass(frozen=True)
class Eigenpair:
    """An eigenvalue λ [rad/s] with its left and right eigenvectors, scaled so that lᴴ·r = 1."""

    eigenvalue: complex
    left: Vector
    right: Vector

    def similarity(self, other: "Eigenpair") -> float:
        """Similarity of two modes, from 0 to about 1; it exceeds 1 only near a double eigenvalue."""
        mine, theirs = (self.left[None], self.right[None]), (other.left[None], other.right[None])
        return float(similarity(*mine, *theirs).item())


def eigenpairs(model: LinearModel, lowest_hz: float, highest_hz: float) -> tuple[list[Eigenpair], Vector]:
    """The eigenpairs of a frequency range [Hz], one of each conjugate pair, and all eigenvalues [rad/s]."""
    lambdas, left, right = eigenvectors(model)
    chosen = in_range(lambdas, lowest_hz, highest_hz)
    return [_pair(complex(lambdas[k]), left[:, k], right[:, k]) for k in chosen], lambdas


def pairs_near(model: LinearModel, wanted: complex) -> list[Eigenpair]:
    """The pairs nearest to a point [rad/s]; of a small model, all pairs of the upper half plane."""
    if len(model.names) <= DENSE:
        return eigenpairs(model, 0.0, np.inf)[0]
    return [_pair(*found) for found in nearest_pairs(model, wanted, _NEIGHBOURS)]


def pair_at(model: LinearModel, eigenvalue: complex) -> Eigenpair:
    """The pair whose eigenvalue is nearest to a given one."""
    return min(pairs_near(model, eigenvalue), key=lambda pair: abs(pair.eigenvalue - eigenvalue))


def follow_along(start: Eigenpair, model_at: Callable[[float], LinearModel], begin: float, end: float) -> Eigenpair:
    """Follow a mode along a path from ``begin`` to ``end``, in strides short enough to recognise it.

    Parameters
    ----------
    start
        The mode at ``begin``.
    model_at
        The linear model at any point of the path.
    begin, end
        Ends of the path; the end may be the smaller one.

    Raises
    ------
    AnalysisError
        If the mode cannot be recognised even after the shortest stride.
    """
    shortest = abs(end - begin) * _SHORTEST
    here, pair, stride = begin, start, end - begin
    while here != end:
        there = end if abs(end - here) <= abs(stride) * (1 + 1e-12) else here + stride
        found = _recognise(pair, pairs_near(model_at(there), pair.eigenvalue))
        if found is not None:
            here, pair, stride = there, found, 2 * stride
        elif abs(stride) > shortest:
            stride = (there - here) / 2
        else:
            raise AnalysisError(
                f"the mode {pair.eigenvalue:.4g} rad/s cannot be followed beyond {here:.4g} on the way to {end:.4g}: "
                "there it merges with another mode; take a smaller gain or other lead/lag time constants"
            )
    return pair


def _recognise(pair: Eigenpair, candidates: Sequence[Eigenpair]) -> Eigenpair | None:
    best = max(candidates, key=pair.similarity, default=None)
    return best if best is not None and pair.similarity(best) >= _SAME else None


def _pair(eigenvalue: complex, left: Vector, right: Vector) -> Eigenpair:
    product = complex(np.vdot(right, left))  # rᴴl, the conjugate of lᴴr
    size = float(np.linalg.norm(left) * np.linalg.norm(right))
    if abs(product) <= _DEFECTIVE * size:
        left, product = np.zeros_like(left), complex(1)
    return Eigenpair(eigenvalue, left / product, right)

"""Critical modes beside those that are known already: a search that the known ones are taken out of.

Where the modes of one operating point are made from those of another, a mode that was not critical there, or not there
at all, is missed. With the known modes projected out, Arnoldi's method around a few points finds what else lies
nearby; mostly nothing."""

from itertools import pairwise

import numpy as np
import scipy.sparse.linalg as spla

from orchestrator.analysis.mode_refinement import RefinedModes
from orchestrator.analysis.modes import damping_ratio
from orchestrator.analysis.shifted_equations import ShiftedEquations
from orchestrator.arrays import Vector
from orchestrator.errors import AnalysisError

_STRETCH = 3.0  # ratio of the ends of a stretch of frequencies around each point
_GROWTH = 0.3  # how far into instability the search reaches: to this negative damping ratio
_AT_A_TIME = (2, 64)
"""Numbers of unknown eigenvalues to find around one point: the first, and the largest where that does not reach far
enough."""


_ROUGH = 1e-3  # accuracy of what is found: enough to say whether something is there


def missed(
    equations: ShiftedEquations, known: RefinedModes, lowest: float, highest: float, damping: float
) -> list[complex]:
    """Eigenvalues [rad/s] of a region beside the known ones.

    ``lowest`` and ``highest``: range of Im λ [rad/s], above 0.
    ``damping``: damping ratio below which nothing may be missed, down to −0.3. What is found is rough."""
    norms = np.einsum("ij,ij->j", known.left.conj(), known.right)
    left = (known.left / norms.conj()).conj().T
    edges = np.geomspace(lowest, highest, 1 + int(np.ceil(np.log(highest / lowest) / np.log(_STRETCH)))).tolist()
    slopes = [-ratio / np.sqrt(1 - ratio**2) for ratio in (-_GROWTH, damping)]
    found: list[complex] = []
    for low, high in pairwise(edges):
        corners = [complex(slope * omega, omega) for slope in slopes for omega in (low, high)]
        centre = complex(np.mean(corners))
        radius = max(abs(corner - centre) for corner in corners)
        for value in _unknown(equations, left, known.right, centre, radius):
            if low <= value.imag < high and -_GROWTH <= damping_ratio(value) < damping:
                found.append(value)
    return found


def _unknown(equations: ShiftedEquations, left: Vector, right: Vector, centre: complex, radius: float) -> list[complex]:
    """All unknown eigenvalues nearer to a point than a radius, and some farther ones."""
    factors, n = equations.at(centre), right.shape[0]

    def solve(vector: Vector) -> Vector:
        rest = vector.reshape(n, 1)
        rest = factors.solve(rest - right @ (left @ rest))
        found: Vector = (rest - right @ (left @ rest))[:, 0]
        return found

    start = np.random.default_rng(0).standard_normal((n,)).astype(complex)  # the same search gives the same answer
    inverse = spla.LinearOperator((n, n), matvec=solve, dtype=complex)
    count, most = _AT_A_TIME
    while count <= min(most, n - 2):
        try:
            nu = spla.eigs(inverse, k=count, ncv=min(n, max(24, 3 * count)), v0=start, tol=_ROUGH,
                               return_eigenvectors=False)  # fmt: skip
        except spla.ArpackNoConvergence as error:
            raise AnalysisError(
                f"the search for modes around {centre:.3g} rad/s does not converge; compute the full spectrum"
            ) from error
        values = centre + 1 / nu
        if np.abs(values - centre).max() > radius:
            return [complex(value) for value in values]
        count *= 2
    raise AnalysisError(f"more than {most} modes lie at {centre:.4g} rad/s; compute the full spectrum instead")

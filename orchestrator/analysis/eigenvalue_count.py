"""How many modes grow, without finding them: the turns of det(A − sI) along the imaginary axis.

The number does not come from any search, so it shows whether a search has missed a mode. The logarithm of the
determinant is followed from point to point, and points are added where it changes quickly. The eigenvalues of the
components alone are divided out first: what is left comes to rest far from 0."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from orchestrator.analysis.shifted_equations import ShiftedEquations
from orchestrator.arrays import Vector
from orchestrator.errors import AnalysisError

GROWING = 2e-3  # eigenvalues to the right of this count as growing [1/s]: what is closer to 0 may be the free angle

_STEP = 0.7
"""Largest change of the logarithm between two points, and from one half of the way to the other. An angle alone could
make a whole turn unseen; the size of the determinant shows it."""

_HALVINGS = 40
"""How often the way between two points is halved; a line that is closer to an eigenvalue than that cannot be
followed."""

_FARTHEST = 1e7  # end of the imaginary axis [rad/s]: beyond it no part of a system answers any more
_FIRST = 160  # points to begin with, from 1e-3 rad/s to the end


def count_growing(equations: ShiftedEquations, alone: Sequence[complex] | Vector) -> int:
    """Number of eigenvalues to the right of `GROWING`, at any frequency; a pair counts twice.

    ``alone``: all eigenvalues of its components, each alone with its inputs held [rad/s]. Far from 0, the system's
    determinant is theirs."""
    poles = np.asarray(alone, dtype=complex)

    def logarithm(s: complex) -> complex:
        return equations.at(s).log_determinant - complex(np.log(s - poles).sum())

    axis = (GROWING + 1j * np.concatenate([[0.0], np.geomspace(1e-3, _FARTHEST, _FIRST)])).tolist()
    values = [logarithm(s) for s in axis]
    turn = 0.0
    for (s_0, f_0), (s_1, f_1) in pairwise(zip(axis, values, strict=True)):
        waiting = [(s_0, f_0, s_1, f_1, 0)]
        while waiting:
            a, f_a, b, f_b, depth = waiting.pop()
            middle = (a + b) / 2
            f = logarithm(middle)
            first, second = _wrapped(f - f_a), _wrapped(f_b - f)
            if max(abs(first), abs(second), abs(second - first)) <= _STEP:
                turn += (first + second).imag
            elif depth == _HALVINGS:
                raise AnalysisError(f"an eigenvalue lies at {a:.6g} rad/s, on the line where growth begins")
            else:
                waiting += [(middle, f, b, f_b, depth + 1), (a, f_a, middle, f, depth + 1)]
    return int((poles.real > GROWING).sum()) - round(turn / np.pi)


def _wrapped(change: complex) -> complex:
    """The same logarithm with an angle from −π to π [rad]."""
    return complex(change.real, (change.imag + np.pi) % (2 * np.pi) - np.pi)

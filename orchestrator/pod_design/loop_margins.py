"""Phase and delay margin of a feedback gain, from the linear models with two of its values.

The loop is broken where the gain K acts. A state matrix with K in one place is A(K) = A_0 + K·U·Vᵀ, so two models give
U·Vᵀ, with a column for each place; what goes around the loop is L(s) = −K·Vᵀ·(sI − A_0)⁻¹·U, and its eigenvalues
turn the closed loop unstable where one of them is −1."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.modes import ZERO
from orchestrator.arrays import Matrix, Vector
from orchestrator.errors import AnalysisError
from orchestrator.late import optimize

_FREQUENCIES = (0.01, 500.0)  # range of frequencies in which the loop is examined [Hz]
_POINTS_PER_DECADE = 150
_NEGLIGIBLE = 1e-8
"""Singular values of A(K₂) − A(K₁) below this, relative to the largest, are rounding of the linearisation."""


@dataclass(frozen=True)
class LoopMargins:
    """Least changes of a loop that make it unstable, and its largest sensitivity."""

    # least phase shift [°], to either side, that makes the loop unstable; None if the gain around the loop is 1 at no
    # frequency
    phase_deg: float | None
    phase_hz: float | None  # frequency of the oscillation that this phase shift sustains [Hz]
    delay: float | None  # least delay that makes the loop unstable [s]; None as for ``phase_deg``
    delay_hz: float | None  # frequency of the oscillation that this delay sustains [Hz]
    peak: float  # largest sensitivity 1/|1 + L|: 1 without feedback, above 2 is commonly held to be little robust
    peak_hz: float  # its frequency [Hz]


def loop_margins(half: LinearModel, full: LinearModel) -> LoopMargins:
    if full.step_size is not None or full.names != half.names:
        raise ValueError("the margins of a loop need two continuous models with the same states")
    if np.linalg.eigvals(full.A).real.max() > ZERO:
        raise AnalysisError("the system is unstable with this gain, so there are no margins")
    around = _Loop(full, *_places(2 * (full.A - half.A)))
    low, high = (2 * math.pi * f for f in _FREQUENCIES)
    grid = np.geomspace(low, high, round(_POINTS_PER_DECADE * math.log10(high / low)) + 1)
    values = np.array([around.eigenvalues(w) for w in grid])
    distance = np.abs(1 + values).min(axis=1)
    crossings = list(_crossings(around, grid, values))
    turned = min(((abs(math.remainder(np.angle(-value), 2 * math.pi)), w) for w, value in crossings), default=None)
    delayed = min((((np.angle(value) + math.pi) % (2 * math.pi) / w, w) for w, value in crossings), default=None)
    hertz = 2 * math.pi
    return LoopMargins(
        phase_deg=math.degrees(turned[0]) if turned else None, phase_hz=turned[1] / hertz if turned else None,
        delay=float(delayed[0]) if delayed else None, delay_hz=delayed[1] / hertz if delayed else None,
        peak=float(1 / distance.min()), peak_hz=float(grid[distance.argmin()] / hertz),
    )  # fmt: skip


def _places(change: Matrix) -> tuple[Matrix, Matrix]:
    """U and Vᵀ of a change of low rank."""
    rows, columns = (np.flatnonzero(np.abs(change).max(axis=axis)) for axis in (1, 0))
    if not len(rows):
        raise AnalysisError("the gain changes nothing in the linear model, so there is no loop")
    left, sizes, right = np.linalg.svd(change[np.ix_(rows, columns)], full_matrices=False)
    rank = int((sizes > _NEGLIGIBLE * sizes[0]).sum())
    U, V = np.zeros((len(change), rank)), np.zeros((rank, len(change)))
    U[rows], V[:, columns] = left[:, :rank] * sizes[:rank], right[:rank]
    return U, V


class _Loop:
    """L(jω), from the closed loop: with T = Vᵀ·(sI − A)⁻¹·U it is −(I + T)⁻¹·T."""

    def __init__(self, closed: LinearModel, U: Matrix, V: Matrix) -> None:
        self._closed, self._U, self._V = closed, U, V

    def eigenvalues(self, w: float) -> Vector:
        """Of L at ω [rad/s], smallest first; their sizes depend continuously on ω."""
        solver = self._closed.shifted(1j * w)
        T = -self._V @ np.column_stack([solver.solve(u) for u in self._U.T])
        found = np.linalg.eigvals(-np.linalg.solve(np.eye(len(T)) + T, T))
        return found[np.argsort(np.abs(found))]


def _crossings(around: _Loop, grid: Vector, values: Vector) -> Iterator[tuple[float, complex]]:
    """Frequencies [rad/s] at which an eigenvalue has the size 1, with the eigenvalue."""
    sizes = np.log(np.abs(values))
    for k in range(values.shape[1]):
        size = partial(_log_size, around, k)
        for i in np.flatnonzero(np.sign(sizes[:-1, k]) != np.sign(sizes[1:, k])):
            w = float(optimize.brentq(size, grid[i], grid[i + 1], rtol=1e-10))
            yield w, complex(around.eigenvalues(w)[k])


def _log_size(around: _Loop, k: int, w: float) -> float:
    return math.log(abs(around.eigenvalues(w)[k]))

"""Eigenvalues of open loops that are closed, in the coordinates of the open loops' modes.

Closed loops change A = diag(λ) by as many ranks as there are loops. With H(s) = C·(s − λ)⁻¹·B + D, from what acts in
the loops' place to their signals, and Φ(s), their gains and lead/lags, the eigenvalues are the zeros of
det(I − Φ(s)·H(s)) and what no loop moves.

Most modes hardly move. Such a mode i is the zero of s − λ_i − B_i·G(s)·C_i with G = (Φ⁻¹ − H_i)⁻¹, where H_i has all
modes but this one; one Newton step from λ_i finds it. Those that move are the eigenvalues of a small matrix, which
Ehrlich–Aberth iterations correct for all that it leaves out. The sum of all eigenvalues is known from the matrix, and
is held against theirs.

Source: O. Aberth, Iteration methods for finding all zeros of a polynomial simultaneously, Math. Comp. 27 (1973)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Complex, Flags, Matrix
from orchestrator.studies.pod_design.lead_lag import LeadLag

Places = NDArray[np.int64]

_STILL = 1e-14
"""A mode that a gain of 1 pu moves by less than this part of its size is moved by rounding alone."""

_STEEP = 1e-4
"""Largest slope of B_i·G·C_i, and largest part of its size that a mode moves by, for a mode that hardly moves. What
Newton's step leaves is of the order of the shift times the square of the slope: 10⁻¹² of the size."""

_SLOWEST = 0.01  # size [rad/s] that a slower mode counts as
_ROUNDS = 12  # of Ehrlich-Aberth iterations at most; three are usual
# last correction, and error of the mean of all eigenvalues, as parts of their size
_CONVERGED = 1e-10
_SUM = 1e-9
_BESIDE = 1e-14  # distance [rad/s] from a pole that a point on it counts as having


@dataclass(frozen=True)
class Feedback:
    """Gains and lead/lags that close m loops: Φ(s) is a diagonal matrix."""

    gains: Matrix  # [pu], shape (m,)
    filters: tuple[LeadLag, ...]

    @property
    def lags(self) -> list[tuple[float, int]]:
        """Eigenvalues of the lead/lags alone [rad/s], with their multiplicities."""
        return [(-1 / one.T_S2, one.N_S) for one in self.filters if one.T_S2]

    def at(self, points: Complex) -> tuple[Complex, Complex]:
        """Φ and its derivative to s.

        ``points``: s [rad/s], shape (k,). Returns shapes (k, m)."""
        s = points[:, None]
        lead, lag = (np.array([getattr(f, name) for f in self.filters]) for name in _TIMES)
        stages = np.array([f.N_S if f.T_S2 else 0 for f in self.filters])
        value = self.gains * ((1 + s * lead) / (1 + s * lag)) ** stages
        return value, value * stages * (lead / (1 + s * lead) - lag / (1 + s * lag))


_TIMES = ("T_S1", "T_S2")


class ModalLoops:
    """Open loops in the coordinates of their modes, of which the lower half of a pair is the upper's conjugate.

    ``values``: λ [rad/s], shape (n,), the n − 2·p real ones first, then p of the upper half, then their conjugates.
    ``B``, ``C``, ``D``: shapes (n, m), (m, n), (m, m)."""

    def __init__(self, values: Complex, B: Complex, C: Complex, D: Matrix) -> None:
        self.values, self.B, self.C, self.D = values, B, C, D
        self._products = np.einsum("ki,il->ikl", C, B)
        size = np.linalg.norm(B, axis=1) * np.linalg.norm(C, axis=0)
        self._driven = np.flatnonzero(size > _STILL * np.abs(values))
        self.halves = len(values) - int((values.imag < 0).sum())
        first = np.arange(self.halves)
        self._without = self._responses(self.values[first], first)

    def _responses(self, points: Complex, own: Places | None = None) -> tuple[Complex, Complex]:
        """H and its derivative at some points s [rad/s], shapes (k, m, m).

        ``own``: for each point the mode that is left out there; none by default."""
        poles, m = self.values[self._driven], len(self.D)
        apart = points[:, None] - poles[None]
        apart[apart == 0] = _BESIDE
        if own is not None:
            apart[own[:, None] == self._driven[None]] = np.inf
        terms = self._products[self._driven].reshape(len(poles), m * m)
        part = 1 / apart
        value, slope = part @ terms, -(part * part) @ terms
        shape = (len(points), m, m)
        return value.reshape(shape) + self.D, slope.reshape(shape)

    def closed(
        self, feedback: Feedback, total: float, small: Callable[[Places], Complex]
    ) -> "ClosedModes | None":
        """All modes with the loops closed; None where they cannot be told so.

        ``total``: the sum of all eigenvalues [rad/s].
        ``small``: gives the eigenvalues of the closed loops that have some of the modes alone."""
        try:
            with np.errstate(all="ignore"):  # what is not finite is not weak, and does not converge
                found = self._closed(feedback, small)
        except np.linalg.LinAlgError:  # a point lies on an eigenvalue
            return None
        if found is None:
            return None
        values = found.values
        holds = abs(values.sum() - total) <= _SUM * np.abs(values).sum()
        return found if holds else None

    def _closed(
        self, feedback: Feedback, small: Callable[[Places], Complex]
    ) -> "ClosedModes | None":
        weak, shifts = self._weak(feedback)
        lower = np.arange(self.halves - self._pairs, self.halves)
        both = np.concatenate([weak, weak[lower]])
        stay = self.values[: self.halves] + np.where(weak, shifts, 0)
        stay = np.concatenate([stay, stay[lower].conj()])[both]
        moved = self._corrected(small(np.flatnonzero(~both)), stay, feedback)
        if moved is None:
            return None
        return ClosedModes(self, np.concatenate([stay, moved]), np.flatnonzero(both), feedback)

    @property
    def _pairs(self) -> int:
        return len(self.values) - self.halves

    def _weak(self, feedback: Feedback) -> tuple[Flags, Complex]:
        """Which of the first modes hardly move, and by how much [rad/s]."""
        points = self.values[: self.halves]
        gain, gain_slope = feedback.at(points)
        H, H_slope = self._without
        inside = np.eye(len(self.D)) - gain[:, :, None] * H
        finite = np.isfinite(inside).all(axis=(1, 2)) & np.isfinite(H_slope).all(axis=(1, 2))
        inside[~finite] = np.eye(len(self.D))
        G = np.linalg.inv(inside) * gain[:, None, :]
        of_filters = np.eye(len(self.D)) * (gain_slope / gain**2)[:, :, None]
        G_slope = G @ (of_filters + H_slope) @ G
        B, C = self.B[: self.halves, None, :], self.C[:, : self.halves].T[:, :, None]
        shift, slope = ((B @ X @ C)[:, 0, 0] for X in (G, G_slope))
        shift = shift / (1 - slope)
        shift[self._real] = shift[self._real].real
        size = np.maximum(np.abs(points), _SLOWEST)
        weak = finite & (np.abs(slope) < _STEEP) & (np.abs(shift) < _STEEP * size)
        return weak, shift

    @property
    def _real(self) -> slice:
        return slice(0, self.halves - self._pairs)

    def _corrected(self, moved: Complex, stay: Complex, feedback: Feedback) -> Complex | None:
        """The eigenvalues that move, from those of a small matrix; None where they do not converge."""
        single = moved[moved.imag == 0]
        roots = np.concatenate([single, moved[moved.imag > 0]])
        for _ in range(_ROUNDS):
            others = np.concatenate([stay, roots, roots[len(single) :].conj()])
            apart = roots[:, None] - others[None]
            apart[np.arange(len(roots)), len(stay) + np.arange(len(roots))] = np.inf
            rate = self._rate(roots, feedback) - (1 / apart).sum(axis=1)
            for pole, count in feedback.lags:
                rate = rate + count / (roots - pole)
            change = 1 / rate
            change[: len(single)] = change[: len(single)].real
            roots = roots - change
            if not np.isfinite(roots).all():
                return None
            if (np.abs(change) <= _CONVERGED * np.maximum(np.abs(roots), _SLOWEST)).all():
                return np.concatenate([roots, roots[len(single) :].conj()])
        return None

    def _rate(self, points: Complex, feedback: Feedback) -> Complex:
        """The logarithmic derivative of det(s − λ)·det(I − Φ·H)."""
        H, H_slope = self._responses(points)
        gain, slope = (x[:, :, None] for x in feedback.at(points))
        inside = np.eye(len(self.D)) - gain * H
        changes = -(slope * H + gain * H_slope)
        by_loops = np.trace(np.linalg.solve(inside, changes), axis1=1, axis2=2)
        by_modes = (1 / (points[:, None] - self.values[None])).sum(axis=1)
        return np.asarray(by_loops + by_modes, dtype=complex)


@dataclass(frozen=True)
class ModalVectors:
    """Eigenvectors of closed loops, a row for each: of the modes, and what goes through the loops."""

    left: Complex  # in the modes' coordinates, shape (k, n): l·A = λ·l
    right: Complex  # the same for A·r = λ·r
    signals: Complex  # the loops' signals with the right one, shape (k, m)
    weights: Complex  # what the left one has of what acts in the loops' place, shape (k, m)


class ClosedModes:
    """All modes of closed loops.

    ``values``: λ [rad/s]; those that hardly move first."""

    def __init__(
        self,
        loops: ModalLoops,
        values: Complex,
        weak: Places,
        feedback: Feedback,
    ) -> None:
        self.values = values
        self._loops, self._weak, self._feedback = loops, weak, feedback

    def vectors(self, places: Sequence[int]) -> ModalVectors:
        """The eigenvectors of some modes, of the upper half or real.

        ``places``: of these modes in ``values``."""
        at = np.asarray(places, dtype=np.int64)
        points, loops, m = self.values[at], self._loops, len(self._loops.D)
        own = np.full(len(at), -1)
        weak = at < len(self._weak)
        own[weak] = self._weak[at[weak]]
        H, _ = loops._responses(points, own)
        gain, _ = self._feedback.at(points)
        inside = np.eye(m) - gain[:, :, None] * H
        acting, weights = (np.zeros((len(at), m), dtype=complex) for _ in range(2))
        if not weak.all():
            left, _, right = np.linalg.svd(inside[~weak])
            acting[~weak], weights[~weak] = right[:, -1].conj(), left[:, :, -1].conj()
        inverse = np.linalg.inv(inside[weak])
        seen, driven = np.zeros((len(at), m), dtype=complex), np.zeros((len(at), m), dtype=complex)
        seen[weak], driven[weak] = loops.C[:, own[weak]].T, loops.B[own[weak]]
        acting[weak] = (inverse @ (gain[weak] * seen[weak])[:, :, None])[:, :, 0]
        by_own = (driven[weak][:, None] @ inverse)[:, 0]
        weights[weak] = driven[weak] + ((by_own * gain[weak])[:, None] @ H[weak])[:, 0]
        signals = seen + (H @ acting[:, :, None])[:, :, 0]
        apart = points[:, None] - loops.values[None]
        k = np.flatnonzero(weak)
        apart[k, own[k]] = 1.0
        sides = acting @ loops.B.T / apart, (weights * gain) @ loops.C / apart
        for side in sides:
            side[k, own[k]] = 1.0
        return ModalVectors(sides[1], sides[0], signals, weights)

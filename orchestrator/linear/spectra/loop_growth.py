"""The mode that grows fastest in a large system with a few equations changed, as where dead bands are left.

The change acts on a few states through what it adds to a few equations, so that its modes are those of the system as
seen from these ends. The system's answers at some frequencies, from both ends, span a small space in which the changed
system is a small dense matrix. An answer between two frequencies that the small one does not give is taken into the
space. What grows there is then found in the equations of the whole, so that no figure rests on the small one. The space
has growing modes of its own, as nothing grows without the change: they stay where they are with it, and are passed
over."""

from itertools import pairwise

import numpy as np
import scipy.linalg

from orchestrator.core.arrays import Complex, Matrix, Vector
from orchestrator.core.late import optimize
from orchestrator.core.threads import one_thread
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.changed_spectra import Change, ends_in_states
from orchestrator.linear.spectra.modes import Mode, make_mode
from orchestrator.linear.spectra.stability import grows

_HERTZ = (
    0.02,
    0.1,
    0.4,
    1.0,
    3.0,
    10.0,
    30.0,
)  # from slow control to what a converter's plant can do
_CLOSE = 1e-2  # largest part by which the small system's answer may differ between two of these
_RANK = 1e-9  # part of the largest singular value of a change that is rounding
_SEEN = 1e-8  # least singular value of what both sides of the space see of each other
_BESIDE = 1e-4  # part of an eigenvalue by which the point that gives its vectors lies beside it
_ROUNDS = 6  # of inverse iteration, at most
_SETTLED = 1e-6  # largest part of an eigenvalue that the last round may move it by
_OWN = 1e-3
"""Part of its size by which an eigenvalue of the small system that grows without the change is moved by it at most:
those of 37 plants' dead bands were moved by 1e-5."""

_ENDS_HELD_AGAINST = (
    4  # sums of the ends' columns by which the small system is held against the whole one
)
_BESIDE_MODE = np.linspace(
    0.3, 1.3, 11
)  # parts of a mode's frequency at which the locus is looked at
_CROSSING = 1e-3  # part of a frequency to which the crossing is known


class LoopGrowth:
    """A system and the same with a change of a few equations, which closes a loop.

    ``model``: continuous, without growing modes; ``changed``: the same with the change.

    Raises `AnalysisError` where the models have other states."""

    def __init__(self, model: LinearModel, changed: LinearModel) -> None:
        self._model, self._changed = model, changed
        change = Change.between(model, changed)
        self._is_none = not change.added.size
        if self._is_none:
            return
        self._B, self._C = _ends(model, change)
        with one_thread():
            self._small = _SmallSystem(model, self._B, self._C)

    def mode(self) -> Mode | None:
        """The mode that grows fastest with the change; None if none is found that grows.

        Modes below 0.02 Hz and beyond 30 Hz may be missed."""
        if self._is_none:
            return None
        with one_thread():
            for value in self._small.growing():
                found = _in_equations(self._changed, value, *self._small.vectors(value))
                if found is not None:
                    return found
        return None

    def edge(self, frequency_hz: float) -> tuple[float, float] | None:
        """The part of the loop's gain at which a swing neither grows nor decays, and that swing's frequency [Hz].

        It is where the locus of the loop's answers crosses the real axis, beyond 1 by the inverse of that part. The
        small system tells between which frequencies it does.

        ``frequency_hz``: of the mode that grows with the whole gain [Hz]; what is at the edge is looked for beside it.

        Returns
        -------
        tuple of float or None
            None where no swing is at the edge there."""
        with one_thread():
            beside = (frequency_hz * _BESIDE_MODE).tolist()
            sides = [_locus(self._small.answer(hertz)).imag for hertz in beside]
            found = [
                self._crossing(*ends)
                for ends, (one, other) in zip(pairwise(beside), pairwise(sides), strict=True)
                if one * other < 0
            ]
        edges = [(1 / value.real, hertz) for hertz, value in found if value.real > 1]
        return min(edges, default=None)

    def _crossing(self, low: float, high: float) -> tuple[float, complex]:
        """Where the locus crosses the real axis between two frequencies [Hz], and its value there."""
        seen: dict[float, complex] = {}

        def side(hertz: float) -> float:
            exact = self._C @ self._model.shifted(2j * np.pi * hertz).solve_exactly(self._B + 0j)
            seen[hertz] = _locus(exact)
            return seen[hertz].imag

        # at the ends themselves, which the small system gives, the whole one may be on the same side
        if side(low) * side(high) < 0:
            optimize.brentq(side, low, high, xtol=_CROSSING * low, rtol=_CROSSING)
        return min(seen.items(), key=lambda one: abs(one[1].imag))


def _locus(answer: Matrix) -> complex:
    """The value of a loop's answer that is farthest to the right, with the sign of its feedback."""
    values = np.linalg.eigvals(-answer)
    return complex(values[np.argmax(values.real)])


def _ends(model: LinearModel, change: Change) -> tuple[Matrix, Matrix]:
    """B and C of A + B·C, with as many columns and rows as the change has ranks."""
    B, C, D = ends_in_states(model, change.equations, change.read)
    added = np.linalg.solve(np.eye(len(change.added)) - change.added @ D, change.added)
    left, sizes, right = np.linalg.svd(added, full_matrices=False)
    rank = int((sizes > _RANK * sizes[0]).sum())
    return B @ (left[:, :rank] * sizes[:rank]), right[:rank] @ C


class _SmallSystem:
    """A system in the space of its answers to B and, from the other side, to C."""

    def __init__(self, model: LinearModel, B: Matrix, C: Matrix) -> None:
        self._model, self._B, self._C = model, B + 0j, C + 0j
        self._right: list[Matrix] = []
        self._left: list[Matrix] = []
        for hertz in _HERTZ:
            self._take(hertz)
        self._project()
        missed = [middle for middle in map(_middle, pairwise(_HERTZ)) if not self._gives(middle)]
        for hertz in missed:
            self._take(hertz)
        if missed:
            self._project()

    def growing(self) -> list[complex]:
        """Eigenvalues [rad/s] that grow with the change, the fastest first, without those that grow without it."""
        own, changed = (np.linalg.eigvals(A).astype(complex) for A in (self._A, self._changed))
        own, changed = own[grows(own)], changed[grows(changed)]
        apart = np.abs(changed[:, None] - own).min(axis=1, initial=np.inf)
        found = changed[apart > _OWN * np.abs(changed)]
        values: list[complex] = found[np.argsort(-found.real)].tolist()
        return values

    def vectors(self, value: complex) -> tuple[Complex, Complex]:
        """The right and the left eigenvector with the change, of an eigenvalue [rad/s], in the states of the whole."""
        n = len(self._A)
        factors = scipy.linalg.lu_factor(self._changed - value * (1 + _BESIDE) * np.eye(n))
        right = left = np.random.default_rng(0).standard_normal(n).astype(complex)
        for _ in range(2):
            right = _of_length_one(scipy.linalg.lu_solve(factors, right))
            left = _of_length_one(scipy.linalg.lu_solve(factors, left, trans=2))
        return self._basis[0] @ right, self._basis[1] @ left

    def answer(self, hertz: float) -> Matrix:
        """The small system's answer at a frequency [Hz], from end to end."""
        shifted = self._A - 2j * np.pi * hertz * np.eye(len(self._A))
        found: Matrix = self._c @ np.linalg.solve(shifted, self._b)
        return found

    @property
    def _changed(self) -> Matrix:
        changed: Matrix = self._A + self._b @ self._c
        return changed

    def _take(self, hertz: float) -> None:
        """Take the answers at a frequency into the space."""
        solver = self._model.shifted(2j * np.pi * hertz)
        right, left = solver.solve_exactly(self._B), solver.solve_adjoint_exactly(self._C.T)
        self._right += [right.real, right.imag]
        self._left += [left.real, left.imag]

    def _project(self) -> None:
        right, left = (
            scipy.linalg.qr(np.hstack(side), mode="economic", check_finite=False)[0]
            for side in (self._right, self._left)
        )
        of_left, sizes, of_right = np.linalg.svd(left.T @ right)
        kept = int((sizes > _SEEN).sum())
        root = np.sqrt(sizes[:kept])
        right, left = right @ (of_right[:kept].T / root), left @ (of_left[:, :kept] / root)
        self._basis = right, left
        self._A, self._b = left.T @ self._model.apply(right), left.T @ self._B.real
        self._c = self._C.real @ right

    def _gives(self, hertz: float) -> bool:
        """Return whether the small system gives the whole one's answer at a frequency, to sums of the columns."""
        sums = np.random.default_rng(0).standard_normal((self._B.shape[1], _ENDS_HELD_AGAINST))
        whole = self._C @ self._model.shifted(2j * np.pi * hertz).solve_exactly(self._B @ sums)
        small = self.answer(hertz) @ sums
        return bool(np.abs(whole - small).max() <= _CLOSE * np.abs(whole).max())


def _of_length_one(vector: Vector) -> Complex:
    return np.asarray(vector / np.linalg.norm(vector), dtype=complex)


def _middle(ends: tuple[float, float]) -> float:
    return float(np.sqrt(ends[0] * ends[1]))


def _in_equations(model: LinearModel, value: complex, right: Complex, left: Complex) -> Mode | None:
    """The growing mode of a model next to a value [rad/s], by two-sided inverse iteration; None if there is none.

    ``right``, ``left``: vectors that are much like its own."""
    found = value
    for _ in range(_ROUNDS):
        solver = model.shifted(found * (1 + _BESIDE))
        right = _of_length_one(solver.solve_exactly(right))
        left = _of_length_one(solver.solve_adjoint_exactly(left))
        before, found = found, complex(np.vdot(left, model.apply(right)) / np.vdot(left, right))
        if abs(found - before) <= _SETTLED * abs(found):
            is_growing = bool(grows(np.array([found]))[0])
            return make_mode(found, left, right, model.names) if is_growing else None
    return None

"""The mode that grows fastest in a large system with a few equations changed, as where dead bands are left.

The change acts on a few states through what it adds to a few equations, so that its modes are those of the system as
seen from these ends. The system's answers at some frequencies, from both ends, span a small space in which the changed
system is a small dense matrix. An answer between two frequencies that the small one does not give is taken into the
space. What grows there is then found in the equations of the whole, so that no figure rests on the small one."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from orchestrator.core.arrays import Complex, Matrix, Vector
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
_ROUNDS = 6  # of inverse iteration
_SETTLED = 1e-6  # largest part of an eigenvalue that the last round may move it by
_BESIDE_MODE = np.linspace(
    0.3, 1.3, 11
)  # parts of a mode's frequency at which the locus is looked at
_HALVINGS = 7  # of the distance of two of these, until the crossing is known


def growth_with(model: LinearModel, changed: LinearModel) -> Mode | None:
    """The mode that grows fastest with a change of a few equations; None if none is found that grows.

    ``model``: continuous, without growing modes; ``changed``: the same with the change.

    Modes below 0.02 Hz and beyond 30 Hz may be missed. Raises `AnalysisError` where the models have other states."""
    change = Change.between(model, changed)
    if not change.added.size:
        return None
    B, C = _ends(model, change)
    with one_thread():
        values = _SmallSystem(model, B, C).changed_values()
        growing = values[grows(values)]
        for value in growing[np.argsort(-growing.real)].tolist():
            found = _in_equations(changed, value)
            if found is not None:
                return found
    return None


def edge_of_growth(
    model: LinearModel, changed: LinearModel, frequency_hz: float
) -> tuple[float, float] | None:
    """The part of a loop's gain at which a swing neither grows nor decays, and that swing's frequency [Hz].

    It is where the locus of the loop's answers crosses the real axis, beyond 1 by the inverse of that part.

    ``model``, ``changed``: as `growth_with` takes them.
    ``frequency_hz``: of the mode that grows with the whole gain [Hz]; what is at the edge is looked for beside it.

    Returns
    -------
    tuple of float or None
        None where no swing is at the edge there."""
    B, C = _ends(model, Change.between(model, changed))

    def locus(hertz: float) -> complex:
        answer = C @ model.shifted(2j * np.pi * hertz).solve_exactly(B.astype(complex))
        values = np.linalg.eigvals(-answer)
        return complex(values[np.argmax(values.real)])

    with one_thread():
        seen = [(hertz, locus(hertz)) for hertz in (frequency_hz * _BESIDE_MODE).tolist()]
        ends = [
            _crossing(locus, one, other)
            for one, other in pairwise(seen)
            if one[1].imag * other[1].imag < 0
        ]
    edges = [(1 / value.real, hertz) for hertz, value in ends if value.real > 1]
    return min(edges, default=None)


_Seen = tuple[float, complex]  # a frequency [Hz], and the locus there


def _crossing(locus: Callable[[float], complex], one: _Seen, other: _Seen) -> _Seen:
    """Where the locus crosses the real axis between two frequencies."""
    for _ in range(_HALVINGS):
        middle = (one[0] + other[0]) / 2
        seen = middle, locus(middle)
        one, other = (one, seen) if one[1].imag * seen[1].imag < 0 else (seen, other)
    return seen


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

    def changed_values(self) -> Vector:
        """Eigenvalues [rad/s] with the change."""
        found: Vector = np.linalg.eigvals(self._A + self._b @ self._c).astype(complex)
        return found

    def _take(self, hertz: float) -> None:
        """Take the answers at a frequency into the space."""
        solver = self._model.shifted(2j * np.pi * hertz)
        right, left = solver.solve_exactly(self._B), solver.solve_adjoint_exactly(self._C.T)
        self._right += [right.real, right.imag]
        self._left += [left.real, left.imag]

    def _project(self) -> None:
        right, left = (np.linalg.qr(np.hstack(side))[0] for side in (self._right, self._left))
        of_left, sizes, of_right = np.linalg.svd(left.T @ right)
        kept = int((sizes > _SEEN).sum())
        root = np.sqrt(sizes[:kept])
        right, left = right @ (of_right[:kept].T / root), left @ (of_left[:, :kept] / root)
        self._A, self._b = left.T @ self._model.apply(right), left.T @ self._B.real
        self._c = self._C.real @ right

    def _gives(self, hertz: float) -> bool:
        """Return whether the small system gives the whole one's answer at a frequency."""
        point = 2j * np.pi * hertz
        whole = self._C @ self._model.shifted(point).solve_exactly(self._B)
        small = self._c @ np.linalg.solve(self._A - point * np.eye(len(self._A)), self._b)
        return bool(np.abs(whole - small).max() <= _CLOSE * np.abs(whole).max())


def _of_length_one(vector: Vector) -> Complex:
    return np.asarray(vector / np.linalg.norm(vector), dtype=complex)


def _middle(ends: tuple[float, float]) -> float:
    return float(np.sqrt(ends[0] * ends[1]))


def _in_equations(model: LinearModel, value: complex) -> Mode | None:
    """The growing mode of a model next to a value [rad/s], by two-sided inverse iteration; None if there is none."""
    rng = np.random.default_rng(0)  # the same search gives the same answer
    right: Complex = rng.standard_normal(len(model.names)).astype(complex)
    left = right
    found, before = value, complex(np.inf)
    for _ in range(_ROUNDS):
        solver = model.shifted(found * (1 + _BESIDE))
        right = _of_length_one(solver.solve_exactly(right))
        left = _of_length_one(solver.solve_adjoint_exactly(left))
        before, found = found, complex(np.vdot(left, model.apply(right)) / np.vdot(left, right))
    settled = abs(found - before) <= _SETTLED * abs(found)
    if not settled or not grows(np.array([found]))[0]:
        return None
    return make_mode(found, left, right, model.names)

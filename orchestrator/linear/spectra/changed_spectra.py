"""All eigenvalues of models that differ in one component's equations, as with other settings of a controller.

Without the component's equations, what is left of the model is the rest of the system. With them, its A becomes
A + B·S·C: B has a column for each of the equations, C a row for each quantity that they read, and only the small S is
another one with each setting. In the coordinates of the rest's modes, A is diagonal; a mode that the component does not
drive, or does not see, stays where it is, and what is left is a matrix of those that move. One Schur form serves all
settings. (The component's own modes are no part of it: equal stages side by side would make them defective.)

Its answers have the modes' own accuracy, which is lost where modes are nearly defective. So the coordinates are held
against sparse factorisations first, and what decides is to be computed from the whole matrix as well."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.arrays import Complex, Matrix, Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.core.threads import one_thread
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.continuation import Eigenpair
from orchestrator.linear.spectra.modes import to_continuous
from orchestrator.linear.spectra.real_schur import RealSchur

Places = NDArray[np.int64]

_STAYS = 1e-9
"""A mode that the component moves by less than this part of its size [rad/s] stays. With 1e-8, what hundreds of such
modes do together showed in the seventh digit of others."""

_HELD_AGAINST = (0.6, 6.0, 60.0, 600.0)  # [rad/s], from slow swings to a network's
_DECAY = 0.1  # of these points, as a part of their size: beside the modes, and not among them
_CLOSE = 1e-6  # largest part by which answers in both ways may differ

_ROUNDS = 3  # of inverse iteration: the eigenvalue is known to many digits, and one nearly does
_BESIDE = 1e-7  # part of the eigenvalue's size by which the point lies beside it


class ChangedSpectra:
    """All eigenvalues of models that differ in the same equations as two of them do, or in others of those components.

    Raises `AnalysisError` where the two have other states or wires."""

    def __init__(self, one: LinearModel, other: LinearModel) -> None:
        self._model = _without(one, _equations_of(one, Change.between(one, other)))
        with one_thread():
            self._coordinates = RealSchur(self._model.A).coordinates()
        self._ends: _Ends | None = None

    def of(self, model: LinearModel) -> "ChangedSpectrum":
        """The eigenvalues of another one of the models.

        Raises `AnalysisError` where the rest's modes do not give its answers."""
        change = Change.between(self._model, model)
        with one_thread():
            if self._ends is None or not self._ends.hold(change):
                self._ends = self._ends_of(change, self._ends)
            return ChangedSpectrum(self._coordinates.values, self._ends, change, model.step_size)

    def seen(self, pair: Eigenpair) -> Eigenpair:
        """An eigenpair of a model with these states, in the coordinates of the modes."""
        both = np.array([pair.right.real, pair.right.imag]).T
        right = self._coordinates.columns(both) @ np.array([1.0, 1j])
        left = np.array([1.0, -1j]) @ self._coordinates.rows(
            np.array([pair.left.real, pair.left.imag])
        )
        return Eigenpair(pair.eigenvalue, left.conj(), right)

    def _ends_of(self, change: "Change", before: "_Ends | None") -> "_Ends":
        """The ends of all changes so far, in the coordinates of the modes, once they are held against the equations."""
        equations, read = change.equations, change.read
        if before is not None:
            equations = np.union1d(equations, before.equations)
            read = np.union1d(read, before.read)
        B, C, D = ends_in_states(self._model, equations, read)
        try:
            found = _Ends(
                equations, read, self._coordinates.columns(B), C=self._coordinates.rows(C), D=D
            )
        except np.linalg.LinAlgError as error:
            raise AnalysisError("modes of the rest of the system are defective") from error
        self._hold_against_equations(found, B, C)
        return found

    def _hold_against_equations(self, ends: "_Ends", B: Matrix, C: Matrix) -> None:
        step = self._model.step_size
        for omega in _HELD_AGAINST:
            point = omega * complex(-_DECAY, 1.0)
            sigma = np.exp(point * step) if step else point
            solver = self._model.shifted(sigma)
            exact = C @ np.column_stack([solver.solve_exactly(column) for column in B.T])
            with np.errstate(all="ignore"):  # what is not finite is not close
                mine = ends.C @ (ends.B / (self._coordinates.values - sigma)[:, None])
                off = float(np.abs(mine - exact).max() / np.abs(exact).max())
            if not off <= _CLOSE:
                raise AnalysisError(
                    f"the modes of the rest of the system give its answer at {omega:g} rad/s "
                    f"with an error of {off:.2g}"
                )


def ends_in_states(
    model: LinearModel, equations: Places, read: Places
) -> tuple[Matrix, Matrix, Matrix]:
    """B, C and D from what is added to equations, those of states first, to states and wires, read likewise.

    What is read is C·z + D·a where a is added to the equations; B·a is what that adds to the states' own."""
    n, m = model.G.shape
    added = np.zeros((n + m, len(equations)))
    added[equations, np.arange(len(equations))] = 1.0
    taken = np.zeros((n + m, len(read)))
    taken[read, np.arange(len(read))] = 1.0
    wires = model.settle(added[n:]) if m else added[n:]
    B = added[:n] + model.G @ wires
    C, D = taken[:n].T, np.zeros((len(read), len(equations)))
    if m:
        transposed = spla.splu(sp.csc_array((sp.eye_array(m) - model.K).T))
        C = C + (model.H.T @ transposed.solve(taken[n:])).T
        D = taken[n:].T @ wires
    return np.asarray(B), np.asarray(C), np.asarray(D)


@dataclass(frozen=True)
class Change:
    """Additions to some equations of states and wires (z⁺; w), by what they read of (z; w)."""

    equations: Places
    read: Places
    added: Matrix

    @classmethod
    def between(cls, one: LinearModel, other: LinearModel) -> "Change":
        if one.names != other.names or one.K.shape != other.K.shape:
            raise AnalysisError("the models have other states or wires")
        pairs = [(other.F, one.F), (other.G, one.G), (other.H, one.H), (other.K, one.K)]
        F, G, H, K = (sp.csr_array(a - b) for a, b in pairs)
        whole = sp.coo_array(sp.block_array([[F, G], [H, K]]))
        whole.eliminate_zeros()
        rows, columns = whole.coords
        equations, row = np.unique(rows, return_inverse=True)
        read, column = np.unique(columns, return_inverse=True)
        added = np.zeros((len(equations), len(read)))
        added[row, column] = whole.data
        return cls(equations.astype(np.int64), read.astype(np.int64), added)


@dataclass(frozen=True)
class _Ends:
    """The ends of a change: how B drives each mode and C sees it; D: how its equations act on what it reads at once."""

    equations: Places
    read: Places
    B: Vector
    C: Vector
    D: Matrix

    def hold(self, change: Change) -> bool:
        return bool(
            np.isin(change.equations, self.equations).all()
            and np.isin(change.read, self.read).all()
        )

    def between(self, change: Change) -> Matrix:
        """S of a change: what is added depends on what is read, which depends on what is added."""
        added = np.zeros((len(self.equations), len(self.read)))
        rows = np.searchsorted(self.equations, change.equations)
        added[np.ix_(rows, np.searchsorted(self.read, change.read))] = change.added
        return np.asarray(np.linalg.solve(np.eye(len(added)) - added @ self.D, added))


def _equations_of(model: LinearModel, change: Change) -> Places:
    """All equations of the components of which some change: of states first, then of wires."""
    names = [*model.names, *model.wires]
    components = {_component(names[k]) for k in change.equations.tolist() if k < len(names)}
    theirs = [k for k, name in enumerate(names) if _component(name) in components]
    return np.union1d(change.equations, np.array(theirs, dtype=np.int64))


def _component(name: str) -> str:
    return name.partition(".")[0]


def _without(model: LinearModel, equations: Iterable[int]) -> LinearModel:
    """The model with equations whose sides are 0, and what it reads of their states and wires as it was."""
    n, m = model.G.shape
    kept = np.ones(n + m)
    kept[list(equations)] = 0.0
    of_states, of_wires = sp.diags_array(kept[:n]), sp.diags_array(kept[n:])
    return replace(
        model,
        F=sp.csr_array(of_states @ model.F),
        G=sp.csr_array(of_states @ model.G),
        H=sp.csr_array(of_wires @ model.H),
        K=sp.csr_array(of_wires @ model.K),
    )


class ChangedSpectrum:
    """All eigenvalues of a model with a change.

    ``values``: eigenvalues [rad/s]."""

    def __init__(
        self, of_rest: Complex, ends: _Ends, change: Change, step_size: float | None
    ) -> None:
        self._rest, self._step = of_rest, step_size
        self._B, self._C = ends.B, ends.between(change) @ ends.C
        rates = _rates(of_rest, step_size)
        drives, sees = (np.linalg.norm(x, axis=axis) for x, axis in ((self._B, 1), (self._C, 0)))
        per_rate = np.abs(of_rest) * step_size if step_size else np.ones(len(of_rest))
        with np.errstate(invalid="ignore"):  # what dies at once has no rate, and is taken to move
            moves = ~(drives * sees <= _STAYS * np.abs(rates) * per_rate)
        moved = _eigenvalues_of(of_rest[moves], self._B[moves], self._C[:, moves])
        self._own = np.concatenate([of_rest[~moves], moved])
        self.values, _ = to_continuous(self._own, step_size)

    def pairs_near(self, wanted: complex, count: int) -> Sequence[Eigenpair]:
        """The eigenpairs nearest to a point [rad/s], their vectors in the coordinates of the rest's modes."""
        rates = _rates(self._own, self._step)
        nearest = np.argsort(np.abs(rates - wanted))[:count]
        return [self._pair(complex(rates[k]), complex(self._own[k])) for k in nearest.tolist()]

    def _pair(self, rate: complex, value: complex) -> Eigenpair:
        """By inverse iteration, which in these coordinates takes a small matrix alone."""
        sigma = value + _BESIDE * max(abs(rate), 1.0) * (1 + 1j) * (self._step or 1.0)
        beside = 1 / (self._rest - sigma)
        small = np.eye(len(self._C)) + (self._C * beside) @ self._B
        right = left = np.random.default_rng(0).standard_normal(len(beside)) + 0j
        for _ in range(_ROUNDS):
            right = beside * right
            right -= beside * (self._B @ np.linalg.solve(small, self._C @ right))
            right /= np.linalg.norm(right)
            left = beside.conj() * left
            by_change = np.linalg.solve(small.conj().T, self._B.conj().T @ left)
            left -= beside.conj() * (self._C.conj().T @ by_change)
            left /= np.linalg.norm(left)
        return Eigenpair(rate, left / np.vdot(right, left), right)


def _rates(values: Complex, step_size: float | None) -> Complex:
    """Eigenvalues λ [rad/s] from those of the matrix, also of what dies at once."""
    if step_size is None:
        return values
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(values.astype(complex)) / step_size)


def _eigenvalues_of(values: Complex, B: Vector, C: Vector) -> Complex:
    """All eigenvalues of diag(values) + B·C, which is similar to a real matrix.

    A pair's coordinates are conjugate: the half of their sum, and of their difference, are real ones."""
    upper = np.flatnonzero(values.imag > 0)
    alone = np.flatnonzero(values.imag == 0)
    own = _block_of(values[alone], values[upper])
    drives = np.vstack([B[alone].real, 2 * B[upper].real, -2 * B[upper].imag])
    sees = np.hstack([C[:, alone].real, C[:, upper].real, C[:, upper].imag])
    return np.asarray(scipy.linalg.eigvals(own + drives @ sees), dtype=complex)


def _block_of(alone: Complex, upper: Complex) -> Matrix:
    """A real matrix with some real eigenvalues, and with pairs of which the upper ones are given."""
    first, count = len(alone), len(upper)
    found = np.diag(np.concatenate([alone.real, upper.real, upper.real]))
    places = first + np.arange(count)
    found[places, places + count] = upper.imag
    found[places + count, places] = -upper.imag
    return found

"""The linear system of one operating point with its POD loops open, and closed with any setting.

Each loop is measured on the running FMU: from where its signal acts to its signal with unit gain and without lead/lag.
Washout, filter and sign are the FMU's own. Only the gain and the lead/lag are put in between here."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from orchestrator.core.arrays import Complex, Matrix, Vector
from orchestrator.linear.spectra.real_schur import RealSchur
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import LARGEST_STAGE_ANGLE, lead_lag_turning

MOST_VECTORS = 2500
"""Up to this number of states all eigenvectors of a system are computed; in larger ones those that are kept."""

REDUCED = 300  # systems with more states are reduced to their slow modes
# faster modes than this [rad/s] answer as they do at rest, unless loops move them
_FASTEST = 2 * np.pi * 30

LEAD = lead_lag_turning(2 * LARGEST_STAGE_ANGLE, 1.0, 2).filtering_ratio ** -2
"""Two stages of a lead/lag that leads most pass fast signals with this gain."""

_GAIN = 400.0
"""Gain [pu] of the loops by which a mode that stays is told. Fast modes meet it with the lead's on top."""

_MOVED = 0.02
"""Part of a mode's size; a mode that the loops move by less stays where it is."""

_SLOWEST = 0.3
"""Size [rad/s] that a slower mode counts as."""

_TRUE = 1e-6  # A reduction whose modes are not those of the system to this part is not taken
_SEEN = (0.05, 4.0)  # modes between these frequencies [Hz] are kept however little they move
# the setting of each loop that is closed; the others stay open
Setting = Mapping["PodPlace", PodSetting]


@dataclass(frozen=True, order=True)
class PodPlace:
    component: str
    controller: str

    @property
    def name(self) -> str:
        """``component.controller``."""
        return f"{self.component}.{self.controller}"

    @classmethod
    def of(cls, name: str) -> "PodPlace":
        component, _, controller = name.rpartition(".")
        return cls(component, controller)


@dataclass(frozen=True)
class ClosedLoop:
    values: Complex  # λ [rad/s]; of a reduced system, those that it left out stand last
    # left, right: eigenvectors as columns, of a reduced system in its own coordinates and without those that it left
    # out
    left: Complex
    right: Complex


@dataclass(frozen=True)
class OpenLoops:
    """ẋ = A·x + U·w and y = V·x + D·w: y are the loops' signals with unit gain, w is what acts in their place."""

    # A, U, V, D: shapes (r, r), (r, m), (m, r), (m, m)
    A: Vector
    U: Vector
    V: Vector
    D: Vector
    places: tuple[PodPlace, ...]
    names: tuple[str, ...]
    # right, left: from the states x to the n states, and back: shapes (n, r) and (r, n); None where both are the same
    right: Matrix | None = None
    left: Matrix | None = None
    # eigenvalues that the reduction left out [rad/s]: no loop moves them, or they are fast
    rest: Complex | None = None

    @classmethod
    def of(
        cls,
        A: Matrix,
        U: Matrix,
        V: Matrix,
        places: Sequence[PodPlace],
        names: Sequence[str],
        D: Matrix | None = None,
    ) -> "OpenLoops":
        """The system of full matrices, reduced where it is large.

        ``A`` and ``U`` and ``V``: shapes (n, n), (n, m), (m, n).
        ``D``: shape (m, m); none where no loop's signal reaches another, or itself, without a state between."""
        whole = cls(
            A,
            U,
            V,
            np.zeros((len(places), len(places))) if D is None else D,
            tuple(places),
            tuple(names),
        )
        return (_reduced(whole) if len(A) > REDUCED else None) or whole

    def closed(self, setting: Setting) -> Vector:
        """The matrix of the system with some loops closed.

        Returns shape (r + k, r + k): behind the states x stand those of the lead/lag stages, loop by loop."""
        used = [
            k for k, place in enumerate(self.places) if place in setting and setting[place].gain
        ]
        parts = [setting[self.places[k]] for k in used]
        stages = [part.filters.N_S if part.filters.T_S2 else 0 for part in parts]
        r, z = len(self.A), sum(stages)
        through, out = np.zeros(len(used)), np.zeros((len(used), z))
        own, entry = np.zeros((z, z)), np.zeros((z, len(used)))
        first = 0
        for j, (part, count) in enumerate(zip(parts, stages, strict=True)):
            lag = part.filters.T_S2
            ratio = part.filters.T_S1 / lag if count else 1.0
            for stage in range(count):
                row = first + stage
                own[row, row] = -1 / lag
                entry[row, j] = ratio**stage / lag
                for before in range(stage):
                    own[row, first + before] = ratio ** (stage - 1 - before) * (1 - ratio) / lag
                out[j, row] = part.gain * ratio ** (count - 1 - stage) * (1 - ratio)
            through[j] = part.gain * ratio**count
            first += count
        U, V, D = self.U[:, used], self.V[used], self.D[np.ix_(used, used)]
        turn = np.linalg.inv(np.eye(len(used)) - through[:, None] * D)
        P, Q = turn @ (through[:, None] * V), turn @ out
        whole = np.zeros((r + z, r + z), dtype=np.result_type(self.A, P))
        whole[:r, :r], whole[:r, r:] = self.A + U @ P, U @ Q
        whole[r:, :r], whole[r:, r:] = entry @ (V + D @ P), own + entry @ (D @ Q)
        return whole

    def solve(self, setting: Setting) -> ClosedLoop:
        values, left, right = scipy.linalg.eig(self.closed(setting), left=True, right=True)
        return ClosedLoop(self._with_rest(values), left, right)

    def eigenvalues(self, setting: Setting) -> Complex:
        return self._with_rest(np.linalg.eigvals(self.closed(setting)).astype(complex))

    def _with_rest(self, values: Complex) -> Complex:
        return values if self.rest is None else np.concatenate([values, self.rest])

    def all_names(self, size: int) -> tuple[str, ...]:
        """Names of the n states, and of as many stages as a closed loop of this size has."""
        return (*self.names, *(f"stage {k + 1}" for k in range(size - len(self.A))))

    def whole(self, vector: Complex, *, left: bool = False) -> Complex:
        """An eigenvector of a closed loop in all n states and the stages."""
        if self.right is None or self.left is None:
            return vector
        r = len(self.A)
        expanded = self.left.T @ vector[:r] if left else self.right @ vector[:r]
        return np.concatenate([expanded, vector[r:]])


def _reduced(whole: OpenLoops) -> OpenLoops | None:
    """The system without modes that no loop moves, and with fast ones at rest; None where its modes are ill-defined."""
    A, U, V = whole.A, whole.U, whole.V
    seen = _seen_by(A, V)
    inner = A[np.ix_(seen, seen)]
    try:
        modes = _Modes.of(inner, U[seen], V[:, seen])
    except np.linalg.LinAlgError:
        return None
    values, entries, exits = modes.values, modes.entries, modes.exits
    reach = _GAIN * np.linalg.norm(entries, axis=1) * np.linalg.norm(exits, axis=0)
    fast, hertz = np.abs(values) > _FASTEST, np.abs(values.imag) / (2 * np.pi)
    moved = reach > _MOVED * np.maximum(np.abs(values), _SLOWEST)
    swung = fast & (LEAD * reach > _MOVED * np.abs(values))
    kept = swung | (~fast & (moved | ((hertz > _SEEN[0]) & (hertz < _SEEN[1]))))
    resting = fast & ~swung
    at_rest = -(exits[:, resting] / values[resting]) @ entries[resting]
    matrix, there, back = _real_form(values[kept], *modes.vectors(kept))
    if np.abs(back @ inner @ there - matrix).max() > _TRUE * np.abs(inner).max():
        return None
    from_all, to_all = np.zeros((len(back), len(A))), np.zeros((len(A), len(back)))
    from_all[:, seen], to_all[seen] = back, there
    unseen = np.linalg.eigvals(A[np.ix_(~seen, ~seen)]).astype(complex)
    rest = np.concatenate([values[~kept], unseen])
    return OpenLoops(
        matrix,
        from_all @ U,
        V=V @ to_all,
        D=whole.D + at_rest.real,
        places=whole.places,
        names=whole.names,
        right=to_all,
        left=from_all,
        rest=rest,
    )


@dataclass(frozen=True)
class _Modes:
    """Modes of a matrix: their eigenvalues [rad/s], how they are driven and what is seen of them, and the vectors of
    some of them, rows and columns with rows·columns = 1."""

    values: Complex
    entries: Vector
    exits: Vector
    vectors: Callable[[NDArray[np.bool_]], tuple[Complex, Complex]]

    @classmethod
    def of(cls, A: Matrix, U: Matrix, V: Matrix) -> "_Modes":
        if len(A) > MOST_VECTORS:
            return cls._of_large(A, U, V)
        values, right = np.linalg.eig(A)
        values, right = values.astype(complex), right.astype(complex)
        rows = np.linalg.inv(right)
        return cls(values, rows @ U, V @ right, lambda kept: (rows[kept], right[:, kept]))

    @classmethod
    def _of_large(cls, A: Matrix, U: Matrix, V: Matrix) -> "_Modes":
        """The same by a Schur form, with the vectors of those modes alone that are asked for."""
        form = RealSchur(A)
        coordinates = form.coordinates()

        def vectors(kept: NDArray[np.bool_]) -> tuple[Complex, Complex]:
            left, right = form.vectors(np.flatnonzero(kept).tolist())
            rows = left.conj().T
            return np.linalg.solve(rows @ right, rows), right

        values = form.values.astype(complex)
        return cls(values, coordinates.columns(U), coordinates.rows(V), vectors)


def _seen_by(A: Matrix, V: Matrix) -> NDArray[np.bool_]:
    """Mask of the states that the loops' signals depend on, if only by way of other states.

    The others, such as those of controllers that are off, have eigenvalues of their own that no loop moves."""
    seen: NDArray[np.bool_] = np.asarray((V != 0).any(axis=0))
    while True:
        more = seen | (A[seen] != 0).any(axis=0)
        if (more == seen).all():
            return seen
        seen = more


def _real_form(values: Complex, rows: Complex, columns: Complex) -> tuple[Matrix, Matrix, Matrix]:
    """The real matrix of some modes, with blocks for pairs, and the way from its states to all and back.

    ``values``: λ [rad/s], shape (r,), both of every pair.
    ``rows`` and ``columns``: left and right eigenvectors with rows·columns = 1, shapes (r, n) and (n, r)."""
    real, upper = np.flatnonzero(values.imag == 0), np.flatnonzero(values.imag > 0)
    blocks = [np.array([[value]]) for value in values[real].real]
    blocks += [np.array([[z.real, z.imag], [-z.imag, z.real]]) for z in values[upper].tolist()]
    there = [
        *columns[:, real].real.T,
        *(part for k in upper for part in (columns[:, k].real, columns[:, k].imag)),
    ]
    back = [
        *rows[real].real,
        *(part for k in upper for part in (2 * rows[k].real, -2 * rows[k].imag)),
    ]
    return scipy.linalg.block_diag(*blocks), np.array(there).T, np.array(back)

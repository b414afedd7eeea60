"""The linear system of one operating point with its POD loops open, and closed with any setting.

Each loop is measured on the running FMU: from where its signal acts to its signal with unit gain and without lead/lag.
Washout, filter and sign are the FMU's own. Only the gain and the lead/lag are put in between here."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from orchestrator.core.arrays import Complex, Matrix, Vector
from orchestrator.linear.spectra.real_schur import RealSchur
from orchestrator.studies.coordinated_design.modal_loops import (
    ClosedModes,
    Feedback,
    ModalLoops,
    Places,
)
from orchestrator.studies.pod_design.closed_loop import PodSetting
from orchestrator.studies.pod_design.lead_lag import (
    LARGEST_STAGE_ANGLE,
    NO_COMPENSATION,
    lead_lag_turning,
)

MOST_VECTORS = 2500
"""Up to this number of states all eigenvectors of a system are computed; in larger ones those that are kept."""

REDUCED = 300  # systems with more states are reduced to their slow modes
MODAL = 250  # of reduced systems with more states, loops are closed in the coordinates of the modes
# faster modes than this [rad/s] answer as they do at rest, unless loops move them
_FASTEST = 2 * np.pi * 30

LEAD = lead_lag_turning(2 * LARGEST_STAGE_ANGLE, 1.0, 2).filtering_ratio ** -2
"""Two stages of a lead/lag that leads most pass fast signals with this gain."""

_GAIN = 400.0
"""Gain [pu] of the loops by which a mode that stays is told. Fast modes meet it with the lead's on top."""

_FELT = 1e-4
"""Part of a slow mode's size; one that the loops move by less is left out. It is the part of a loop's gain that is lost
with it as well: with 0.02, what a thousand modes of WECC's 240 buses lost together moved others by up to 1.3 %."""

_MOVED = 0.02
"""The same of a fast mode, of which the loops still feel its answer at rest: nobody looks at where it is itself."""

_SLOWEST = 0.3
"""Size [rad/s] that a slower mode counts as."""

# time constants of a lead/lag that differ by a smaller part turn nothing
_NEUTRAL = 1e-12
# gain [pu] of a loop that is closed to have its states alone; modes that 400 pu move by their size feel 10⁻⁸ of it
_UNFELT = 5e-6
_TRUE = 1e-2  # part of a loop's gain [400 pu] by which the answers of a reduction that is taken may be off
_HELD_AGAINST = (
    0.1,
    0.5,
    2.0,
)  # frequencies at which they are held against the whole system's [Hz]
_BESIDE_MODES = 0.1 + 1.0j  # points of these frequencies, of size 1: where no mode lies that decays
_SEEN = (0.05, 4.0)  # modes between these frequencies [Hz] are kept however little they move
# the setting of each loop that is closed; the others stay open
Setting = Mapping["PodPlace", PodSetting]
Answer = Callable[[complex], Vector]


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
    """All modes of closed loops.

    ``values``: λ [rad/s]; of a reduced system, those that it left out stand last.
    ``own``: number of those that have eigenvectors: all but those that a reduced system left out.
    ``vectors``: gives the left and right eigenvectors of some places, of the upper half or real, as columns; of a
    reduced system in its own coordinates."""

    values: Complex
    own: int
    vectors: Callable[[Sequence[int]], tuple[Complex, Complex]]


@dataclass(frozen=True)
class _Closing:
    """The part that closes loops: w = through·y + out·ξ, with states ξ of the lead/lag stages, ξ' = own·ξ + entry·y."""

    used: list[int]  # places of the loops that are closed
    feedback: Feedback
    through: Vector
    own: Matrix
    entry: Matrix
    out: Matrix


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
        answer: Answer | None = None,
    ) -> "OpenLoops":
        """The system of full matrices, reduced where it is large.

        ``A`` and ``U`` and ``V``: shapes (n, n), (n, m), (m, n).
        ``D``: shape (m, m); none where no loop's signal reaches another, or itself, without a state between.
        ``answer``: gives V·(sI − A)⁻¹·U at a point s [rad/s]; by default from the matrices, which takes long in a
        large system."""
        whole = cls(
            A,
            U,
            V,
            np.zeros((len(places), len(places))) if D is None else D,
            tuple(places),
            tuple(names),
        )
        if len(A) <= REDUCED:
            return whole
        return _reduced(whole, answer) or whole

    def answer(self, s: complex) -> Vector:
        """V·(sI − A)⁻¹·U at a point s [rad/s], shape (m, m)."""
        return np.asarray(self.V @ np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.U))

    def closed(self, setting: Setting) -> Vector:
        """The matrix of the system with some loops closed.

        Returns shape (r + k, r + k): behind the states x stand those of the lead/lag stages, loop by loop."""
        return self._matrix(self._closing(setting))

    def _closing(self, setting: Setting) -> _Closing:
        used = [
            k for k, place in enumerate(self.places) if place in setting and setting[place].gain
        ]
        parts = [setting[self.places[k]] for k in used]
        stages = [part.filters.N_S if part.filters.T_S2 else 0 for part in parts]
        z = sum(stages)
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
        gains = np.array([part.gain for part in parts])
        feedback = Feedback(gains, tuple(part.filters for part in parts))
        return _Closing(used, feedback, through=through, own=own, entry=entry, out=out)

    def _matrix(self, closing: _Closing) -> Vector:
        U, V, D = self._at(closing)
        P, Q = self._turned(closing)
        r, z = len(self.A), len(closing.own)
        whole = np.zeros((r + z, r + z), dtype=np.result_type(self.A, P))
        whole[:r, :r], whole[:r, r:] = self.A + U @ P, U @ Q
        whole[r:, :r] = closing.entry @ (V + D @ P)
        whole[r:, r:] = closing.own + closing.entry @ (D @ Q)
        return whole

    def _at(self, closing: _Closing) -> tuple[Vector, Vector, Vector]:
        used = tuple(closing.used)
        if used not in self._parts:
            rows = list(used)
            self._parts[used] = self.U[:, rows], self.V[rows], self.D[np.ix_(rows, rows)]
        return self._parts[used]

    @cached_property
    def _parts(self) -> dict[tuple[int, ...], tuple[Vector, Vector, Vector]]:
        """U, V and D of the loops that are closed: a search closes the same ones thousands of times."""
        return {}

    def _turned(self, closing: _Closing) -> tuple[Vector, Vector]:
        """Matrices of what acts in the place of the signals, by the states x and by those of the stages."""
        _, V, D = self._at(closing)
        through = closing.through[:, None]
        turn = np.linalg.inv(np.eye(len(V)) - through * D)
        return turn @ (through * V), turn @ closing.out

    def _trace(self, closing: _Closing) -> float:
        U, _, D = self._at(closing)
        P, Q = self._turned(closing)
        of_stages = np.trace(closing.own + closing.entry @ (D @ Q))
        return float(np.trace(self.A) + np.sum(U * P.T) + of_stages)

    def solve(self, setting: Setting) -> ClosedLoop:
        closing = self._closing(setting)
        modes, neutral = self._closed_modes(setting)
        if modes is not None:
            return ClosedLoop(
                self._with_rest(np.concatenate([modes.values, neutral])),
                len(modes.values),
                lambda places: self._real_vectors(modes, closing, places),
            )
        values, left, right = scipy.linalg.eig(self._matrix(closing), left=True, right=True)
        return ClosedLoop(
            self._with_rest(values), len(values), lambda places: (left[:, places], right[:, places])
        )

    def eigenvalues(self, setting: Setting) -> Complex:
        modes, neutral = self._closed_modes(setting)
        if modes is not None:
            return self._with_rest(np.concatenate([modes.values, neutral]))
        return self._with_rest(np.linalg.eigvals(self.closed(setting)).astype(complex))

    def _closed_modes(self, setting: Setting) -> tuple[ClosedModes | None, Complex]:
        """The modes by way of those of the open loops, and those of lead/lags that turn nothing, or nothing that is
        felt, which stay where they are.

        None of a small system, of one that is not reduced, whose vectors may be ill-defined, and where they cannot be
        told so."""
        neutral: list[complex] = []
        if self.right is None or len(self.A) <= MODAL:
            return None, np.array(neutral)
        turning = dict(setting)
        for place, one in setting.items():
            filters = one.filters
            turns = filters.T_S2 and abs(filters.T_S1 / filters.T_S2 - 1) >= _NEUTRAL
            if filters.T_S2 and not (turns and one.gain > _UNFELT):
                turning[place] = replace(one, filters=NO_COMPENSATION)
                shown = place in self.places and one.gain
                neutral += [-1 / filters.T_S2 + 0j] * (filters.N_S if shown else 0)
        closing = self._closing(turning)
        modal = self._modal(closing.used)

        def small(places: Places) -> Complex:
            columns = self._columns[places]
            part = replace(
                self,
                A=self.A[np.ix_(columns, columns)],
                U=self.U[columns],
                V=self.V[:, columns],
            )
            return np.linalg.eigvals(part._matrix(closing)).astype(complex)

        found = modal.closed(closing.feedback, self._trace(closing), small)
        return found, np.array(neutral, dtype=complex)

    def _modal(self, used: list[int]) -> ModalLoops:
        """The loops of some places in the coordinates of the modes, which are those of the blocks of A."""
        known, key = self._modal_loops, tuple(used)
        if key not in known:
            p, U, V = self._pairs, self.U[:, used], self.V[used]
            real = len(self.A) - 2 * p
            first, second = slice(real, None, 2), slice(real + 1, None, 2)
            values = np.diag(self.A).astype(complex)
            upper = values[first] + 1j * np.diag(self.A, 1)[first]
            driven, seen = (U[first] - 1j * U[second]) / 2, V[:, first] + 1j * V[:, second]
            known[key] = ModalLoops(
                np.concatenate([values[:real], upper, upper.conj()]),
                np.vstack([U[:real], driven, driven.conj()]),
                C=np.hstack([V[:, :real], seen, seen.conj()]),
                D=self.D[np.ix_(used, used)],
            )
        return known[key]

    @cached_property
    def _modal_loops(self) -> dict[tuple[int, ...], ModalLoops]:
        return {}

    @cached_property
    def _pairs(self) -> int:
        return int((np.diag(self.A, 1) != 0).sum())

    @cached_property
    def _columns(self) -> Places:
        """For each mode its column: of the upper half of a pair the first, of the lower half the second."""
        real = len(self.A) - 2 * self._pairs
        rest = np.arange(real, len(self.A))
        return np.concatenate([np.arange(real), rest[::2], rest[1::2]])

    def _real_vectors(
        self, modes: ClosedModes, closing: _Closing, places: Sequence[int]
    ) -> tuple[Complex, Complex]:
        """Left and right eigenvectors as columns, of the real states and those of the stages."""
        found, p = modes.vectors(places), self._pairs
        real, n, k = len(self.A) - 2 * p, len(self.A), len(places)
        right, left = (np.zeros((k, n + len(closing.own)), dtype=complex) for _ in range(2))
        first, second = slice(real, n, 2), slice(real + 1, n, 2)
        for to, given, turn in ((right, found.right, 1j), (left, found.left / 2, -1j)):
            upper, lower = given[:, real : real + p], given[:, real + p :]
            to[:, :real] = given[:, :real]
            to[:, first], to[:, second] = upper + lower, turn * (upper - lower)
        left[:, :real] *= 2
        if len(closing.own):
            inner = (
                modes.values[list(places)][:, None, None] * np.eye(len(closing.own)) - closing.own
            )
            right[:, n:] = np.linalg.solve(inner, (found.signals @ closing.entry.T)[:, :, None])[
                :, :, 0
            ]
            turned = inner.transpose(0, 2, 1)
            left[:, n:] = np.linalg.solve(turned, (found.weights @ closing.out)[:, :, None])[
                :, :, 0
            ]
        return left.conj().T, right.T

    def _with_rest(self, values: Complex) -> Complex:
        return values if self.rest is None else np.concatenate([values, self.rest])

    def all_names(self, size: int) -> tuple[str, ...]:
        """Names of the n states, and of as many stages as a closed loop of this size has."""
        return (*self.names, *(f"stage {k + 1}" for k in range(size - len(self.A))))

    def whole(self, vector: Complex, *, left: bool = False) -> Complex:
        """Eigenvectors of a closed loop, one or columns, in all n states and the stages."""
        if self.right is None or self.left is None:
            return vector
        r = len(self.A)
        expanded = self.left.T @ vector[:r] if left else self.right @ vector[:r]
        return np.concatenate([expanded, vector[r:]])


def _reduced(whole: OpenLoops, answer: Answer | None = None) -> OpenLoops | None:
    """The system without modes that no loop moves, and with fast ones at rest; None where its modes are ill-defined, so
    that its answers are not those of the whole."""
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
    felt = reach > _FELT * np.maximum(np.abs(values), _SLOWEST)
    swung = fast & (LEAD * reach > _MOVED * np.abs(values))
    kept = swung | (~fast & (felt | ((hertz > _SEEN[0]) & (hertz < _SEEN[1]))))
    resting = fast & ~swung
    at_rest = -(exits[:, resting] / values[resting]) @ entries[resting]
    matrix, there, back = _real_form(values[kept], *modes.vectors(kept))
    from_all, to_all = np.zeros((len(back), len(A))), np.zeros((len(A), len(back)))
    from_all[:, seen], to_all[seen] = back, there
    unseen = np.linalg.eigvals(A[np.ix_(~seen, ~seen)]).astype(complex)
    rest = np.concatenate([values[~kept], unseen])
    found = OpenLoops(
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
    exact = answer or whole.answer
    points = [2 * np.pi * hertz * _BESIDE_MODES for hertz in _HELD_AGAINST]
    off = [np.abs(found.answer(s) + at_rest.real - exact(s)).max() for s in points]
    return found if _GAIN * max(off) <= _TRUE else None


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

"""A − σI of a large system at many points σ, with a few equations set apart that take in almost everything: the hub.

A network's port voltages depend on all units, and each unit on the voltages of its own bus alone. Without the hub the
equations fall apart into small blocks. They are eliminated exactly; what is left is a dense block of the hub's size:

    | P  Q | |x|   |b|      x = P⁻¹·(b − Q·y),   (T − R·P⁻¹·Q)·y = c − R·P⁻¹·b
    | R  T | |y| = |c|

Nothing is neglected. A sparse factorisation of the whole does not see the blocks: its order of elimination, made for
rows with few entries, lets the hub's rows fill almost everything.

For a search the dense block may be divided (`divided_hub`): a solution is close then, and exact once it is refined."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix, Vector
from orchestrator.linear.models.divided_hub import DividedHub, divide, through_lu, times
from orchestrator.linear.models.separate_blocks import (
    BlockFactors,
    SeparateBlocks,
    by_size,
    separate_blocks,
)

BUSY = 100  # an equation with more unknowns than this belongs to the hub
# models with a smaller hub keep the sparse factorisation of the whole, and with it their last
# digits
LEAST_HUB = 200
_ACCURATE = 1e-9
"""Largest part of a right side that a solution may leave over. Otherwise σ is too close to an eigenvalue of a block,
and the whole is factorised instead."""

_ROUNDED = 1e-12
"""The same as a part of the terms that an equation adds up: where states are far larger than the right side, as next to
many zeros, no solution leaves over less than rounding does of them. ACTIVSg2000 at 1e-3 rad/s: 1e-13 before a
correction and 1e-16 behind it, which are 7e-5 and 1e-7 of the right side; a sparse factorisation leaves over 4e-8."""

_NEAR = 1e-4
"""The same for a solution by a divided hub before it is refined; a correction leaves over about the square of it. Where
more is left over, each solution is corrected: to factorise a whole hub takes longer (4,626 equations of 9,241 buses: 7
s, and a correction 0.15 s)."""

Places = NDArray[np.int64]


class HubSolver(Protocol):
    """The dense rest T − σ − R·P⁻¹·Q, factorised, and R itself; right sides have the shape (h, c), x has (k, c)."""

    def solve(self, right: Vector, entered: Vector) -> Vector:
        """Solve for right − R·x, with the entered places' x."""

    def solve_adjoint(self, right: Vector) -> tuple[Vector, Vector]:
        """Return y and Rᵀ·y."""


@dataclass(frozen=True)
class LeftOver:
    """The rest of its equations that a solution leaves over.

    ``of_right``: as a part of the right side's largest element.
    ``size``: its largest element.
    ``terms``: adds up the sizes of each equation's terms, which takes longer than a solution, and returns the largest
    sum."""

    of_right: float
    size: float
    terms: Callable[[], float]

    @property
    def of_terms(self) -> float:
        """Its size, as a part of the largest sum of the sizes of an equation's terms."""
        return self.size / self.terms()

    @property
    def is_accurate(self) -> bool:
        """Tell if it is little, or no more than rounding."""
        return self.of_right <= _ACCURATE or self.of_terms <= _ROUNDED


@dataclass(frozen=True)
class DenseHub:
    lu: tuple[Matrix, Places]
    entering: Matrix  # R

    def solve(self, right: Vector, entered: Vector) -> Vector:
        return through_lu(self.lu, right - times(self.entering, entered))

    def solve_adjoint(self, right: Vector) -> tuple[Vector, Vector]:
        y = through_lu(self.lu, right, adjoint=True)
        return y, times(self.entering.T, y)

    @property
    def log_determinant(self) -> complex:
        """Log of the rest's determinant; its imaginary part lacks whole turns."""
        factors, rows = self.lu
        flips = int((rows != np.arange(len(rows))).sum())
        return complex(np.log(factors.diagonal().astype(complex)).sum() + 1j * np.pi * flips)


@dataclass(frozen=True)
class _DenseRows:
    """Some columns of the hub's equations, dense where rows are asked for: all of them take hundreds of megabytes."""

    whole: sp.csr_array
    hub: Places
    columns: Places

    def __len__(self) -> int:
        return len(self.hub)

    def __getitem__(self, rows: slice) -> Matrix:
        starts, numbers = self.whole.indptr, np.zeros(self.whole.shape[1])
        some = self.hub[rows]
        found = np.empty((len(some), len(self.columns)))
        for k, row in enumerate(some.tolist()):
            own = slice(starts[row], starts[row + 1])
            places = self.whole.indices[own]
            numbers[places] = self.whole.data[own]
            np.take(numbers, self.columns, out=found[k], mode="clip")
            numbers[places] = 0.0
        return found

    def take(self, columns: Places, _: int) -> "_DenseRows":
        """See `SomeRows.take`."""
        return replace(self, columns=self.columns[columns])


@dataclass(frozen=True)
class HubEquations:
    """The equations of a linear model without σ, in their parts, and what does not depend on σ."""

    # the equations z⁺ − F·z − G·w = 0, w − H·z − K·w = 0 with turned signs, shape (n + m, n + m), where m counts only
    # what somebody takes
    whole: sp.csr_array
    states: int  # number n of states, which come first
    hub: Places
    rest: Places

    @cached_property
    def quadrants(self) -> tuple[sp.csc_array, sp.csc_array]:
        """P and Q of the module's text, with σ = 0."""
        upper = self.whole[self.rest]
        return upper[:, self.rest].tocsc(), upper[:, self.hub].tocsc()

    @cached_property
    def entered(self) -> Places:
        """Columns of R that are not zero."""
        taken = np.zeros(self.whole.shape[1], dtype=bool)
        for columns, _ in self._equations_of_hub():
            taken[columns] = True
        return np.flatnonzero(taken[self.rest])

    @cached_property
    def whole_hub(self) -> tuple[Matrix, Matrix]:
        """T, and of R the columns that are not zero, column by column: nearly full, as they are."""
        return self._columns(self.hub)[:], np.asfortranarray(self._columns(self._of_rest)[:])

    @property
    def _of_rest(self) -> Places:
        """Places of the entered unknowns among all."""
        return self.rest[self.entered]

    def _columns(self, places: Places) -> "_DenseRows":
        return _DenseRows(self.whole, self.hub, places)

    def _equations_of_hub(self) -> Iterator[tuple[Places, Vector]]:
        """Yield the columns and the numbers of each equation."""
        starts = self.whole.indptr
        for row in self.hub.tolist():
            own = slice(starts[row], starts[row + 1])
            yield self.whole.indices[own], self.whole.data[own]

    @cached_property
    def blocks(self) -> tuple[int, Places]:
        """Number of blocks that the rest falls apart into, and the block of each of its unknowns."""
        count, block = sp.csgraph.connected_components(self.quadrants[0], directed=False)
        return int(count), block.astype(np.int64)

    @cached_property
    def colours(self) -> tuple[Places, Places]:
        """A colour for each column of Q, such that no two of one colour enter the same block; and, by block and colour,
        the column, or −1."""
        count, block = self.blocks
        Q = self.quadrants[1]
        colour = np.full(Q.shape[1], -1, dtype=np.int64)
        owner = np.full((count, 0), -1, dtype=np.int64)
        for k in range(Q.shape[1]):
            entered = np.unique(block[Q.indices[Q.indptr[k] : Q.indptr[k + 1]]])
            if not len(entered):
                continue
            free = np.flatnonzero((owner[entered] < 0).all(axis=0))
            if not len(free):
                owner = np.column_stack([owner, np.full(count, -1)])
                free = np.array([owner.shape[1] - 1])
            colour[k] = free[0]
            owner[entered, free[0]] = k
        return colour, owner

    @cached_property
    def divided(self) -> DividedHub | None:
        """The hub in halves; None where that is not worth while."""
        Q, T, R = self.quadrants[1], self._columns(self.hub)[:], self._columns(self._of_rest)
        count, block = self.blocks
        entries = Q.tocoo()
        rows, columns = block[entries.coords[0]], count + entries.coords[1]
        ties = sp.coo_array((np.ones(len(rows)), (rows, columns)), shape=2 * (count + len(T),))
        _, group = sp.csgraph.connected_components(ties, directed=False)
        owner, taker = group[count:], group[block[self.entered]]
        # what no equation of the hub moves belongs to the one that takes most of it
        still = ~np.isin(taker, owner)
        if still.any():
            takes = self._columns(self._of_rest[still])[:]
            taker[still] = owner[np.abs(takes).argmax(axis=0)]
        numbers = np.unique(owner)
        owner, taker = (np.searchsorted(numbers, of) for of in (owner, taker))
        return divide(T, R, self._sizes, self.hub < self.states, owner, taker)

    @property
    def _sizes(self) -> Vector:
        """Size of each of the hub's equations, but for what it takes of its own unknown; 1 where it takes nothing."""
        equations = zip(self.hub.tolist(), self._equations_of_hub(), strict=True)
        sizes = np.array(
            [np.linalg.norm(values[columns != row]) for row, (columns, values) in equations]
        )
        return np.where(sizes > 0, sizes, 1.0)

    def at(self, sigma: complex) -> "HubFactors | None":
        """Factorise at σ; None where σ is so close to an eigenvalue of a block that the answer would be inaccurate."""
        found = self._through_blocks(sigma)
        if found is None:
            return None
        blocks, inside = found
        T, R = self.whole_hub
        schur = T.astype(np.result_type(inside.dtype, sigma), order="F")
        among = np.flatnonzero(self.hub < self.states)
        schur[among, among] -= sigma
        self._take_in_columns(inside, schur)
        lu = scipy.linalg.lu_factor(schur, overwrite_a=True, check_finite=False)
        factors = HubFactors(self, sigma, blocks, inside, DenseHub(lu, R))
        return factors if next(factors.left_over(self._trial(schur.dtype))).is_accurate else None

    def near_at(self, sigma: complex) -> "HubFactors | None":
        """The same by the divided hub, where there is one: `solve_exactly` is as accurate, `solve` is close."""
        if self.divided is None:
            return self.at(sigma)
        found = self._through_blocks(complex(sigma))
        if found is None:
            return None
        blocks, inside = found
        hub = self.divided.at(sigma, inside[self.entered])
        factors = HubFactors(self, sigma, blocks, inside, hub)
        left = factors.left_over(self._trial(np.dtype(complex)))
        is_near = next(left).of_right <= _NEAR
        if not next(left).is_accurate:
            return self.at(sigma)
        return factors if is_near else replace(factors, is_near=False)

    def _trial(self, kind: np.dtype) -> Vector:
        return np.random.default_rng(1).standard_normal(self.states).astype(kind)

    def _take_in_columns(self, inside: sp.csc_array, schur: Matrix) -> None:
        """Subtract R·inside in place: a few whole columns of R for each, as no sparse product takes them."""
        dense = self.whole_hub[1]
        turned = sp.csr_array(inside[self.entered].T)
        if not np.iscomplexobj(schur):
            schur -= (turned @ dense.T).T
            return
        schur.real -= (turned.real @ dense.T).T
        schur.imag -= (turned.imag @ dense.T).T

    @cached_property
    def separate(self) -> SeparateBlocks:
        return separate_blocks(self.quadrants[0], (self.rest < self.states).astype(float))

    def _through_blocks(self, sigma: complex) -> tuple[BlockFactors, sp.csc_array] | None:
        """P − σ factorised, and P⁻¹·Q, solved for all columns of one colour at once."""
        blocks = self.separate.at(sigma)
        if blocks is None:
            return None
        P, Q = self.quadrants
        kind = np.result_type(P.dtype, sigma)
        colour, owner = self.colours
        _, block = self.blocks
        entries = Q.tocoo()
        right = np.zeros((Q.shape[0], owner.shape[1]), dtype=kind)
        rows, columns = entries.coords
        right[rows, colour[columns]] = entries.data
        solution = blocks.solve(right)
        columns_of = owner[block]
        rows, colours = np.nonzero((columns_of >= 0) & (solution != 0))
        places = (rows, columns_of[rows, colours])
        return blocks, sp.coo_array((solution[rows, colours], places), shape=Q.shape).tocsc()


@dataclass(frozen=True)
class HubFactors:
    """A − σI, factorised in its parts."""

    equations: HubEquations
    sigma: complex
    blocks: BlockFactors
    inside: sp.csc_array
    port: HubSolver
    is_near: bool = True  # whether a solution serves a search without a correction

    def solve(self, right: Vector) -> Vector:
        """X with (A − σI)·x = right, shape (n,) or (n, c)."""
        return self._states_of(right, self._solve if self.is_near else self._exact_solution)

    def solve_adjoint(self, right: Vector) -> Vector:
        """X with (A − σI)ᴴ·x = right, shape (n,) or (n, c)."""
        return self._states_of(right, self._solve_adjoint if self.is_near else self._exact_adjoint)

    def solve_exactly(self, right: Vector) -> Vector:
        """The same as `solve`, corrected once by what it leaves over of the equations."""
        return self._states_of(right, self._exact_solution)

    def solve_adjoint_exactly(self, right: Vector) -> Vector:
        return self._states_of(right, self._exact_adjoint)

    def left_over(self, right: Vector) -> Iterator[LeftOver]:
        """Yield what a solution leaves over of a right side, shape (n,).

        First that of `solve`, then that of `solve_exactly`, which goes on from there."""
        b = self._right(right[:, None])
        found, rest = np.zeros_like(b), b
        while True:
            found = found + self._solve(rest)
            rest = b - self._product(found)
            left = float(np.abs(rest).max())
            left = left if np.isfinite(left) else np.inf
            of_right = left / float(np.abs(right).max())
            yield LeftOver(of_right, left, partial(self._terms, found))

    @property
    def log_determinant(self) -> complex:
        """Log det of the equations, by a hub that is whole; its imaginary part lacks whole turns."""
        assert isinstance(self.port, DenseHub)
        return self.blocks.log_determinant + self.port.log_determinant

    def _states_of(self, right: Vector, solve: Callable[[Vector], Vector]) -> Vector:
        columns = right if right.ndim == 2 else right[:, None]
        return solve(self._right(columns))[: self.equations.states].reshape(right.shape)

    def _exact_solution(self, b: Vector) -> Vector:
        found = self._solve(b)
        return found + self._solve(b - self._product(found))

    def _exact_adjoint(self, b: Vector) -> Vector:
        found = self._solve_adjoint(b)
        return found + self._solve_adjoint(b - self._adjoint_product(found))

    def _solve(self, b: Vector) -> Vector:
        e = self.equations
        x = self.blocks.solve(b[e.rest])
        y = self.port.solve(b[e.hub], x[e.entered])
        found = np.empty_like(b)
        found[e.rest], found[e.hub] = x - self.inside @ y, y
        return found

    def _solve_adjoint(self, b: Vector) -> Vector:
        e = self.equations
        beside = (self.inside.T @ b[e.rest].conj()).conj()
        y, out = self.port.solve_adjoint(b[e.hub] - beside)
        rest = b[e.rest]
        rest[e.entered] -= out
        found = np.empty_like(b)
        found[e.rest], found[e.hub] = self.blocks.solve(rest, "H"), y
        return found

    def _product(self, x: Vector) -> Vector:
        e = self.equations
        found = times(e.whole, x)
        found[: e.states] -= self.sigma * x[: e.states]
        return found

    def _terms(self, x: Vector) -> float:
        """The largest sum of the sizes of an equation's terms; 1 where one is no number."""
        sizes = np.abs(x)
        found = abs(self.equations.whole) @ sizes
        found[: self.equations.states] += abs(self.sigma) * sizes[: self.equations.states]
        largest = float(found.max())
        return largest if np.isfinite(largest) else 1.0

    def _adjoint_product(self, x: Vector) -> Vector:
        e = self.equations
        found = times(e.whole.T, x)
        found[: e.states] -= np.conj(self.sigma) * x[: e.states]
        return found

    def _right(self, right: Vector) -> Vector:
        kind = np.result_type(self.inside.dtype, right.dtype)
        b = np.zeros((self.equations.whole.shape[0], right.shape[1]), dtype=kind)
        b[: self.equations.states] = right
        return b


def hub_equations(
    F: sp.csr_array, G: sp.csr_array, H: sp.csr_array, K: sp.csr_array
) -> HubEquations | None:
    """The equations with their hub; None where there is no hub worth setting apart."""
    n, G, K = F.shape[0], _without_zeros(G), _without_zeros(K)
    whole = _put_together(F, G, H=H, K=K, taken=_places_taken(G, K))
    busy = np.diff(whole.indptr) > BUSY
    if busy.sum() < LEAST_HUB:
        return None
    rest = np.flatnonzero(~busy)
    rest = rest[by_size(whole[rest][:, rest])]
    return HubEquations(whole, n, np.flatnonzero(busy), rest)


def _without_zeros(matrix: sp.csr_array) -> sp.csr_array:
    """The matrix without numbers that are there and 0; itself where there are none."""
    if matrix.data.all():
        return matrix
    found = matrix.copy()
    found.eliminate_zeros()
    return found


def _places_taken(G: sp.csr_array, K: sp.csr_array) -> Places:
    """Places in w of what reaches a next state, at once or through other values; no number of both is 0."""
    reached = np.zeros(G.shape[1], dtype=bool)
    reached[G.indices] = True
    new = reached.copy()
    while new.any():
        more = reached.copy()
        for row in np.flatnonzero(new).tolist():
            more[K.indices[K.indptr[row] : K.indptr[row + 1]]] = True
        new, reached = more & ~reached, more
    return np.flatnonzero(reached)


def _put_together(
    F: sp.csr_array, G: sp.csr_array, *, H: sp.csr_array, K: sp.csr_array, taken: Places
) -> sp.csr_array:
    """[[F, G], [H, K − 1]], of w the places that are taken.

    Most numbers are a network's answers, many millions in few rows. Each is written once, to where it stays."""
    n, m = F.shape[0], len(taken)
    states, w = np.arange(n, dtype=np.int32), np.full(K.shape[0], -1, dtype=np.int32)
    w[taken] = n + np.arange(m)
    less_one = -sp.eye_array(K.shape[0], format="csr")
    if K.diagonal().any():
        K, less_one = sp.csr_array(K + less_one), sp.csr_array(K.shape)
    parts = (
        (F, states, 0, states),
        (G, states, 0, w),
        (H, taken, n, states),
        (K, taken, n, w),
        (less_one, taken, n, w),
    )
    counts = np.zeros(n + m, dtype=np.int64)
    for part, rows, first, _ in parts:
        counts[first : first + len(rows)] += np.diff(part.indptr)[rows]
    starts = np.concatenate([[0], np.cumsum(counts)])
    columns, values = np.empty(starts[-1], dtype=np.int32), np.empty(starts[-1])
    free = starts[:-1].copy()  # where the next number of each row goes
    for part, rows, first, names in parts:
        lengths = np.diff(part.indptr)[rows]
        for k in np.flatnonzero(lengths > BUSY).tolist():
            begin, to = part.indptr[rows[k]], free[first + k]
            own, place = slice(begin, begin + lengths[k]), slice(to, to + lengths[k])
            columns[place], values[place] = names[part.indices[own]], part.data[own]
        short = np.flatnonzero(lengths <= BUSY)
        some = part[rows[short]]
        before = np.repeat(free[first + short] - some.indptr[:-1], lengths[short])
        places = before + np.arange(some.nnz)
        columns[places], values[places] = names[some.indices], some.data
        free[first : first + len(rows)] += lengths
    if starts[-1] <= np.iinfo(np.int32).max:
        starts = starts.astype(np.int32)
    return sp.csr_array((values, columns, starts), shape=(n + m, n + m))

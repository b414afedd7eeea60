"""A − σI of a large system at many points σ, with a few equations set apart that take in almost everything: the hub.

A network's port voltages depend on all units, and each unit on the voltages of its own bus alone. Without the hub the
equations fall apart into small blocks. They are eliminated exactly; what is left is a dense block of the hub's size:

    | P  Q | |x|   |b|      x = P⁻¹·(b − Q·y),   (T − R·P⁻¹·Q)·y = c − R·P⁻¹·b
    | R  T | |y| = |c|

Nothing is neglected. A sparse factorisation of the whole does not see the blocks: its order of elimination, made for
rows with few entries, lets the hub's rows fill almost everything."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix, Vector

BUSY = 100  # an equation with more unknowns than this belongs to the hub
# models with a smaller hub keep the sparse factorisation of the whole, and with it their last
# digits
LEAST_HUB = 200
_ACCURATE = 1e-9
"""Largest part of a right side that a solution may leave over. Otherwise σ is too close to an eigenvalue of a block,
and the whole is factorised instead."""

Places = NDArray[np.int64]


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
    def quadrants(self) -> tuple[sp.csc_array, sp.csc_array, sp.csr_array, Matrix]:
        """P, Q, R and T of the module's text, with σ = 0."""
        upper, lower = self.whole[self.rest], self.whole[self.hub]
        return (
            upper[:, self.rest].tocsc(),
            upper[:, self.hub].tocsc(),
            lower[:, self.rest].tocsr(),
            lower[:, self.hub].toarray(),
        )

    @cached_property
    def into_hub(self) -> tuple[Places, Matrix]:
        """Columns of R that are not zero, and their dense matrix, column by column: nearly full, as they are."""
        R = self.quadrants[2]
        entered = np.unique(R.indices)
        return entered, R[:, entered].toarray(order="F")

    def taken_in(self, x: Vector) -> Vector:
        """R·x, for x of shape (k,) or (k, c), complex or not."""
        entered, dense = self.into_hub
        return _times(dense, x[entered])

    def given_out(self, y: Vector) -> Vector:
        """Rᵀ·y, for y of shape (h,) or (h, c), complex or not."""
        entered, dense = self.into_hub
        whole = np.zeros((len(self.rest), *y.shape[1:]), dtype=y.dtype)
        whole[entered] = _times(dense.T, y)
        return whole

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

    def at(self, sigma: complex) -> "HubFactors | None":
        """Factorise at σ; None where σ is so close to an eigenvalue of a block that the answer would be inaccurate."""
        P, Q, _, T = self.quadrants
        at_rest = sp.diags_array((self.rest < self.states).astype(float))
        try:
            blocks = spla.splu((P - sigma * at_rest).tocsc())
        except RuntimeError:
            return None
        schur = T.astype(np.result_type(T, sigma), order="F")  # as LAPACK takes it
        among = np.flatnonzero(self.hub < self.states)
        schur[among, among] -= sigma
        inside = self._through_blocks(blocks, Q, schur.dtype)
        self._take_in_columns(inside, schur)
        port = scipy.linalg.lu_factor(schur, overwrite_a=True, check_finite=False)
        factors = HubFactors(self, sigma, blocks, inside, port)
        trial = np.random.default_rng(1).standard_normal(self.states).astype(schur.dtype)
        return factors if factors.left_over(trial) <= _ACCURATE else None

    def _take_in_columns(self, inside: sp.csc_array, schur: Matrix) -> None:
        """Subtract R·inside in place: a few whole columns of R for each, as no sparse product takes them."""
        entered, dense = self.into_hub
        turned = sp.csr_array(inside[entered].T)
        if not np.iscomplexobj(schur):
            schur -= (turned @ dense.T).T
            return
        schur.real -= (turned.real @ dense.T).T
        schur.imag -= (turned.imag @ dense.T).T

    def _through_blocks(
        self, blocks: spla.SuperLU, Q: sp.csc_array, kind: np.dtype
    ) -> sp.csc_array:
        """P⁻¹·Q, solved for all columns of one colour at once."""
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
        return sp.coo_array((solution[rows, colours], places), shape=Q.shape).tocsc()


@dataclass(frozen=True)
class HubFactors:
    """A − σI, factorised in its parts."""

    equations: HubEquations
    sigma: complex
    blocks: spla.SuperLU
    inside: sp.csc_array
    port: tuple[Matrix, Places]

    def solve(self, right: Vector) -> Vector:
        """X with (A − σI)·x = right, shape (n,) or (n, c)."""
        return self._whole(right)[: self.equations.states]

    def solve_adjoint(self, right: Vector) -> Vector:
        """X with (A − σI)ᴴ·x = right, shape (n,) or (n, c)."""
        e = self.equations
        b = self._right(right)
        beside = (self.inside.T @ b[e.rest].conj()).conj()
        y = scipy.linalg.lu_solve(self.port, b[e.hub] - beside, trans=2, check_finite=False)
        b[e.rest], b[e.hub] = self.blocks.solve(b[e.rest] - e.given_out(y), "H"), y
        return b[: e.states]

    def left_over(self, right: Vector) -> float:
        """Return what a solution leaves over of a right side, shape (n,), as a part of its largest element."""
        e = self.equations
        found = self._whole(right)
        rest = _times(e.whole, found)
        rest[: e.states] -= self.sigma * found[: e.states] + right
        left = float(np.abs(rest).max() / np.abs(right).max())
        return left if np.isfinite(left) else np.inf

    def _whole(self, right: Vector) -> Vector:
        e = self.equations
        b = self._right(right)
        x = self.blocks.solve(b[e.rest])
        y = scipy.linalg.lu_solve(self.port, b[e.hub] - e.taken_in(x), check_finite=False)
        b[e.rest], b[e.hub] = x - self.inside @ y, y
        return b

    def _right(self, right: Vector) -> Vector:
        b = np.zeros((self.equations.whole.shape[0], *right.shape[1:]), dtype=self.port[0].dtype)
        b[: self.equations.states] = right
        return b


def _times(real: Matrix | sp.csr_array, vector: Vector) -> Vector:
    """A real matrix times vectors, whose real and imaginary parts are taken together, without a complex copy."""
    if not np.iscomplexobj(vector):
        return np.asarray(real @ vector)
    columns = vector.reshape(len(vector), vector.shape[1] if vector.ndim == 2 else 1)
    product = real @ np.ascontiguousarray(columns).view(float)
    return np.ascontiguousarray(product).view(complex).reshape(real.shape[0], *vector.shape[1:])


def hub_equations(
    F: sp.csr_array, G: sp.csr_array, H: sp.csr_array, K: sp.csr_array
) -> HubEquations | None:
    """The equations with their hub; None where there is no hub worth setting apart."""
    n = F.shape[0]
    taken = _places_taken(G, K)
    G, H, K = G[:, taken], H[taken], K[taken][:, taken]
    whole = sp.block_array([[F, G], [H, K - sp.eye_array(len(taken))]], format="csr")
    busy = np.diff(whole.indptr) > BUSY
    if busy.sum() < LEAST_HUB:
        return None
    return HubEquations(whole, n, np.flatnonzero(busy), np.flatnonzero(~busy))


def _places_taken(G: sp.csr_array, K: sp.csr_array) -> Places:
    """Places in w of what reaches a next state, at once or through other values."""
    reached = np.asarray(abs(G).sum(axis=0)).ravel() > 0
    while True:
        more = reached | (np.asarray(abs(K[reached]).sum(axis=0)).ravel() > 0)
        if (more == reached).all():
            return np.flatnonzero(reached)
        reached = more

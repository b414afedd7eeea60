"""Equations that fall apart into many small blocks, factorised for a point σ: all blocks of one size at once.

Devices of one kind have blocks of one size. As a stack of dense matrices their inverses are one call, and so is a
solution for many right sides; a sparse factorisation goes through them row by row."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix, Vector

LARGEST = 64
"""Unknowns of a block up to which its dense inverse is taken; a larger one is mostly zeros."""

Places = NDArray[np.int64]


class BlockFactors(Protocol):
    """Factors of P − σ."""

    def solve(self, right: Vector, transposed: str = "N") -> Vector:
        """(P − σ)⁻¹·right for "N", (P − σ)⁻ᴴ·right for "H"; right of shape (r, c)."""

    @property
    def log_determinant(self) -> complex:
        """Log det(P − σ); its imaginary part lacks whole turns."""


@dataclass(frozen=True)
class InverseBlocks:
    """Inverses of the blocks, stacked by size; shapes (count, size, size), in the order of the unknowns."""

    stacks: tuple[Matrix, ...]

    def solve(self, right: Vector, transposed: str = "N") -> Vector:
        found = np.empty(right.shape, dtype=np.result_type(right, *self.stacks))
        for own, inverses in _runs(self.stacks):
            given = right[own].reshape(*inverses.shape[:2], -1)
            taken = inverses.conj().transpose(0, 2, 1) if transposed == "H" else inverses
            found[own] = (taken @ given).reshape(right[own].shape)
        return found

    @property
    def log_determinant(self) -> complex:
        """See `BlockFactors.log_determinant`."""
        return -sum((_log_determinant(inverses) for inverses in self.stacks), 0j)


@dataclass(frozen=True)
class SparseFactors:
    """A sparse factorisation of equations, in SciPy's words."""

    lu: spla.SuperLU

    def solve(self, right: Vector, transposed: str = "N") -> Vector:
        found: Vector = self.lu.solve(right, transposed)
        return found

    @property
    def log_determinant(self) -> complex:
        """See `BlockFactors.log_determinant`."""
        diagonal = self.lu.U.diagonal()
        flips = _odd(self.lu.perm_r) ^ _odd(self.lu.perm_c)
        return complex(np.log(diagonal.astype(complex)).sum() + 1j * np.pi * flips)


def _log_determinant(matrices: Matrix) -> complex:
    """Sum of log det of a stack of matrices."""
    signs, logarithms = np.linalg.slogdet(matrices)
    return complex(logarithms.sum() + 1j * np.angle(signs).sum())


def _odd(permutation: NDArray[np.int32]) -> bool:
    """Return whether a permutation is odd: an even number of its cycles lacks to its length."""
    n = len(permutation)
    cycles = sp.coo_array((np.ones(n), (np.arange(n), permutation)), shape=(n, n))
    count, _ = sp.csgraph.connected_components(cycles, directed=False)
    return bool((n - count) % 2)


@dataclass(frozen=True)
class SeparateBlocks:
    """P without σ. Blocks of one size follow each other, and the unknowns of each block (`by_size`).

    ``stacks``: the blocks, stacked by size; empty where one is larger than `LARGEST`."""

    whole: sp.csc_array
    at_rest: NDArray[np.float64]  # 1 where σ stands in an equation, shape (r,)
    stacks: tuple[Matrix, ...]

    def at(self, sigma: complex) -> BlockFactors | None:
        """Factorise P − σ; None where a block is singular to the last digit."""
        try:
            if not self.stacks:
                shifted = (self.whole - sigma * sp.diags_array(self.at_rest)).tocsc()
                # without scaling the determinant is that of the factors
                return SparseFactors(spla.splu(shifted, options={"Equil": False}))
            return InverseBlocks(tuple(self._inverses(sigma)))
        except (RuntimeError, np.linalg.LinAlgError):
            return None

    def _inverses(self, sigma: complex) -> Iterator[Matrix]:
        for own, blocks in _runs(self.stacks):
            count, size, _ = blocks.shape
            shifted = blocks.astype(np.result_type(blocks, sigma))
            among = np.arange(size)
            shifted[:, among, among] -= sigma * self.at_rest[own].reshape(count, size)
            yield np.linalg.inv(shifted)


def separate_blocks(P: sp.csc_array, at_rest: NDArray[np.float64]) -> SeparateBlocks:
    """Prepare equations whose unknowns stand `by_size`.

    ``at_rest``: 1 where σ stands in an equation, 0 elsewhere, shape (r,)."""
    block = _block_of(P)
    sizes = np.bincount(block)[block]
    if sizes.max(initial=0) > LARGEST:
        return SeparateBlocks(P, at_rest, ())
    entries = P.tocoo()
    rows, columns = entries.coords
    stacks = []
    for size in np.unique(sizes).tolist():
        begin, end = np.searchsorted(sizes, [size, size + 1])
        stack = np.zeros(((end - begin) // size, size, size))
        inside = (rows >= begin) & (rows < end)
        row, column = rows[inside] - begin, columns[inside] - begin
        stack[row // size, row % size, column % size] = entries.data[inside]
        stacks.append(stack)
    return SeparateBlocks(P, at_rest, tuple(stacks))


def by_size(P: sp.csr_array) -> Places:
    """Return an order of the unknowns in which small blocks come first, and each block stands together."""
    block = _block_of(P)
    return np.lexsort((block, np.bincount(block)[block])).astype(np.int64)


def _block_of(P: sp.csr_array | sp.csc_array) -> Places:
    _, block = sp.csgraph.connected_components(P, directed=False)
    return np.asarray(block, dtype=np.int64)


def _runs(stacks: tuple[Matrix, ...]) -> Iterator[tuple[slice, Matrix]]:
    """Yield each stack with the places of its unknowns."""
    begin = 0
    for stack in stacks:
        end = begin + stack.shape[0] * stack.shape[1]
        yield slice(begin, end), stack
        begin = end

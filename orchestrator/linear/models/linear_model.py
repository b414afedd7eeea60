"""A linear model of a coupled system, kept as sparse equations of its parts.

z⁺ = F·z + G·w and w = H·z + K·w (ż for z⁺ where the model is continuous): z holds the states, w the outputs on
their way between components. The matrix A = F + G·(I − K)⁻¹·H that this comes down to is dense in large parts;
the equations are not, which is what a search for a few eigenvalues of a large system lives on."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix, Vector
from orchestrator.linear.models.hub_elimination import HubEquations, HubFactors, hub_equations

HELD = " (held)"
DELAYED = " (delayed"  # in the name of a state that stands for what is on its way over a connection
# with fewer states, one vector at a time, which keeps the last digits of modes
LEAST_IN_BLOCKS = 4_000

PERTURBED = "perturbed"
DIRECTIONAL = "directional"
PACKED = "packed"
IDENTIFIED = "identified"
"""Origins of a component's linear model: perturbation of its running FMU, directional derivatives of the FMU, a model
in the FMU's file, or a model fitted to measurements at its inputs and outputs."""


# a state stands still over a step where its own element of the map differs from 1 by less: rounding of a perturbation
_STANDS = 1e-10


@dataclass(frozen=True)
class ShiftedSolver:
    """Solves (A − σI)·x = b with ``solve`` and (A − σI)ᴴ·x = b with ``solve_adjoint``; b is (n,) or (n, c)."""

    solve: Callable[[Vector], Vector]
    solve_adjoint: Callable[[Vector], Vector]
    # the same to the last digits, where the first two are close only
    solve_exactly: Callable[[Vector], Vector]
    solve_adjoint_exactly: Callable[[Vector], Vector]
    # whether both take many vectors as columns, and take hardly longer for them than for one
    takes_many: bool = False


@dataclass(frozen=True)
class LinearModel:
    """z⁺ = A·z around an operating point."""

    # F, G, H, K: sparse matrices, shapes (n, n), (n, m), (m, n), (m, m); I − K is regular
    F: sp.csr_array
    G: sp.csr_array
    H: sp.csr_array
    K: sp.csr_array
    # ``component.state`` for states, ``component.output (held)`` for what the exchange remembers and ``a.out -> b.in
    # (delayed k)`` for what is on its way over a connection; length n
    names: tuple[str, ...]
    # communication step [s]; None for a continuous model, whose A is in 1/s
    step_size: float | None
    # largest difference between the two perturbation sizes, in elements of the components' matrices
    disagreement: float
    sources: Mapping[str, str] = field(default_factory=dict)
    # communication steps over which the map's power is that of the system; more than 1 with sampled controllers
    period: int = 1
    # what each element of w is: ``component.output``, several times where it is computed several times; empty where the
    # model was not composed from components
    wires: tuple[str, ...] = ()

    @classmethod
    def from_matrix(
        cls, A: Matrix, names: tuple[str, ...], step_size: float | None, disagreement: float = 0.0
    ) -> Self:
        """The model of one matrix, without outputs that travel between components."""
        n = len(A)
        G, H, K = (sp.csr_array(shape) for shape in ((n, 0), (0, n), (0, 0)))
        return cls(
            F=sp.csr_array(A),
            G=G,
            H=H,
            K=K,
            names=names,
            step_size=step_size,
            disagreement=disagreement,
        )

    @cached_property
    def A(self) -> Matrix:
        """The whole matrix, dense, shape (n, n)."""
        A: Matrix = self.F.toarray() + self.G @ self.settle(self.H.toarray())
        return A

    def apply(self, z: Vector) -> Vector:
        """A·z, computed without forming A; z may be complex, of shape (n,) or (n, k)."""
        w = self.H @ z
        settled = (
            self.settle(w.real) + 1j * self.settle(w.imag) if np.iscomplexobj(w) else self.settle(w)
        )
        result: Vector = self.F @ z + self.G @ settled
        return result

    @cached_property
    def unmoved(self) -> tuple[str, ...]:
        """Names of the states that nothing moves, whatever they move themselves: clocks, and the integrators of
        controllers that are off or rest within a dead band. Each is a zero of its own, and none drifts."""
        return tuple(self.names[k] for k in np.flatnonzero(self._is_unmoved))

    @cached_property
    def _is_unmoved(self) -> NDArray[np.bool_]:
        own = self._diagonal
        still: NDArray[np.bool_] = np.abs(own - 1.0) <= _STANDS
        stands = own == 0.0 if self.step_size is None else still
        rows, states = _rows_of(self.F), self.F.indices
        stands[rows[(self.F.data != 0) & (states != rows)]] = False
        stands[_rows_of(self.G)[self.G.data != 0]] = False
        return stands

    @property
    def coupled(self) -> Self:
        """The model without its `unmoved` states: the others' eigenvalues are the same."""
        kept = np.flatnonzero(~self._is_unmoved)
        if len(kept) == len(self.names):
            return self
        F = self.F[kept][:, kept]
        return replace(
            self, F=F, G=self.G[kept], H=self.H[:, kept], names=tuple(self.names[k] for k in kept)
        )

    @cached_property
    def settle(self) -> Callable[..., Any]:
        """W = (I − K)⁻¹·b; with "T" behind b, by the transpose."""
        m = self.K.shape[0]
        if not m:
            return lambda b, _="N": b
        factors = spla.splu(sp.csc_array(sp.eye_array(m, format="csr") - self.K))
        solve: Callable[..., Any] = factors.solve
        return solve

    def __getstate__(self) -> dict[str, Any]:
        """All but what is made anew where it is needed: a factorisation cannot be pickled or copied."""
        anew = ("settle", "hub", "_diagonal", "_with_gaps")
        return {name: value for name, value in vars(self).items() if name not in anew}

    @cached_property
    def hub(self) -> HubEquations | None:
        """The equations with their hub set apart; None where there is none worth it."""
        return hub_equations(self.F, self.G, self.H, self.K)

    @property
    def is_searched_in_blocks(self) -> bool:
        """Tell if a search takes many vectors at once: in large models with a hub, whose dense rest is read once for
        all of them."""
        return len(self.names) >= LEAST_IN_BLOCKS and self.hub is not None

    @property
    def number_of_states(self) -> int:
        """States of the components, without what the exchange remembers."""
        return sum(not (name.endswith(HELD) or DELAYED in name) for name in self.names)

    def shifted(self, sigma: complex) -> ShiftedSolver:
        """Factorise A − σI once, through the sparse equations; σ must not be an eigenvalue."""
        factors_of_hub = self._hub_at(sigma)
        if factors_of_hub:
            return ShiftedSolver(
                factors_of_hub.solve,
                factors_of_hub.solve_adjoint,
                solve_exactly=factors_of_hub.solve_exactly,
                solve_adjoint_exactly=factors_of_hub.solve_adjoint_exactly,
                takes_many=self.is_searched_in_blocks,
            )
        n, m = self.G.shape
        whole = self._equations_at(sigma)
        factors = spla.splu(whole)
        kind = whole.dtype

        def solve(b: Vector, transposed: str = "N") -> Any:
            right = np.zeros((n + m, *b.shape[1:]), dtype=kind)
            right[:n] = b
            return factors.solve(right, transposed)[:n]

        def solve_adjoint(b: Vector) -> Any:
            return solve(b, "H")

        return ShiftedSolver(
            solve, solve_adjoint, solve_exactly=solve, solve_adjoint_exactly=solve_adjoint
        )

    def _equations_at(self, sigma: complex) -> sp.csc_array:
        """A − σI in sparse equations; of those for another σ only the diagonal is another."""
        own = self._diagonal - sigma
        equations, places = self._with_gaps
        if len(places) != len(own) or not own.all():  # an entry that is zero is left out
            return self._assembled(sigma)
        values = equations.data.astype(own.dtype)
        values[places] = own
        return sp.csc_array((values, equations.indices, equations.indptr), shape=equations.shape)

    @cached_property
    def _diagonal(self) -> Vector:
        return np.asarray(self.F.diagonal())

    @cached_property
    def _with_gaps(self) -> tuple[sp.csc_array, NDArray[np.intp]]:
        """The equations with gaps for the diagonal of A − σI, and the gaps' places among their values."""
        equations = self._assembled(np.nan)
        equations.sum_duplicates()  # which sorts them, as a factorisation would in place
        return equations, np.flatnonzero(np.isnan(equations.data))

    def _assembled(self, sigma: complex) -> sp.csc_array:
        n, m = self.G.shape
        identity_n, identity_m = sp.eye_array(n), sp.eye_array(m)
        return sp.csc_array(
            sp.block_array(
                [[self.F - sigma * identity_n, self.G], [self.H, self.K - identity_m]], format="csc"
            )
        )

    def _hub_at(self, sigma: complex) -> HubFactors | None:
        if self.hub is None:
            return None
        return self.hub.near_at(sigma) if self.is_searched_in_blocks else self.hub.at(sigma)


def _rows_of(matrix: sp.csr_array) -> NDArray[np.intp]:
    """The row in which each of a matrix's entries stands."""
    return np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))


_ROWS = 64  # of a block that become sparse together: they stay in the processor's cache
_FEW = 100_000  # numbers in blocks whose places are listed: of more, the list costs memory

Indices = NDArray[np.int64]
Places = NDArray[np.int32]

_Part = tuple[Indices, Places, Matrix]  # of a sparse matrix: rows, columns and the block there


class Equations:
    """Collects the blocks of z⁺ = F·z + G·w, w = H·z + K·w."""

    def __init__(self, n: int, m: int) -> None:
        self._shapes = {"F": (n, n), "G": (n, m), "H": (m, n), "K": (m, m)}
        self._states = np.arange(n)
        self._parts: dict[str, list[_Part]] = {name: [] for name in self._shapes}

    def next_state(self, rows: slice, states: slice, A: Matrix, w: Indices, B: Matrix) -> None:
        """Add z⁺[rows] = A·z[states] + B·w[w]."""
        self._add("F", self._states[rows], self._states[states], A)
        self._add("G", self._states[rows], w, B)

    def output(self, rows: Indices, states: slice, C: Matrix, w: Indices, D: Matrix) -> None:
        """Add w[rows] = C·z[states] + D·w[w]."""
        self._add("H", rows, self._states[states], C)
        self._add("K", rows, w, D)

    def _add(self, name: str, rows: Indices, columns: Indices, block: Matrix) -> None:
        if block.size:
            self._parts[name].append((rows.copy(), columns.astype(np.int32), block))

    def model(
        self,
        names: Iterable[str],
        step_size: float | None,
        disagreement: float,
        sources: Mapping[str, str],
        *,
        wires: Iterable[str] = (),
    ) -> LinearModel:
        F, G, H, K = (self._matrix(name) for name in self._shapes)
        return LinearModel(
            F,
            G,
            H=H,
            K=K,
            names=tuple(names),
            step_size=step_size,
            disagreement=disagreement,
            sources=sources,
            wires=tuple(wires),
        )

    def _matrix(self, name: str) -> sp.csr_array:
        shape, parts = self._shapes[name], self._parts[name]
        fill = _from_list if sum(block.size for *_, block in parts) <= _FEW else _row_by_row
        starts, columns, values = fill(shape[0], parts)
        if starts[-1] <= np.iinfo(np.int32).max:
            starts = starts.astype(np.int32)
        found = sp.csr_array((values, columns, starts), shape=shape)
        found.sum_duplicates()
        return found


def _from_list(rows: int, parts: Sequence[_Part]) -> tuple[Indices, Places, Vector]:
    """Where each row of a sparse matrix starts, and its columns and values, from a list of all blocks' entries."""
    if not parts:
        return np.zeros(rows + 1, dtype=np.int64), np.empty(0, dtype=np.int32), np.empty(0)
    found_rows: list[Indices] = []
    found_columns: list[Places] = []
    found_values: list[Vector] = []
    for own, names, block in parts:
        r, c = block.nonzero()
        found_rows.append(own[r])
        found_columns.append(names[c])
        found_values.append(block[r, c])
    row = np.concatenate(found_rows)
    order = row.argsort(kind="stable")
    columns, values = np.concatenate(found_columns)[order], np.concatenate(found_values)[order]
    starts = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=rows))])
    return starts, columns, values


def _row_by_row(rows: int, parts: Sequence[_Part]) -> tuple[Indices, Places, Vector]:
    """The same to the last bit for large blocks, of whose entries no list is made."""
    counts = np.zeros(rows, dtype=np.int64)
    for own, _, block in parts:
        counts[own] += np.count_nonzero(block, axis=1)
    starts = np.concatenate([[0], np.cumsum(counts)])
    columns, values = np.empty(starts[-1], dtype=np.int32), np.empty(starts[-1])
    free = starts[:-1].copy()  # where the next number of each row goes
    for every, names, block in parts:
        for first in range(0, len(every), _ROWS):
            own, some = every[first : first + _ROWS], block[first : first + _ROWS]
            row, column = np.nonzero(some)
            before = np.searchsorted(row, np.arange(len(own)))
            places = (free[own] - before)[row] + np.arange(len(row))
            columns[places], values[places] = names[column], some[row, column]
            free[own] += np.diff(before, append=len(row))
    return starts, columns, values

"""Log det(A − sI) of a continuous model at hundreds of points at once.

Of a component with few states only its ports matter to the others. Its poles and residues give what an output answers
to an input at every point, and no state is left of it. What remains are the network's states and the wires, whose
equations have few unknowns each. Their order of elimination is chosen once, by the fewest neighbours, and each step of
it is taken for all points together. Pivots are those of that order: how much a step magnifies rounding is watched, and
points at which it is too much, and some others, are computed by a sparse factorisation as well."""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from orchestrator.core.arrays import Matrix, Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.shifted_equations import (
    GROWING,
    ShiftedEquations,
    in_parts,
    sum_of_logarithms,
)

Places = NDArray[np.int64]
Points = NDArray[np.complex128]

# a component with more states than this is a network, whose equations are eliminated one by one
_FEW_STATES = 80
# equations left over are one dense matrix for each point
_DENSE = 40
# most products of an elimination: beyond, all eigenvalues take no longer
_MOST_PRODUCTS = 200_000
_AT_A_TIME = 128  # points whose equations fit into the processor's cache together
# a step of the elimination that magnifies rounding by more is not trusted
_MOST_MAGNIFIED = 1e10
# most points that are computed by a sparse factorisation instead
_MOST_EXACT = 30
# largest difference of the logarithm from that of a sparse factorisation: a tenth of what a turn could hide in
_CLOSE = 0.07
# heights [rad/s] at which both are compared, from slow swings to what a network's lines do
_COMPARED = (0.3, 7.0, 90.0, 2e3, 4e4)


@dataclass(frozen=True)
class _Answer:
    """Answers of some wires to others through one component, by its poles p [rad/s]: Σ residues/(s − p).

    ``rows`` and ``columns``: places in w; ``residues``: shape (poles, rows·columns)."""

    rows: Places
    columns: Places
    poles: Vector
    residues: Vector


@dataclass(frozen=True)
class _Step:
    """Elimination of one unknown: places of its pivot, of its column, its row and of what both change."""

    pivot: int
    column: Places
    row: Places
    changed: Places


class ReducedNetwork:
    """The equations of a continuous model, put in order once.

    ``alone``: all eigenvalues of the components, each alone with its inputs held [rad/s].

    Raises `AnalysisError` if its equations are coupled too densely to be worth it, or if rounding spoils them."""

    def __init__(self, model: LinearModel) -> None:
        self._exact = ShiftedEquations(model)
        _, of = connected_components(model.F, directed=False)
        sizes = np.bincount(of)
        small = sizes[of] <= _FEW_STATES
        self._answers, self._own = [], np.zeros(0, dtype=complex)
        for component in np.flatnonzero(sizes <= _FEW_STATES):
            poles, answer = _answer_of(model, np.flatnonzero(of == component))
            self._own = np.concatenate([self._own, poles])
            if answer is not None:
                self._answers.append(answer)
        kept = np.flatnonzero(~small)
        inside = model.F[kept][:, kept]
        self.alone = np.concatenate([self._own, _eigenvalues_by_block(inside)])
        self._states = len(kept)
        wires = model.K - sp.eye_array(model.K.shape[0])
        self._equations = sp.coo_array(
            sp.block_array([[inside, model.G[kept]], [model.H[:, kept], wires]])
        )
        self._arrange()
        self._compare()

    def log_determinants(self, points: Points) -> Points:
        """Log det(A − sI) at points s, but for a constant of the model; imaginary parts lack whole turns."""
        found, magnified = self._at(points)
        poor = np.flatnonzero(~np.isfinite(found) | (magnified > _MOST_MAGNIFIED))
        if len(poor) > _MOST_EXACT:
            raise AnalysisError(f"rounding grows at {len(poor)} of {len(points)} points")
        for k in poor:
            found[k] = self._exact.at(points[k]).log_determinant + self._apart
        return found

    def _compare(self) -> None:
        """Hold some points against a sparse factorisation: the poles of a component may be defective."""
        points = GROWING + 1j * np.array(_COMPARED)
        mine, _ = self._at(points)
        other = self._exact.log_determinants(points)
        self._apart = mine[0] - other[0]
        difference = mine - other - self._apart
        turned = (difference.imag + np.pi) % (2 * np.pi) - np.pi
        off = float(np.abs(difference.real + 1j * turned).max())
        if not off <= _CLOSE:
            raise AnalysisError(f"its logarithm is off by {off:.2g}")

    def _at(self, points: Points) -> tuple[Points, Vector]:
        """The logarithm at each point, and the largest factor of its elimination."""
        cuts = range(_AT_A_TIME, len(points), _AT_A_TIME)
        parts = [self._at_some(some) for some in np.split(points, cuts)]
        return np.concatenate([p for p, _ in parts]), np.concatenate([m for _, m in parts])

    def _at_some(self, s: Points) -> tuple[Points, Vector]:
        values = np.repeat(self._start[:, None], len(s), axis=1)
        values[self._diagonal] -= s
        found = sum_of_logarithms(s, self._own)
        for places, answer in zip(self._entered, self._answers, strict=True):
            values[places] += answer.residues.T @ (1 / (s - answer.poles[:, None]))
        magnified = np.zeros(len(s))
        with np.errstate(all="ignore"):  # what is not finite is seen by its size
            for step in self._steps:
                pivot = values[step.pivot]
                factors = values[step.column] / pivot
                np.maximum(magnified, np.abs(factors).max(axis=0, initial=0.0), out=magnified)
                products = factors[:, None] * values[step.row]
                values[step.changed] -= products.reshape(-1, len(s))
            for some in in_parts(self._pivots):
                found += np.log(values[some].prod(axis=0))
            sign, size = np.linalg.slogdet(np.moveaxis(values[self._left_over], 2, 0))
        return found + size + 1j * np.angle(sign), magnified

    def _arrange(self) -> None:
        """Choose the order, and give each element of the equations, and those that arise, its place."""
        first = self._states
        size = self._equations.shape[0]
        place: dict[tuple[int, int], int] = {(i, i): i for i in range(size)}

        def places(rows: list[int], columns: list[int]) -> Places:
            found = [place.setdefault((i, j), len(place)) for i in rows for j in columns]
            return np.array(found, dtype=np.int64)

        rows, columns = (x.tolist() for x in self._equations.coords)
        given = [place.setdefault(pair, len(place)) for pair in zip(rows, columns, strict=True)]
        self._entered = [
            places((first + a.rows).tolist(), (first + a.columns).tolist()) for a in self._answers
        ]
        neighbours: list[set[int]] = [set() for _ in range(size)]
        for i, j in place:
            if i != j:
                neighbours[i].add(j)
                neighbours[j].add(i)

        products, self._steps = 0, []
        for unknown, beside in _by_fewest_neighbours(neighbours, size - _DENSE):
            products += len(beside) ** 2
            if products > _MOST_PRODUCTS:
                raise AnalysisError("its equations are densely coupled")
            column, row = places(beside, [unknown]), places([unknown], beside)
            self._steps.append(_Step(unknown, column, row, places(beside, beside)))
        self._pivots = np.array([step.pivot for step in self._steps], dtype=np.int64)
        left = sorted(set(range(size)) - set(self._pivots.tolist()))
        self._left_over = places(left, left).reshape(len(left), len(left))
        self._diagonal = np.arange(first)
        self._start = np.zeros(len(place), dtype=complex)
        np.add.at(self._start, given, self._equations.data)


def _answer_of(model: LinearModel, states: Places) -> tuple[Vector, _Answer | None]:
    """The poles of a component, and what its outputs answer to its inputs; None where it is connected to nothing."""
    poles, vectors = np.linalg.eig(model.F[states][:, states].toarray())
    into, out = model.G[states], model.H[:, states]
    columns, rows = np.unique(into.indices), np.flatnonzero(np.diff(out.indptr))
    if not len(columns) or not len(rows):
        return poles, None
    given = (out[rows].toarray() @ vectors).T
    try:
        taken = np.linalg.solve(vectors, into[:, columns].toarray())
    except np.linalg.LinAlgError as error:
        raise AnalysisError("poles of a component are defective") from error
    residues = given[:, :, None] * taken[:, None, :]
    return poles, _Answer(rows, columns, poles, residues.reshape(len(poles), -1))


def _eigenvalues_by_block(matrix: sp.csr_array) -> Vector:
    """All eigenvalues of a matrix, of each of its separate blocks alone."""
    if not matrix.shape[0]:
        return np.zeros(0, dtype=complex)
    count, of = connected_components(matrix, directed=False)
    each = [np.flatnonzero(of == k) for k in range(count)]
    blocks: list[Matrix] = [matrix[some][:, some].toarray() for some in each]
    return np.concatenate([np.linalg.eigvals(block).astype(complex) for block in blocks])


def _by_fewest_neighbours(
    neighbours: list[set[int]], count: int
) -> Iterator[tuple[int, list[int]]]:
    """Yield unknowns in the order of elimination, each with those that it is coupled with by then."""
    heap = [(len(beside), k) for k, beside in enumerate(neighbours)]
    heapq.heapify(heap)
    gone: set[int] = set()
    while len(gone) < count:
        size, k = heapq.heappop(heap)
        if k in gone or size != len(neighbours[k]):
            continue  # it has come again with the neighbours of today
        gone.add(k)
        beside = sorted(neighbours[k])
        for j in beside:
            neighbours[j] |= neighbours[k]
            neighbours[j] -= {j, k}
            heapq.heappush(heap, (len(neighbours[j]), j))
        yield k, beside

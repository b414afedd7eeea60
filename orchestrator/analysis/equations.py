"""Equations of a coupled system, collected block by block into sparse matrices."""

from collections.abc import Iterable, Mapping

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from orchestrator.analysis.linear_model import LinearModel
from orchestrator.arrays import Matrix

Indices = NDArray[np.int64]


class Equations:
    """Collects the blocks of z⁺ = F·z + G·w, w = H·z + K·w."""

    def __init__(self, n: int, m: int) -> None:
        self._shapes = {"F": (n, n), "G": (n, m), "H": (m, n), "K": (m, m)}
        self._parts: dict[str, list[tuple[Indices, Indices, Matrix]]] = {name: [] for name in self._shapes}

    def next_state(self, rows: slice, states: slice, A: Matrix, w: Indices, B: Matrix) -> None:
        """Add z⁺[rows] = A·z[states] + B·w[w]."""
        n = self._shapes["F"][0]
        self._add("F", np.arange(n)[rows], np.arange(n)[states], A)
        self._add("G", np.arange(n)[rows], w, B)

    def output(self, rows: Indices, states: slice, C: Matrix, w: Indices, D: Matrix) -> None:
        """Add w[rows] = C·z[states] + D·w[w]."""
        self._add("H", rows, np.arange(self._shapes["F"][0])[states], C)
        self._add("K", rows, w, D)

    def _add(self, name: str, rows: Indices, columns: Indices, block: Matrix) -> None:
        i, k = np.nonzero(block)
        self._parts[name].append((rows[i], columns[k], block[i, k]))

    def model(
        self, names: Iterable[str], step_size: float | None, disagreement: float, sources: Mapping[str, str]
    ) -> LinearModel:
        F, G, H, K = (self._matrix(name) for name in self._shapes)
        return LinearModel(F, G, H, K, tuple(names), step_size, disagreement, sources)

    def _matrix(self, name: str) -> sp.csr_array:
        rows, columns, values = (np.concatenate(part) for part in zip(*self._parts[name], strict=True))
        return sp.coo_array((values, (rows, columns)), shape=self._shapes[name]).tocsr()

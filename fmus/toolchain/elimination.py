"""Sparse elimination planned ahead: order and fill of an LU factorisation whose pattern never changes."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from fmus.toolchain.model import Model


@dataclass(frozen=True)
class Elimination:
    """Pattern of 1 − γh·A and of its factors, rows in order of elimination.

    Attributes
    ----------
    order
        ``order[i]`` is the state that is eliminated at position i.
    row, column, diagonal
        Factors, compressed by rows: columns ascending, ``diagonal`` the position of each pivot.
    matrix_row, matrix_column
        The matrix itself, in the same order.
    values
        CasADi function (p, c, γh) → values of the matrix.
    """

    order: list[int]
    row: list[int]
    column: list[int]
    diagonal: list[int]
    matrix_row: list[int]
    matrix_column: list[int]
    values: ca.Function


def plan_elimination(model: Model) -> Elimination:
    """Plan the factorisation of a model whose implicit part is linear in its states.

    Raises
    ------
    ValueError
        If the Jacobian of that part depends on states or inputs.
    """
    n = len(model.states)
    x, u = ca.SX.sym("x", n), ca.SX.sym("u", len(model.inputs))
    p, c = ca.SX.sym("p", len(model.parameters)), ca.SX.sym("c", len(model.calculated))
    A = ca.jacobian((model.implicit or model.derivatives)(x, u, p, c), x)
    if ca.depends_on(A, ca.vertcat(x, u)):
        raise ValueError(f"model {model.name} is not linear in its states; the implicit integrator needs that")
    gh = ca.SX.sym("gh")
    matrix = ca.SX.eye(n) - gh * A
    rows, columns = (np.array(part) for part in matrix.sparsity().get_triplet())
    order = _order(n, rows, columns)
    position = np.empty(n, dtype=int)
    position[order] = np.arange(n)
    pattern: list[list[int]] = [[] for _ in range(n)]
    for i, j in zip(position[rows].tolist(), position[columns].tolist(), strict=True):
        pattern[i].append(j)
    pattern = [sorted(entries) for entries in pattern]
    filled = _fill(pattern)
    values = ca.vertcat(*[matrix[order[i], order[j]] for i, entries in enumerate(pattern) for j in entries])
    row, column = _compressed(filled)
    matrix_row, matrix_column = _compressed(pattern)
    diagonal = [row[i] + entries.index(i) for i, entries in enumerate(filled)]
    function = ca.Function("iteration", [p, c, gh], [ca.densify(values)])
    return Elimination(order, row, column, diagonal, matrix_row, matrix_column, function)


def _order(n: int, rows: np.ndarray, columns: np.ndarray) -> list[int]:
    """Minimum-degree order, from SuperLU on a dominant matrix of that pattern."""
    values = np.where(rows == columns, 10.0 * n, 1.0)
    factors = splu(csc_matrix((values, (rows, columns)), shape=(n, n)), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0)
    return [int(k) for k in np.argsort(factors.perm_c)]


def _fill(pattern: list[list[int]]) -> list[list[int]]:
    """Columns of each row of L + U, by eliminating symbolically."""
    upper: list[list[int]] = []
    filled = []
    for i, entries in enumerate(pattern):
        columns, pending = set(entries), sorted(k for k in entries if k < i)
        while pending:
            k = pending.pop(0)
            new = [j for j in upper[k] if j not in columns]
            columns.update(new)
            pending = sorted({*pending, *(j for j in new if j < i)})
        filled.append(sorted(columns))
        upper.append([j for j in filled[i] if j > i])
    return filled


def _compressed(pattern: list[list[int]]) -> tuple[list[int], list[int]]:
    row = [0]
    for entries in pattern:
        row.append(row[-1] + len(entries))
    return row, [j for entries in pattern for j in entries]

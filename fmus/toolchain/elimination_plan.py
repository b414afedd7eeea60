"""Sparse elimination planned ahead: order and fill of an LU factorisation whose pattern never changes, such as of the
implicit step's matrix 1 − γh·A of a model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from fmus.toolchain.model import Model
from fmus.toolchain.plan import Plan
from fmus.toolchain.symbols import Expr, Function, depends_on, jacobian, symbol, symbols


def plan_pattern(n: int, rows: Sequence[int], columns: Sequence[int]) -> Plan:
    """Plan the factorisation of an n×n matrix without pivoting, from the places of its elements."""
    order = _order(n, np.array(rows), np.array(columns))
    position = np.empty(n, dtype=int)
    position[order] = np.arange(n)
    pattern: list[list[int]] = [[] for _ in range(n)]
    for i, j in zip(position[list(rows)].tolist(), position[list(columns)].tolist(), strict=True):
        pattern[i].append(j)
    pattern = [sorted(entries) for entries in pattern]
    filled = _fill(pattern)
    row, column = _compressed(filled)
    matrix_row, matrix_column = _compressed(pattern)
    diagonal = [row[i] + entries.index(i) for i, entries in enumerate(filled)]
    return Plan(order, row, column, diagonal, matrix_row, matrix_column)


def _order(n: int, rows: np.ndarray, columns: np.ndarray) -> list[int]:
    """Minimum-degree order, from SuperLU on a dominant matrix of that pattern."""
    values = np.where(rows == columns, 10.0 * n, 1.0)
    factors = splu(
        csc_matrix((values, (rows, columns)), shape=(n, n)),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0,
    )
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


@dataclass(frozen=True)
class Elimination:
    """The plan for 1 − γh·A, and a function (p, c, γh) → values of that matrix."""

    plan: Plan
    values: Function


def plan_elimination(model: Model) -> Elimination:
    """Plan the factorisation of a model whose implicit part is linear in its states."""
    n = len(model.states)
    x, u = symbols("x", n), symbols("u", len(model.inputs))
    p, c = symbols("p", len(model.parameters)), symbols("c", len(model.calculated))
    (rates,) = (model.implicit or model.derivatives).of(x, u, p, c)
    A = jacobian(rates, x)
    if depends_on(list(A.values()), [*x, *u]):
        raise ValueError(
            f"model {model.name} is not linear in its states; the implicit integrator needs that"
        )
    gh = symbol("gh")
    matrix = {(i, i): Expr(1) for i in range(n)}
    for place, element in A.items():
        matrix[place] = matrix.get(place, Expr(0)) - gh * element
    plan = plan_pattern(n, *zip(*matrix, strict=True))
    return Elimination(
        plan, Function("iteration", [p, c, [gh]], [[matrix[place] for place in plan.entries]])
    )

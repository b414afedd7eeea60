"""The variables that each unknown of a model depends on, from the sparsity of its equations.

Variables are named by their FMI value reference.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.sparse import csr_array

from fmus.toolchain.model import Model


@dataclass(frozen=True, slots=True)
class Unknown:
    """A computed variable, and the variables that it is computed from."""

    reference: int
    known: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Structure:
    """Unknowns of a running instance, and of its initialisation."""

    outputs: tuple[Unknown, ...]
    derivatives: tuple[Unknown, ...]
    initial: tuple[Unknown, ...]


def structure(model: Model) -> Structure:
    """Dependence of outputs and derivatives on inputs and states, and of initial unknowns on parameters and inputs."""
    np_, nc, nu = len(model.parameters), len(model.calculated), len(model.inputs)
    nx, ny = len(model.states), len(model.outputs)
    parameters, inputs = np.arange(np_), np_ + nc + np.arange(nu)
    states = np_ + nc + nu + np.arange(nx)
    first_output, first_derivative = np_ + nc + nu + nx, np_ + nc + nu + nx + ny

    f, g = model.derivatives, model.outputs_function
    f_x, f_u, f_p, f_c = (_pattern(f, 0, k) for k in range(4))
    g_x, g_u, g_p, g_c = (_pattern(g, 0, k) for k in range(4))
    c_p, x_p = _pattern(model.initialise, 0, 0), _pattern(model.initialise, 1, 0)
    g_start = g_p + g_x @ x_p + g_c @ c_p
    f_start = f_p + f_x @ x_p + f_c @ c_p
    return Structure(
        outputs=_unknowns(first_output, [(g_u, inputs), (g_x, states)]),
        derivatives=_unknowns(first_derivative, [(f_u, inputs), (f_x, states)]),
        initial=(
            *_unknowns(np_, [(c_p, parameters)]),
            *_unknowns(np_ + nc + nu, [(x_p, parameters)]),
            *_unknowns(first_output, [(g_start, parameters), (g_u, inputs)]),
            *_unknowns(first_derivative, [(f_start, parameters), (f_u, inputs)]),
        ),
    )


def _unknowns(first: int, blocks: list[tuple[csr_array, np.ndarray]]) -> tuple[Unknown, ...]:
    """One unknown for each row of the patterns, which stand side by side."""
    for matrix, _ in blocks:
        matrix.sort_indices()
    return tuple(
        Unknown(first + row, tuple(int(i) for matrix, references in blocks for i in references[_columns(matrix, row)]))
        for row in range(blocks[0][0].shape[0])
    )


def _columns(matrix: csr_array, row: int) -> np.ndarray:
    columns: np.ndarray = matrix.indices[matrix.indptr[row] : matrix.indptr[row + 1]]
    return columns


def _pattern(function: ca.Function, output: int, input_: int) -> csr_array:
    """Matrix of truth values: whether each element of an output depends on each element of an input."""
    pattern = function.jac_sparsity(output, input_)
    rows, columns = pattern.get_triplet()
    return csr_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=pattern.shape)

"""The variables that each unknown of a model depends on, from the sparsity of its equations.

Variables are named by their FMI value reference."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.sparse import csr_array

from fmus.toolchain.model import Model

MOST = 1_000_000
"""Dependencies of outputs, or of derivatives, that are listed. In a meshed network without states all outputs depend on
nearly everything, and lists of that would be a hundred times as long as all the rest."""

_SAMPLE = 8  # rows of a pattern from which it is known how long the whole would be


@dataclass(frozen=True, slots=True)
class Unknown:
    """A computed variable, and the variables that it is computed from; None for all that it may be computed from."""

    reference: int
    known: tuple[int, ...] | None


@dataclass(frozen=True, slots=True)
class Structure:
    """Unknowns of a running instance, and of its initialisation."""

    outputs: tuple[Unknown, ...]
    derivatives: tuple[Unknown, ...]
    initial: tuple[Unknown, ...]


def structure(model: Model) -> Structure:
    """Dependence of outputs and derivatives on inputs and states, and of initial unknowns on parameters and inputs.

    Where there would be more than `MOST` dependencies, or a network is solved as data, nothing is listed, which means
    in both versions of FMI that there may be any."""
    np_, nc, nu = len(model.parameters), len(model.calculated), len(model.inputs)
    nx, ny = len(model.states), len(model.outputs)
    parameters, inputs = np.arange(np_), np_ + nc + np.arange(nu)
    states = np_ + nc + nu + np.arange(nx)
    first_output, first_derivative = np_ + nc + nu + nx, np_ + nc + nu + nx + ny

    c_p, x_p = _pattern(model.initialise, 0, 0), _pattern(model.initialise, 1, 0)

    def of(function: ca.Function, first: int) -> tuple[tuple[Unknown, ...], tuple[Unknown, ...]]:
        """Dependence of a function's rows while it runs, and at the start."""
        running = start = _all_unknown(first, function.size1_out(0))
        if model.nodal is None and _length(function, 1) <= MOST:
            by_x, by_u = _pattern(function, 0, 0), _pattern(function, 0, 1)
            running = _unknowns(first, [(by_u, inputs), (by_x, states)])
            if _length(function, 2) <= MOST:
                by_p = _pattern(function, 0, 2) + by_x @ x_p + _pattern(function, 0, 3) @ c_p
                start = _unknowns(first, [(by_p, parameters), (by_u, inputs)])
        return running, start

    outputs, first_outputs = of(model.outputs_function, first_output)
    derivatives, first_derivatives = of(model.derivatives, first_derivative)
    return Structure(
        outputs=outputs,
        derivatives=derivatives,
        initial=(
            *_unknowns(np_, [(c_p, parameters)]),
            *_unknowns(np_ + nc + nu, [(x_p, parameters)]),
            *first_outputs,
            *first_derivatives,
        ),
    )


def unlisted(model: Model) -> Structure:
    """The same unknowns, each of them with no dependencies listed; it costs nothing."""
    np_, nc = len(model.parameters), len(model.calculated)
    nx, first_state = len(model.states), np_ + nc + len(model.inputs)
    outputs = _all_unknown(first_state + nx, len(model.outputs))
    derivatives = _all_unknown(first_state + nx + len(model.outputs), nx)
    initial = (*_all_unknown(np_, nc), *_all_unknown(first_state, nx), *outputs, *derivatives)
    return Structure(outputs, derivatives, initial)


def _all_unknown(first: int, count: int) -> tuple[Unknown, ...]:
    return tuple(Unknown(first + row, None) for row in range(count))


def _length(function: ca.Function, input_: int) -> float:
    """About how many elements of an input the elements of the output depend on, all together."""
    rows = function.size1_out(0)
    if rows * function.size1_in(input_) <= MOST:
        return 0.0
    arguments = [ca.SX.sym("a", function.sparsity_in(k)) for k in range(function.n_in())]
    chosen = np.unique(np.linspace(0, rows - 1, _SAMPLE).astype(int)).tolist()
    some = ca.Function("some", arguments, [function(*arguments)[chosen]])
    return float(some.jac_sparsity(0, input_).nnz() * rows / len(chosen))


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

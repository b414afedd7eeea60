"""The variables that each unknown of a model depends on, from the sparsity of its equations.

Variables are named by their FMI value reference."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import accumulate

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fmus.toolchain.model import Model
from fmus.toolchain.symbols import Function

MOST = 1_000_000
"""Dependencies of outputs, or of derivatives, that are listed. In a meshed network without states all outputs depend on
nearly everything, and lists of that would be a hundred times as long as all the rest."""


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

    Where there would be more than `MOST` dependencies nothing is listed, which means in both versions of FMI that there
    may be any."""
    sizes = (
        len(group) for group in (model.parameters, model.calculated, model.inputs, model.states)
    )
    first_calculated, first_input, first_state, first_output = accumulate(sizes)
    p, c, u, x = (
        partial(_mark, first) for first in (0, first_calculated, first_input, first_state)
    )
    inputs, states = (
        (1 << first_state) - (1 << first_input),
        (1 << first_output) - (1 << first_state),
    )
    c_p, x_p = model.initialise.dependence(p)

    def of(function: Function, first: int) -> tuple[tuple[Unknown, ...], tuple[Unknown, ...]]:
        """Dependence of a function's rows while it runs, and at the start."""
        running = start = _all_unknown(first, len(function.outputs[0]))
        if model.nodal and len(model.inputs) * len(model.outputs) > MOST:
            return running, start
        (by,) = function.dependence(x, u, p, c, *_voltages(model, x, u, p, c))
        if _count(by, inputs) <= MOST:
            running = _unknowns(first, [known & (inputs | states) for known in by])
            if _count(by, (1 << first_calculated) - 1) <= MOST:
                at_start = x_p.__getitem__, u, p, c_p.__getitem__
                start = _unknowns(
                    first, function.dependence(*at_start, *_voltages(model, *at_start))[0]
                )
        return running, start

    outputs, first_outputs = of(model.outputs_function, first_output)
    derivatives, first_derivatives = of(model.derivatives, first_output + len(model.outputs))
    initial = (
        *_unknowns(first_calculated, c_p),
        *_unknowns(first_state, x_p),
        *first_outputs,
        *first_derivatives,
    )
    return Structure(outputs, derivatives, initial)


def _voltages(model: Model, *marks: Callable[[int], int]) -> list[Callable[[int], int]]:
    """Give what each voltage of a network solved as data depends on: all elements and currents of its island."""
    nodal = model.nodal
    if nodal is None:
        return []
    (matrix,), (currents,) = nodal.values.dependence(*marks[1:]), nodal.currents.dependence(*marks)
    n, entries = len(nodal.plan.order), nodal.plan.entries
    _, island = connected_components(
        coo_array((np.ones(len(entries)), np.array(entries).T), shape=(n, n)), False
    )
    found = [0] * n
    for bus, mark in enumerate(currents):
        found[island[bus % n]] |= mark
    for k, mark in enumerate(matrix):
        found[island[entries[k % len(entries)][0]]] |= mark
    return [lambda element: found[island[element % n]]]


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


def _mark(first: int, element: int) -> int:
    return 1 << (first + element)


def _count(marks: list[int], of: int) -> int:
    return sum((mark & of).bit_count() for mark in marks)


def _unknowns(first: int, marks: list[int]) -> tuple[Unknown, ...]:
    """One unknown for each mark, whose bits are the references that it depends on."""
    return tuple(Unknown(first + row, _references(mark)) for row, mark in enumerate(marks))


def _references(mark: int) -> tuple[int, ...]:
    packed = np.frombuffer(mark.to_bytes(mark.bit_length() // 8 + 1, "little"), dtype=np.uint8)
    return tuple(np.flatnonzero(np.unpackbits(packed, bitorder="little")).tolist())

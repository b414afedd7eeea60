"""Answers of a running FMU to moves of one variable each, put back after every one of them.

A linear model of thousands of devices is some hundred thousand such moves, and Python's calls would take longer than
what the devices compute. An FMU of ours in this process makes them in C, where a library is at hand. Where no step was
made, it is put back by its one variable."""

import ctypes
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.compiler import compile_here
from orchestrator.core.arrays import Matrix
from orchestrator.core.interrupts import calls
from orchestrator.devices.fmi.component import Component, RealBatch, address_of

_SOURCE = Path(__file__).with_name("answers_to_moves.c")
_CALLS = {1: "fmi2SetReal", 2: "fmi2GetReal", 3: "fmi2DoStep", 4: "fmi2SetFMUstate"}

_AT_ONCE = 128
"""Moves in one call into C: an interrupt from the keyboard takes effect between two, and a large network takes 4 ms for
a step."""


@dataclass(frozen=True)
class Moves:
    """Variables by their place among those of ``moved``, and the values they are set to, shapes (m,).

    ``moved``: read where the component rests.
    ``steps``: whether a step follows, after which ``after`` is read; ``before`` is read in any case."""

    moved: RealBatch
    places: NDArray[np.int64]
    values: Matrix
    steps: NDArray[np.bool_]
    before: tuple[RealBatch, RealBatch]
    after: RealBatch
    # time, step_size: of the step [s]
    time: float
    step_size: float


@dataclass(frozen=True)
class Answers:
    """Values read around each move, a row each; 0 after a step that was not made."""

    before: tuple[Matrix, Matrix]
    after: Matrix


class _Batch(ctypes.Structure):
    _fields_ = (
        ("references", ctypes.c_void_p),
        ("count", ctypes.c_int64),
        ("rows", ctypes.c_void_p),
    )


class _Moves(ctypes.Structure):
    _fields_ = (
        *(
            (name, ctypes.c_void_p)
            for name in ("component", "set_real", "get_real", "step", "set_state", "saved")
        ),
        ("time", ctypes.c_double),
        ("step_size", ctypes.c_double),
        ("before", _Batch * 2),
        ("after", _Batch),
        *((name, ctypes.c_void_p) for name in ("references", "places", "values", "rest", "steps")),
    )


def answers_to_moves(component: Component, moves: Moves, saved: Any) -> Answers:
    """Make all moves, each from the saved state; the component is left in that state."""
    count = len(moves.places)
    before, after = (
        tuple(np.zeros((count, len(batch.names))) for batch in group)
        for group in (moves.before, (moves.after,))
    )
    answers = Answers((before[0], before[1]), after[0])
    library = None if component.set_state is None else _library()
    if library is None:
        _in_python(component, moves, answers, saved)
    else:
        _in_c(library, component, moves, answers, saved)
    return answers


def _in_python(component: Component, moves: Moves, answers: Answers, saved: Any) -> None:
    moved, at_rest = moves.moved, moves.moved.values.copy()
    for k, place in enumerate(moves.places.tolist()):
        moved.values[place] = moves.values[k]
        moved.write_one(place)
        moved.values[place] = at_rest[place]
        for batch, rows in zip(moves.before, answers.before, strict=True):
            rows[k] = batch.read()
        if moves.steps[k]:
            component.step(moves.time, moves.step_size)
            answers.after[k] = moves.after.read()
        component.restore_state(saved)


def _in_c(
    library: Any,
    component: Component,
    moves: Moves,
    answers: Answers,
    saved: Any,
) -> None:
    def into(batch: RealBatch, rows: Matrix) -> _Batch:
        return _Batch(batch.arguments[1], len(batch.names), address_of(rows))

    functions = {
        name: ctypes.cast(function, ctypes.c_void_p).value
        for name, function in (
            ("set_real", component.set_real),
            ("get_real", component.get_real),
            ("step", component.do_step),
            ("set_state", component.set_state),
        )
    }
    values, steps = np.ascontiguousarray(moves.values), np.ascontiguousarray(moves.steps, np.uint8)
    rest = moves.moved.values[moves.places]
    asked = _Moves(
        component=component.pointer,
        **functions,
        saved=saved,
        time=moves.time,
        step_size=moves.step_size,
        before=(_Batch * 2)(*map(into, moves.before, answers.before)),
        after=into(moves.after, answers.after),
        references=moves.moved.arguments[1],
        places=address_of(moves.places),
        values=address_of(values),
        rest=address_of(rest),
        steps=address_of(steps),
    )
    called = ctypes.c_int(0)
    for first in range(0, len(values), _AT_ONCE):
        count = min(_AT_ONCE, len(values) - first)
        with calls:
            status = library.answers_to_moves(
                ctypes.byref(asked), first, count, ctypes.byref(called)
            )
        component.check(status, _CALLS.get(called.value, ""), moves.time)


@cache
def _library() -> Any | None:
    try:
        # PyDLL keeps Python's lock: Python-backed FMUs would only take it back at every call.
        library = ctypes.PyDLL(str(compile_here(_SOURCE)))
    except (OSError, RuntimeError):
        return None
    integer, address = ctypes.c_int64, ctypes.c_void_p
    library.answers_to_moves.argtypes = [address, integer, integer, address]
    return library

"""The inner loop of the master, compiled: one call into C does many communication steps.

Where no library can be compiled for the platform, the same loop runs in Python.
"""

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.compiler import compile_here
from orchestrator.coupling.schedule import Schedule
from orchestrator.coupling.tracks import Tracks
from orchestrator.errors import NotFiniteError
from orchestrator.fmi.component import Component, RealBatch
from orchestrator.fmi.interrupts import calls

_SOURCE = Path(__file__).with_name("inner_loop.c")
_FUNCTIONS = {1: "fmi2SetReal", 2: "fmi2DoStep", 3: "fmi2GetReal"}
_NOT_FINITE = -1


class Exchange:
    """The coupled inputs and outputs of one component.

    Attributes
    ----------
    inputs, outputs
        Batches of the connected variables. The outputs' values are a window of the system's vector y.
    window
        Where in y that is.
    sources
        For each input the index in y of the output that feeds it.
    delivered
        The index of what arrives at each input: the same, or behind the outputs the place of what a connection makes
        of it (`orchestrator.coupling.wires`).
    """

    def __init__(
        self, component: Component, inputs: RealBatch, outputs: RealBatch, window: slice, sources: NDArray[np.int64]
    ) -> None:
        self.component, self.inputs, self.outputs = component, inputs, outputs
        self.window, self.sources, self.delivered = window, sources, sources


class Stepped(Protocol):
    """What the loop calls of a component."""

    @property
    def name(self) -> str:
        """For errors."""

    @property
    def pointer(self) -> Any:
        """As `Component` has it."""

    @property
    def set_real(self) -> Any:
        """As `Component` has it."""

    @property
    def get_real(self) -> Any:
        """As `Component` has it."""

    @property
    def do_step(self) -> Any:
        """As `Component` has it."""

    def check(self, status: int, call: str, time: float | None = None) -> None:
        """As `Component` has it."""

    def step(self, time: float, step_size: float) -> None:
        """As `Component` has it."""


class Batch(Protocol):
    """What the loop needs of the values that a component takes or gives."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the variables."""

    @property
    def values(self) -> NDArray[np.float64]:
        """The values, shape (n,)."""

    @property
    def arguments(self) -> tuple[Any, ...]:
        """Of the functions that set and get them."""

    @property
    def component(self) -> Stepped:
        """Whose they are."""


class Turn(Protocol):
    """What takes its turn in the loop: a component with its connected values, or a bank of connections."""

    @property
    def component(self) -> Stepped:
        """What is stepped."""

    @property
    def inputs(self) -> Batch:
        """What it takes."""

    @property
    def outputs(self) -> Batch:
        """What it gives."""

    @property
    def window(self) -> slice:
        """Where its outputs stand."""

    @property
    def delivered(self) -> NDArray[np.int64]:
        """Where what it takes stands."""


class Loop(Protocol):
    """Steps a system.

    Attributes
    ----------
    completed
        Communication steps that the last call did.
    before
        The outputs one step earlier, where inputs are extrapolated; else None.
    """

    def advance(self, index: int, count: int, step_size: float) -> None:
        """Do communication steps.

        Raises
        ------
        ComponentError
            If a call fails; ``completed`` tells how many steps were done before.
        NotFiniteError
            If a step gives an output that is no finite number.
        """

    completed: int
    before: NDArray[np.float64] | None

    def seconds(self) -> list[float]:
        """Time spent inside each component's FMI calls [s], in the order of the schedule."""


class _Call(ctypes.Structure):
    _fields_ = (
        ("component", ctypes.c_void_p),
        ("set_real", ctypes.c_void_p),
        ("get_real", ctypes.c_void_p),
        ("step", ctypes.c_void_p),
        ("input_references", ctypes.c_void_p),
        ("output_references", ctypes.c_void_p),
        ("inputs", ctypes.c_void_p),
        ("outputs", ctypes.c_void_p),
        ("sources", ctypes.c_void_p),
        ("n_inputs", ctypes.c_int64),
        ("n_outputs", ctypes.c_int64),
        ("group", ctypes.c_int64),
        ("spent", ctypes.c_double),
        ("tracks", ctypes.c_void_p),
    )


@cache
def _library() -> Any | None:
    try:
        # PyDLL keeps Python's lock: Python-backed FMUs would only take it back at every call.
        library = ctypes.PyDLL(str(compile_here(_SOURCE)))
    except (OSError, RuntimeError):
        return None
    address, integer = ctypes.c_void_p, ctypes.c_int64
    library.advance.argtypes = [address, integer, address, integer, integer, ctypes.c_double, address]
    return library


class CompiledLoop:
    """Steps a system in C."""

    def __init__(self, library: Any, groups: Sequence[Sequence[Turn]], y: NDArray[np.float64], tracks: Tracks) -> None:
        self._library, self._y, self._tracks = library, y, tracks
        self._exchanges = [exchange for group in groups for exchange in group]
        self._calls = (_Call * len(self._exchanges))()
        self._failure = (ctypes.c_int64 * 3)()
        self.completed = 0
        self.before: NDArray[np.float64] | None = None
        for number, group in enumerate(groups):
            for exchange in group:
                self._fill(self._calls[self._exchanges.index(exchange)], exchange, number)

    def _fill(self, call: _Call, exchange: Turn, group: int) -> None:
        def address(function: Any) -> int | None:
            return ctypes.cast(function, ctypes.c_void_p).value

        component = exchange.component
        call.component = component.pointer
        call.set_real, call.get_real = address(component.set_real), address(component.get_real)
        call.step = address(component.do_step)
        _, call.input_references, call.n_inputs, call.inputs = exchange.inputs.arguments
        _, call.output_references, call.n_outputs, call.outputs = exchange.outputs.arguments
        call.sources = exchange.delivered.ctypes.data
        call.group = group
        call.tracks = self._tracks.address(exchange.window.start or 0)

    def advance(self, index: int, count: int, step_size: float) -> None:
        """See `Loop.advance`."""
        with calls:
            status = self._library.advance(
                ctypes.addressof(self._calls),
                len(self._exchanges),
                self._y.ctypes.data,
                index,
                count,
                step_size,
                ctypes.addressof(self._failure),
            )
            self.completed = self._failure[0] - index if status else count
        if status == _NOT_FINITE:
            outputs = self._exchanges[self._failure[1]].outputs
            raise _not_finite(outputs, self._failure[2], (self._failure[0] + 1) * step_size)
        if status:
            component = self._exchanges[self._failure[1]].component
            component.check(status, _FUNCTIONS[self._failure[2]], self._failure[0] * step_size)

    def seconds(self) -> list[float]:
        """See `Loop.seconds`."""
        return [call.spent for call in self._calls]


class PythonLoop:
    """Steps a system in Python.

    Parameters
    ----------
    schedule
        For what is special about its steps.
    hand_over
        Sets all inputs before each step; by default each component takes its own as it steps.
    """

    def __init__(
        self,
        groups: Sequence[Sequence[Turn]],
        y: NDArray[np.float64],
        tracks: Tracks,
        schedule: Schedule,
        hand_over: Callable[[], None] | None = None,
    ) -> None:
        self._groups, self._y, self._tracks, self._hand_over = groups, y, tracks, hand_over
        self._extrapolation, self._ticks_per_second = schedule.extrapolation, schedule.ticks_per_second
        self.before: NDArray[np.float64] | None = None
        self._spent = [[0.0] * len(group) for group in groups]
        self.completed = 0

    def advance(self, index: int, count: int, step_size: float) -> None:
        """See `Loop.advance`."""
        self.completed = 0
        for k in range(index, index + count):
            with calls:
                self._step(*self._interval(k, step_size))
                self.completed += 1

    def _step(self, time: float, size: float) -> None:
        known = self._extrapolated() if self._extrapolation else self._y
        if self._hand_over is not None:
            self._hand_over()
        for group, spent in zip(self._groups, self._spent, strict=True):
            for i, exchange in enumerate(group):
                np.take(known, exchange.delivered, out=exchange.inputs.values, mode="clip")
                start = perf_counter()
                component = exchange.component
                if exchange.inputs.names and self._hand_over is None:
                    component.check(component.set_real(*exchange.inputs.arguments), "fmi2SetReal", time)
                component.step(time, size)
                spent[i] += perf_counter() - start
            for i, exchange in enumerate(group):
                start = perf_counter()
                if exchange.outputs.names:
                    component = exchange.component
                    component.check(component.get_real(*exchange.outputs.arguments), "fmi2GetReal", time)
                known[exchange.window] = exchange.outputs.values
                spent[i] += perf_counter() - start
                bad = self._tracks.follow(exchange.window, exchange.outputs.values)
                if bad is not None:
                    raise _not_finite(exchange.outputs, bad, time + size)

    def _interval(self, index: int, step_size: float) -> tuple[float, float]:
        """Time and size of a step [s]."""
        if self._ticks_per_second is None:
            return index * step_size, step_size
        ticks = round(step_size * self._ticks_per_second)
        time = index * ticks / self._ticks_per_second
        return time, (index + 1) * ticks / self._ticks_per_second - time

    def _extrapolated(self) -> NDArray[np.float64]:
        """All outputs as they would go on rising; what has stepped since then is overwritten group by group."""
        known = self._y + self._extrapolation * (self._y - (self._y if self.before is None else self.before))
        self.before = self._y.copy()
        return known

    def seconds(self) -> list[float]:
        """See `Loop.seconds`."""
        return [seconds for group in self._spent for seconds in group]


def _not_finite(outputs: Batch, index: int, time: float) -> NotFiniteError:
    return NotFiniteError(outputs.component.name, outputs.names[index], float(outputs.values[index]), time)


def make_loop(
    groups: Sequence[Sequence[Turn]],
    y: NDArray[np.float64],
    tracks: Tracks,
    schedule: Schedule,
    hand_over: Callable[[], None] | None = None,
) -> Loop:
    """The compiled loop where there is one and it can do what is asked, else the loop in Python.

    Parameters
    ----------
    groups
        Components that step together, in the order of the schedule.
    y
        All coupled outputs; the loop writes them.
    tracks
        Where each output went; the loop writes them.
    schedule
        What is special about its steps decides whether the compiled loop can do them.
    hand_over
        As for `PythonLoop`.
    """
    library = _library() if schedule.is_plain else None
    if library is None:
        return PythonLoop(groups, y, tracks, schedule, hand_over)
    return CompiledLoop(library, groups, y, tracks)

"""A test bench: one FMU alone at a bus whose voltage we impose, brought to the same operating point for every run.

An FMU that can save its state is put back to it; any other is instantiated anew. Nothing but FMI is used: no states
are read or set, and parameters only before initialisation."""

import ctypes
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.compiler import compile_here
from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.core.interrupts import calls
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.fmi.many_steps import StepRows, Steps
from orchestrator.linear.models.sampled import steps_of_times, times_of

_SOURCE = Path(__file__).with_name("drive.c")
_CALLS = {1: "fmi2SetReal", 2: "fmi2DoStep", 3: "fmi2GetReal"}
STEPS_AT_ONCE = 20000
"""Steps in one call of the C library; an interrupt from the keyboard takes effect between two."""

_NOT_FINITE = -1  # status of drive.c where an output is no finite number

STILL = 1e-9
"""Largest change of an output over a second [pu] at which the device counts as being in steady state; of its mean over
the period, where a sampled controller of phase quantities makes the output repeat after a period."""

_LASTS = 0.01
"""Part by which the swings of two successive seconds may differ if they are to be called lasting."""

_FAST = 5
"""Lowest frequency [Hz] that is told from a drift within a second."""

LOWERED = 0.02
"""Voltage [pu] by which a device's bus is lowered to see if its current follows at once."""

AT_ONCE = 0.5
"""Part of the answer over a period that a current gives before any step from which on it is algebraic."""

_PERIOD = 0.02
"""Time [s] over which an answer is compared with what is there at once."""

_OF_ONE_LINE = 0.5
"""Least share of a movement's power that its strongest line has where the movement is called by that frequency."""


@dataclass
class Bench:
    """Start of a device, and the variables through which it is measured."""

    # description, parameters: the FMU and what it is given before initialisation: rating, power-flow values, its own
    # parameters
    description: FmuDescription
    parameters: Mapping[str, float | bool]
    rest: Numbers  # values of the inputs at the operating point, shape (m,)
    # inputs, outputs: names, such as ``v_re``, ``v_im`` and ``i_re``, ``i_im``
    inputs: Sequence[str] = ("v_re", "v_im")
    outputs: Sequence[str] = ("i_re", "i_im")
    # constant values of the inputs that the bench does not change
    held: Mapping[str, float] = field(default_factory=dict)
    step_size: float = 1e-4  # communication step [s]
    # whether the bench saves and restores the FMU's state; None if it does so with every FMU that can
    restore: bool | None = None
    isolated: bool | None = None  # as in `open_component`
    longest_wait: float = 120.0  # longest time that the device may take to come to rest [s]

    @property
    def saves_state(self) -> bool:
        return self.description.can_save_state if self.restore is None else self.restore

    def opened(self) -> Component:
        """Return a new instance of the device."""
        return open_component("box", self.description, isolated=self.isolated)

    def initialize(self, component: Component) -> None:
        """Bring an instance to its start with the inputs at rest."""
        component.setup(0.0, None)
        component.set(self.parameters)
        component.enter_initialization_mode()
        component.set(dict(self.held) | dict(zip(self.inputs, self.rest.tolist(), strict=True)))
        component.exit_initialization_mode()

    def follows_at_once(self) -> bool:
        """Return whether the outputs are a function of the first input, as a phasor model's current of the voltage is.

        Most of what they answer over a period is there before any step."""
        lowered = self.rest - LOWERED * np.eye(len(self.rest))[0]
        with self.opened() as component:
            self.initialize(component)
            inputs, outputs = (RealBatch(component, names) for names in (self.inputs, self.outputs))
            before = outputs.read().copy()
            inputs.values[:] = lowered
            inputs.write()
            at_once = outputs.read() - before
            if not at_once.any():
                return False
            held = np.tile(lowered, (round(_PERIOD / self.step_size), 1))
            names = self.inputs, self.outputs
            settled = drive(component, names, held, self.step_size, 0)[-1] - before
        return bool(np.linalg.norm(at_once) > AT_ONCE * np.linalg.norm(settled))

    @contextmanager
    def runs(self) -> Iterator["Runs"]:
        runs = Runs(self)
        try:
            yield runs
        finally:
            runs.close()


class Runs:
    """Runs on a bench; each begins at the operating point.

    ``still_after``: Time that the device needed to come to rest [s].
    ``operating_point``: Outputs at the operating point, shape (p,)."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._component: Component | None = None
        self._state: Any = None
        self._index = 0
        self.still_after = 0.0
        try:
            self._start()
            self.operating_point = self._come_to_rest()
            if bench.saves_state:
                self._state = self._running.save_state()
            self._rest_index = self._index
        except BaseException:
            self.close()
            raise

    @property
    def _running(self) -> Component:
        assert self._component is not None
        return self._component

    def respond(self, parts: Iterable[Numbers]) -> Iterator[Numbers]:
        """Outputs after every step while the inputs deviate from rest, part by part as they are asked for.

        ``parts``: Deviations in the order of time, each of shape (n, m); row k holds from point k to point k + 1.

        Yields
        ------
        Deviations of the outputs from the operating point, shape (n, p); row k is read at the end of step k, with
        the inputs of that step still in place.
        """
        self._rewind()
        for deviations in parts:
            yield self._drive(self._bench.rest + deviations) - self.operating_point

    def feedthrough(self, size: float) -> Numbers:
        """Direct effect of the inputs on the outputs, shape (p, m): set and read without a step, ± ``size``."""
        bench = self._bench
        found = np.zeros((len(bench.outputs), len(bench.inputs)))
        self._rewind()
        inputs, outputs = (
            RealBatch(self._running, names) for names in (bench.inputs, bench.outputs)
        )
        for k in range(len(bench.inputs)):
            for sign in (1.0, -1.0):
                inputs.values[:] = bench.rest
                inputs.values[k] += sign * size
                inputs.write()
                found[:, k] += sign * outputs.read()
        inputs.values[:] = bench.rest
        inputs.write()
        return found / (2 * size)

    def close(self) -> None:
        component, self._component = self._component, None
        if component is not None:
            if self._state is not None:
                component.free_state(self._state)
                self._state = None
            component.close()

    def _start(self) -> None:
        component = self._component = self._bench.opened()
        self._bench.initialize(component)
        self._index = 0

    def _rewind(self) -> None:
        if self._state is not None:
            self._running.restore_state(self._state)
            self._index = self._rest_index
        else:
            self.close()
            self._start()
            self._hold(self._rest_index)

    def _come_to_rest(self) -> Numbers:
        """Hold the voltage until no output moves. A device that starts exactly at the power flow's values is at rest at
        once."""
        bench = self._bench
        second = round(1.0 / bench.step_size)
        before = np.inf
        while True:
            outputs = self._means(self._hold(second))
            movement = np.abs(np.ptp(outputs, axis=0)).max()
            if movement <= STILL:
                self.still_after = self._index * bench.step_size - 1.0
                return np.asarray(outputs[-1])
            if self._index * bench.step_size >= bench.longest_wait:
                lasts = abs(movement - before) <= _LASTS * movement
                raise AnalysisError(
                    f"{bench.description.path.name}: alone at an ideal bus its current still "
                    + _never_still(
                        movement,
                        _main_line(outputs) if lasts else None,
                        self._index * bench.step_size,
                    )
                )
            before = movement

    def _means(self, outputs: Numbers) -> Numbers:
        """Means over the period after which the device repeats, one below the other; else the outputs as they are."""
        period = steps_of_times(times_of(self._running), self._bench.step_size)
        whole = len(outputs) // period  # periods
        if period == 1 or whole < 2:
            return outputs
        return np.asarray(
            outputs[len(outputs) - whole * period :].reshape(whole, period, -1).mean(axis=1)
        )

    def _hold(self, count: int) -> Numbers:
        return self._drive(np.tile(self._bench.rest, (count, 1)))

    def _drive(self, inputs: Numbers) -> Numbers:
        """Outputs after each of some steps, shape (n, p)."""
        bench = self._bench
        names = bench.inputs, bench.outputs
        outputs = drive(self._running, names, inputs, bench.step_size, self._index)
        self._index += len(inputs)
        return outputs


def _main_line(outputs: Numbers) -> int | None:
    """Return the frequency [Hz] of most of what moves within a second; None where no fast one has most of it."""
    lines = np.abs(np.fft.rfft(outputs - outputs.mean(axis=0), axis=0)) ** 2
    power = lines.sum(axis=1)
    first = int(power.argmax())
    return first if first >= _FAST and power[first] >= _OF_ONE_LINE * power.sum() else None


def _never_still(movement: float, hertz: int | None, waited: float) -> str:
    """Say what a device does that never comes to rest, and what to do about it.

    ``hertz``: the frequency at which it swings, no less than a second before; None where it does something else."""
    if hertz is None:
        return (
            f"moves by {movement:.3g} pu in a second after {waited:g} s, so there is no operating point to identify it "
            "at; check its start values, or give it more time"
        )
    return (
        f"swings by {movement:.3g} pu at {hertz} Hz of the turning frame after {waited:g} s, no less than a second "
        "before: it emits a harmonic or oscillates by itself, and a measurement would take that for its answer; "
        "measure it with the emission switched off, or an averaged model of it"
    )


def drive(
    component: Component,
    names: tuple[Sequence[str], Sequence[str]],
    inputs: Numbers,
    step_size: float,
    index: int = 0,
    late: Numbers | None = None,
) -> Numbers:
    """Step a component with one row of inputs after another; its outputs at the end of each step, shape (n, p).

    ``names``: of the inputs and of the outputs; ``inputs``: shape (n, m); ``index``: steps that were made before;
    ``late``: inputs with which the outputs are read after each step, where those are not the step's own.

    Raises an `AnalysisError` if an output is no finite number, and a `ComponentError` if the FMU refuses a call."""
    outputs = np.empty((len(inputs), len(names[1])))
    for first in range(0, len(inputs), STEPS_AT_ONCE):
        part = slice(first, min(first + STEPS_AT_ONCE, len(inputs)))
        rows = np.ascontiguousarray(inputs[part])
        read = None if late is None else np.ascontiguousarray(late[part])
        _drive_stretch(component, names, (rows, read, outputs[part]), step_size, index + first)
    return outputs


MOST_BESIDE = 8
"""Components that `drive_beside` steps side by side at most, as drive.c has them."""


def drive_beside(
    components: Sequence[Component],
    names: tuple[Sequence[str], Sequence[str]],
    inputs: Sequence[Numbers],
    step_size: float,
    index: int = 0,
    late: Sequence[Numbers] | None = None,
) -> list[Numbers | None]:
    """Outputs of components of one library that step side by side, each with as many rows of its own, as `drive` has.

    None for one that refuses a call or has an output that is no finite number: alone it says why."""
    count = len(inputs[0])
    outputs = [np.empty((count, len(names[1]))) for _ in components]
    refused = np.zeros(len(components), dtype=np.int32)
    for first in range(0, count, STEPS_AT_ONCE):
        part = slice(first, min(first + STEPS_AT_ONCE, count))
        rows = [
            StepRows(
                component,
                names,
                np.ascontiguousarray(inputs[k][part]),
                outputs[k][part],
                None if late is None else np.ascontiguousarray(late[k][part]),
            )
            for k, component in enumerate(components)
        ]
        _make_beside(components, rows, step_size, index + first, refused)
    return [
        None if status or not np.isfinite(own).all() else own
        for status, own in zip(refused, outputs, strict=True)
    ]


def _make_beside(
    components: Sequence[Component],
    rows: Sequence[StepRows],
    step_size: float,
    index: int,
    refused: NDArray[np.int32],
) -> None:
    asked = (Steps * len(rows))(*(one.at(index, step_size) for one in rows))
    pointers = np.array([one.pointer for one in components], dtype=np.uint64)
    first = components[0]
    functions = [
        ctypes.cast(one, ctypes.c_void_p)
        for one in (first.set_real, first.get_real, first.step_stack)
    ]
    with calls:
        _library().drive_beside(
            pointers.ctypes.data, *functions, ctypes.byref(asked), len(rows), refused.ctypes.data
        )


class Turning(ctypes.Structure):
    """The arguments of ``drive_turning`` in drive.c, and where it stands."""

    _fields_ = (
        ("voltage", ctypes.c_void_p),
        ("late", ctypes.c_void_p),
        ("measured", ctypes.c_void_p),
        ("along", ctypes.c_void_p),
        ("angle", ctypes.c_void_p),
        ("ahead", ctypes.c_void_p),
        ("current", ctypes.c_void_p),
        ("turns", ctypes.c_void_p),
        ("count", ctypes.c_int64),
        ("each", ctypes.c_int64),
        ("gain", ctypes.c_double),
        ("lasts", ctypes.c_double),
        ("scale", ctypes.c_double),
        ("turn", ctypes.c_double),
        ("slow", ctypes.c_double),
        ("rate", ctypes.c_double),
    )


class Stretches:
    """Stretches of a few steps of one component, one after the other, in rows that are laid out once.

    ``names``: of the inputs and of the outputs; ``longest``: steps in a stretch at most; ``index``: steps that were
    made before."""

    def __init__(
        self,
        component: Component,
        names: tuple[Sequence[str], Sequence[str]],
        longest: int,
        step_size: float,
        index: int,
    ) -> None:
        self._component = component
        self._inputs, self._late = (np.empty((longest, len(names[0]))) for _ in range(2))
        self._outputs = np.empty((longest, len(names[1])))
        self._rows = StepRows(component, names, self._inputs, self._outputs, self._late)
        self._steps = self._rows.at(index, step_size)

    @property
    def turns_at_once(self) -> bool:
        """Return whether `turn` makes the steps: where many of them are one exchange, a stretch is one."""
        return not self._component.takes_many(self._steps)

    def drive(self, inputs: Numbers, late: Numbers) -> Numbers:
        """Outputs after each step, as `drive` has them; valid until the next stretch."""
        count = self._steps.count = len(inputs)
        self._inputs[:count], self._late[:count] = inputs, late
        outputs = self._outputs[:count]
        _make(self._component, self._steps, outputs)
        self._steps.index += count
        return outputs

    def turn(self, run: Turning) -> None:
        """Make the steps of ``run``, in whole stretches, in one call."""
        component, steps, failed = self._component, self._steps, (ctypes.c_int64 * 2)()
        at = (ctypes.byref(one) for one in (steps, failed, run))
        with calls:
            status = _library().drive_turning(component.pointer, *_functions(component), *at)
        if status == _NOT_FINITE:
            raise _no_number(component)
        _check(component, steps, status, failed)


def _drive_stretch(
    component: Component,
    names: tuple[Sequence[str], Sequence[str]],
    rows: tuple[Numbers, Numbers | None, Numbers],
    step_size: float,
    index: int,
) -> None:
    inputs, late, outputs = rows
    asked = StepRows(component, names, inputs, outputs, late)
    _make(component, asked.at(index, step_size), outputs)


def _make(component: Component, steps: Steps, outputs: Numbers) -> None:
    """Make steps of a component, which fills ``outputs``."""
    failed = (ctypes.c_int64 * 2)()
    at = ctypes.addressof(steps), ctypes.addressof(failed)
    with calls:
        if component.takes_many(steps):
            status = component.many_steps(component.pointer, *at)
        else:
            status = _library().drive(component.pointer, *_functions(component), *at)
    _check(component, steps, status, failed)
    if not np.isfinite(outputs).all():
        raise _no_number(component)


def _functions(component: Component) -> list[ctypes.c_void_p]:
    """The functions of a component that the C library calls."""
    each = (component.set_real, component.get_real, component.do_step)
    return [ctypes.cast(one, ctypes.c_void_p) for one in each]


def _check(
    component: Component, steps: Steps, status: int, failed: ctypes.Array[ctypes.c_int64]
) -> None:
    if status:
        time = (steps.index + failed[0]) * steps.step_size
        component.check(status, _CALLS[failed[1]], time)


def _no_number(component: Component) -> AnalysisError:
    return AnalysisError(
        f"{component.description.path.name}: its current is no longer a finite number"
    )


@cache
def _library() -> Any:
    try:
        # PyDLL keeps Python's lock: Python-backed FMUs would only take it back at every call.
        library = ctypes.PyDLL(str(compile_here(_SOURCE)))
    except (OSError, RuntimeError) as error:
        raise InputError(f"the test bench is compiled, and {error}") from error
    library.drive.argtypes = [ctypes.c_void_p] * 6
    library.drive_beside.argtypes = [*[ctypes.c_void_p] * 5, ctypes.c_int64, ctypes.c_void_p]
    library.drive_beside.restype = None
    library.drive_turning.argtypes = [ctypes.c_void_p] * 7
    return library

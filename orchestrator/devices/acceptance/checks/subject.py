"""The FMU under test: instances of it at an operating point, and runs with reproducible inputs."""

from cmath import rect
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.closing import Closing
from orchestrator.devices.acceptance.linear_network import LinearNetwork
from orchestrator.devices.acceptance.process import FmuProcess, HostedComponent
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.port_mapping import START, BoundDescription

Stimulus = Callable[[float], Numbers]  # time [s] → the inputs' deviations from where they start
STEPS_IN_A_ROUND = 4096  # random inputs, after which they come again
PORT_STEP = 1e-4  # communication step [s] at which converters are coupled


@dataclass(frozen=True)
class OperatingAt:
    """An operating point: S = P + jQ [pu, S_n] at the bus voltage v∠θ [pu, rad]."""

    v: float = 1.0
    theta: float = 0.0
    P: float = 0.5
    Q: float = 0.1

    @property
    def voltage(self) -> complex:
        """The bus voltage as a complex number [pu]."""
        return rect(self.v, self.theta)


@dataclass(frozen=True)
class Use:
    step_size: float | None = None  # communication step [s]
    point: OperatingAt | None = None  # where the power flow puts it
    # values, inputs: of its parameters, and of inputs that nothing feeds
    values: Mapping[str, float | bool] = field(default_factory=dict)
    inputs: Mapping[str, float] = field(default_factory=dict)
    said: str = ""  # where that comes from, and the operating point, in words


class Subject:
    """One FMU, opened as often as a check wants.

    ``port``: Whether it speaks our port, by a binding or by itself.
    ``starts``: Whether it takes the power flow's start values.
    ``step_size``: Communication step of the tests [s].
    ``step_is_given``: Whether the file declares it or the user asks for it.
    ``memory``: Results that several checks share.
    ``steps_made``: How many steps its instances have made.
    ``start_time``: At which its instances begin [s]."""

    # gives the process in which it runs, a new one after its end; whoever runs checks sets it.
    process: Callable[[], FmuProcess]
    # gives a process whose clock is so many seconds later; whoever runs checks sets it.
    process_at: Callable[[int], AbstractContextManager[FmuProcess]]

    def __init__(
        self, description: FmuDescription, directory: Path, use: Use | None = None, seed: int = 1
    ) -> None:
        self.description, self.directory, self.doing, self.seed = description, directory, "", seed
        self.use, self.start_time = use or Use(), 0.0
        self.memory: dict[str, Any] = {}
        self.steps_made = 0
        variables = description.variables
        self.inputs = tuple(n for n in description.inputs if variables[n].type == "Real")
        self.outputs = tuple(n for n in description.outputs if variables[n].type == "Real")
        self.port = {"v_re", "v_im"} <= set(self.inputs) and {"i_re", "i_im"} <= set(self.outputs)
        self.port &= (
            all(variables[n].unit in ("pu", "p.u.") for n in ("v_re", "v_im", "i_re", "i_im"))
            if self.port
            else False
        )
        bound = (
            description.port.start
            if isinstance(description, BoundDescription)
            else dict.fromkeys(START)
        )
        wanted = ("P_0", "Q_0", "v_0", "theta_0")
        self.starts = self.port and all(n in bound and n in variables for n in wanted)
        self.step_is_given = (
            self.use.step_size is not None or description.default_step_size is not None
        )
        self.step_size = self.use.step_size or self._step_size()

    def _step_size(self) -> float:
        described = self.description
        if described.default_step_size is not None:
            return described.default_step_size
        if self.port:
            return PORT_STEP
        return min(1e-3, described.stop_time / 1000) if described.stop_time else 1e-3

    def open(self, name: str = "fmu") -> HostedComponent:
        return HostedComponent(name, self.process())

    @contextmanager
    def with_clock(self, shift: int) -> Iterator[None]:
        """Open instances in a process whose date and time of day are so many seconds later."""
        usual = self.process
        with self.process_at(shift) as other:
            self.process = lambda: other
            try:
                yield
            finally:
                self.process = usual

    @contextmanager
    def while_doing(self, what: str) -> Iterator[None]:
        """Name what is done to it; the name stays behind where the FMU ends its process."""
        self.doing = what
        yield
        self.doing = ""

    def running(
        self,
        name: str = "fmu",
        point: OperatingAt | None = None,
        parameters: Mapping[str, float | bool] | None = None,
        backwards: bool = False,
    ) -> "Running":
        """A new instance, initialised; use it as a context manager.

        ``backwards``: Whether its start values, parameters and inputs are set in reversed order."""
        component = self.open(name)
        try:
            return Running(self, component, point, parameters, backwards=backwards)
        except BaseException:
            component.close()
            raise

    def prepare(
        self,
        component: HostedComponent,
        point: OperatingAt | None = None,
        parameters: Mapping[str, float | bool] | None = None,
        *,
        backwards: bool = False,
    ) -> None:
        """Give a new instance what it is given before initialisation.

        ``point``: operating point that it starts from; the one of use where None.
        ``backwards``: Whether it is given that in reversed order."""
        component.setup(self.start_time, None)
        values: dict[str, float | bool] = {}
        if self.starts:
            at = point or self.point
            start = {"P_0": at.P, "Q_0": at.Q, "v_0": at.v, "theta_0": at.theta}
            values = {n: v for n, v in start.items() if n in self.description.variables}
        wanted = {**self.use.values, **(parameters or {})}
        if backwards:
            component.set(dict(reversed({**values, **wanted}.items())))
            return
        component.set(values)
        component.set(wanted)

    def memory_in_use(self) -> int:
        """Bytes in use in the FMU's process, as it says; 0 where it cannot."""
        return self.process().number("memory in use", -1, "memory_in_use")

    @property
    def ends(self) -> float | None:
        """When its experiment ends [s]: as declared, or where it was seen to end by itself; None where not known."""
        known = [
            t for t in (self.description.stop_time, self.memory.get("ended_at")) if t is not None
        ]
        return min(known, default=None)

    @property
    def watched(self) -> tuple[str, ...]:
        """Return what tells runs apart: the outputs, or any Real variable that moves where there is none."""
        if self.outputs:
            return self.outputs
        variables = self.description.variables.values()
        return tuple(v.name for v in variables if v.type == "Real" and v.causality == "local")[:50]

    @property
    def is_machine(self) -> bool:
        return self.description.kind == "machine"

    @property
    def point(self) -> OperatingAt:
        """Where it starts, where nobody says otherwise."""
        return self.use.point or OperatingAt()

    @property
    def start_voltage(self) -> complex:
        """Bus voltage [pu] at which it starts."""
        return self.point.voltage

    def start_inputs(self, point: OperatingAt | None) -> Numbers:
        """The inputs' values at an operating point; where they are not the port's, what the FMU declares."""
        voltage = (point or self.point).voltage
        known = dict(self.use.inputs) | (
            {"v_re": voltage.real, "v_im": voltage.imag} if self.port else {}
        )
        return np.array(
            [known.get(n, self.description.variables[n].start_number) for n in self.inputs]
        )

    def random(self, purpose: str) -> np.random.Generator:
        """Random numbers for one purpose: equal ones whenever they are asked for."""
        return np.random.default_rng((self.seed, crc32(purpose.encode())))

    @property
    def amplitudes(self) -> Numbers:
        """A small deviation for each input, within what it declares."""
        sizes = []
        for name in self.inputs:
            info = self.description.variables[name]
            start = info.start_number
            size = 0.02 if self.port and name in ("v_re", "v_im") else max(0.05 * abs(start), 0.05)
            room = [
                abs(limit - start) for limit in (info.minimum, info.maximum) if limit is not None
            ]
            sizes.append(min([size, *[0.5 * r for r in room if r > 0]]))
        return np.array(sizes)

    def steps(self, hold: float, seed: int = 1) -> Stimulus:
        """Steps of random height that are held for ``hold`` seconds; equal seeds give equal steps."""
        heights = (
            np.random.default_rng(seed).uniform(-1, 1, (STEPS_IN_A_ROUND, len(self.inputs)))
            * self.amplitudes
        )
        return lambda time: heights[int(time / hold + 1e-6) % len(heights)]

    def one_step(self) -> Stimulus:
        return lambda time: self.amplitudes

    def motion(self, step_size: float) -> Stimulus:
        return lambda time: self.amplitudes * np.sin(1.0 + 0.86 * time / step_size)

    def trajectory(
        self, steps: int, step_size: float, stimulus: Stimulus, **options: Any
    ) -> Numbers:
        """Outputs at each communication point of a new instance, shape (steps + 1, number of outputs).

        ``step_size``: their length [s].
        ``stimulus``: gives the deviations of the inputs from where they start, at a time [s]."""
        with self.running(**options) as running:
            return running.record(steps, step_size, stimulus)

    def through(self, rows: Numbers, **options: Any) -> Numbers:
        """Outputs after each step of a new instance whose inputs deviate by one row a step; options as `running`."""
        with self.running(**options) as running:
            return running.hold(rows, len(rows), self.step_size)


class Running(Closing):
    """An initialised instance that knows its time."""

    def __init__(
        self,
        subject: Subject,
        component: HostedComponent,
        point: OperatingAt | None = None,
        parameters: Mapping[str, float | bool] | None = None,
        *,
        backwards: bool = False,
    ) -> None:
        self.subject, self.component, self.point = subject, component, point
        self.order = slice(None, None, -1 if backwards else 1)  # in which inputs are set
        self.backwards = backwards
        self.parameters = dict(parameters or {})
        self.begin()

    def begin(self) -> None:
        subject, component = self.subject, self.component
        self.time = subject.start_time
        subject.prepare(component, self.point, self.parameters, backwards=self.backwards)
        component.enter_initialization_mode()
        self.rest = subject.start_inputs(self.point)
        self._in = RealBatch(component, subject.inputs[self.order])
        self._out = RealBatch(component, subject.watched)
        self.feed(np.zeros(len(self.rest)))
        component.exit_initialization_mode()

    def feed(self, deviation: Numbers) -> None:
        """Set the inputs to their start values plus a deviation."""
        self._in.values[:] = (self.rest + deviation)[self.order]
        self._in.write()

    def read(self) -> Numbers:
        return self._out.read().copy()

    def step(self, step_size: float) -> None:
        self.component.step(self.time, step_size)
        self.subject.steps_made += 1
        self.time += step_size

    def record(self, steps: int, step_size: float, stimulus: Stimulus) -> Numbers:
        """Step and read, shape (steps + 1, n); the first row is before the stimulus."""
        begin = self.time
        before = self.read()
        # not accumulated: equal runs have equal times
        rows = [stimulus(begin + k * step_size) for k in range(steps)]
        return np.vstack(
            [before, self.hold(np.array(rows).reshape(steps, len(self.rest)), steps, step_size)]
        )

    def hold(self, deviations: Numbers, steps: int, step_size: float) -> Numbers:
        """Step many times at once, shape (steps, n): what was read after each.

        ``deviations``: of the inputs before the first steps, one row each; after the last row they stay."""
        begin = self.time
        if not steps:
            return np.empty((0, len(self._out.names)))
        rows = np.empty((0, 0))
        if len(self.rest):
            rows = np.ascontiguousarray((self.rest + deviations)[:, self.order])
        values = self.component.run(self._in, rows, self._out, steps, begin, step_size)
        self.time = begin + steps * step_size
        self.subject.steps_made += steps
        return values

    def coupled(self, network: LinearNetwork, out: RealBatch, steps: int) -> Numbers:
        """Step many times at a network that takes what is read and gives the bus voltage, shape (steps, n).

        ``out``: what is read after each step."""
        row = self.rest.copy()
        row[[self.subject.inputs.index(name) for name in ("v_re", "v_im")]] = 0.0
        begin, h = self.time, self.subject.step_size
        rows = np.ascontiguousarray(row[self.order])[None]
        values = self.component.run(self._in, rows, out, steps, begin, h, network=network)
        self.time = begin + steps * h
        self.subject.steps_made += steps
        return values

    def save(self) -> Any:
        return self.component.save_state()

    def restore(self, state: Any, time: float) -> None:
        """Bring it back to a state that was saved at this time [s]."""
        self.component.restore_state(state)
        self.time = time

    def reset(self) -> None:
        self.component.reset()
        self.begin()

    def close(self) -> None:
        self.component.close()


@contextmanager
def saved(running: Running) -> Iterator[Any]:
    state = running.save()
    try:
        yield state
    finally:
        running.component.free_state(state)


@contextmanager
def unmoved(running: Running) -> Iterator[None]:
    """Bring it back to where it was before what is done meanwhile."""
    at = running.time
    with saved(running) as kept:
        yield
        running.restore(kept, at)

"""The master: brings FMUs to life, exchanges their values, and steps them along a schedule."""

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from math import isfinite
from pathlib import Path
from shutil import rmtree
from time import perf_counter
from types import TracebackType
from typing import Self

import numpy as np

from orchestrator.coupling.clock import Clock
from orchestrator.coupling.events import Event
from orchestrator.coupling.loop import Exchange, make_loop
from orchestrator.coupling.observers import Observer
from orchestrator.coupling.schedule import Schedule
from orchestrator.coupling.statistics import ComponentStatistics, StepStatistics
from orchestrator.coupling.system import Endpoint, System
from orchestrator.coupling.tracks import Tracks
from orchestrator.errors import ComponentError, InputError, NotFiniteError
from orchestrator.fmi.archive import extract
from orchestrator.fmi.component import Component, RealBatch
from orchestrator.fmi.instance import open_component
from orchestrator.fmi.interrupts import calls

_INITIAL_PASSES = 20
_LONGEST_STRETCH = 1000
"""Communication steps done at a stretch, so that an interrupt from the keyboard is heard."""


class Master:
    """A running system; use it as a context manager, so that every FMU is released.

    Parameters
    ----------
    system
        Components and connections; every input must be fed or constant.
    schedule
        Order of the components within a communication step.
    step_size
        Communication step H [s].
    stop_time
        Told to the FMUs at set-up [s].

    Attributes
    ----------
    index, time
        Number of communication steps done, and the time [s] reached.
    y
        All coupled outputs, shape (n,), as last exchanged; their names are ``output_names``.
    tracks
        Where each of them went, step by step, since an observer last looked.

    Raises
    ------
    InputError
        If an input is fed by nothing, or the schedule does not fit the components.
    ComponentError
        If an FMU cannot be instantiated or initialised.
    """

    def __init__(self, system: System, schedule: Schedule, step_size: float, stop_time: float | None = None) -> None:
        open_inputs = [str(endpoint) for endpoint in system.unconnected_inputs()]
        if open_inputs:
            raise InputError(
                f"inputs that nothing feeds: {', '.join(open_inputs)}; connect them or give them a constant value"
            )
        schedule.check(set(system.components))
        self.system, self.schedule, self.clock = system, schedule, Clock(step_size)
        self.index = 0
        self.components: dict[str, Component] = {}
        self._release = ExitStack()
        try:
            self._instantiate(stop_time)
            self.exchanges = self._connect()
            self._initialise()
        except BaseException:
            self.close()
            raise
        groups = [[self.exchanges[name] for name in group] for group in schedule.groups]
        self._wires = self._single_wires() if schedule.wire_by_wire else []
        self._handed_over = False
        self.tracks = Tracks(len(self.y))
        self._loop = make_loop(groups, self.y, self.tracks, schedule, self._hand_over if self._wires else None)

    # -- life cycle ------------------------------------------------------------------------------

    def _instantiate(self, stop_time: float | None) -> None:
        folders: dict[Path, Path] = {}
        for name, plan in self.system.components.items():
            path = plan.description.path
            if path not in folders:
                folders[path] = extract(path)
                self._release.callback(rmtree, folders[path], ignore_errors=True)
            component = open_component(name, plan.description, folders[path], isolated=plan.isolated)
            self._release.enter_context(component)
            self.components[name] = component
            component.set(plan.parameters)
            component.setup(0.0, stop_time)

    def _connect(self) -> dict[str, Exchange]:
        sources = list(dict.fromkeys(c.source for c in self.system.connections))
        sources.sort(key=lambda s: list(self.components).index(s.component))
        self.output_names = tuple(str(s) for s in sources)
        self.y = np.zeros(len(sources))
        exchanges = {}
        for name, component in self.components.items():
            own = [i for i, s in enumerate(sources) if s.component == name]
            feeding = [c for c in self.system.connections if c.target.component == name]
            window = slice(own[0], own[-1] + 1) if own else slice(0)
            exchanges[name] = Exchange(
                component,
                RealBatch(component, [c.target.variable for c in feeding]),
                RealBatch(component, [sources[i].variable for i in own], self.y[window]),
                window,
                np.array([sources.index(c.source) for c in feeding], dtype=np.int64),
            )
        return exchanges

    def _single_wires(self) -> list[tuple[RealBatch, RealBatch]]:
        """Source and target of every connection by themselves, sharing their value."""
        wires = []
        for wire in self.system.connections:
            source = RealBatch(self.components[wire.source.component], [wire.source.variable])
            target = RealBatch(self.components[wire.target.component], [wire.target.variable], source.values)
            wires.append((source, target))
        return wires

    def _initialise(self) -> None:
        """Bring all FMUs through initialisation, with the first inputs that the schedule gives them."""
        for name, component in self.components.items():
            component.enter_initialization_mode()
            component.set(self.system.components[name].inputs)
        if self.schedule.first_inputs == "consistent":
            self._propagate()
            return
        for component in self.components.values():
            component.exit_initialization_mode()
        if self.schedule.first_inputs == "once":
            for exchange in self.exchanges.values():
                exchange.outputs.read()
        elif self.schedule.first_inputs == "start":
            self._take_start_values()

    def _propagate(self) -> None:
        """Propagate outputs until nothing changes any more, and end initialisation."""
        for _ in range(_INITIAL_PASSES):
            before = self.y.copy()
            for group in self.schedule.groups:
                for name in group:
                    self.exchange_inputs(name)
                    self.exchanges[name].outputs.read()
            if np.allclose(before, self.y, rtol=0, atol=1e-14):
                break
        for name, component in self.components.items():
            self.exchange_inputs(name)
            component.exit_initialization_mode()
        for exchange in self.exchanges.values():
            exchange.outputs.read()

    def _take_start_values(self) -> None:
        """Let every output be what the inputs that it feeds start from."""
        starts: dict[Endpoint, tuple[float, Endpoint]] = {}
        for wire in self.system.connections:
            info = self.system.components[wire.target.component].description.variables[wire.target.variable]
            value = info.start_number
            known, other = starts.setdefault(wire.source, (value, wire.target))
            if known != value:
                raise InputError(
                    f"{wire.source} feeds {other}, which starts from {known:g}, and {wire.target}, which starts from "
                    f"{value:g}; with first_inputs = 'start' all inputs of an output must start from the same value"
                )
            self.y[self.output_names.index(str(wire.source))] = value

    def close(self) -> None:
        """Terminate and free every FMU; calling it again does nothing."""
        self._release.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- single steps ----------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self.clock.time(self.index)

    def exchange_inputs(self, name: str) -> None:
        """Send a component the newest outputs of its partners."""
        exchange = self.exchanges[name]
        if len(exchange.sources):
            np.take(self.y, exchange.sources, out=exchange.inputs.values, mode="clip")
            exchange.inputs.write()

    def exchange(self) -> None:
        """Send every component the newest outputs of its partners, all at once or as the schedule has it."""
        for source, target in self._wires:
            source.read()
            target.write()
        if not self._wires:
            for name in self.components:
                self.exchange_inputs(name)
        self._handed_over = True

    def _hand_over(self) -> None:
        """Exchange before a step, unless an observer had it done: wire by wire, a second time gives other values."""
        if not self._handed_over:
            self.exchange()
        self._handed_over = False

    def advance(self, count: int) -> None:
        """Do ``count`` communication steps and nothing else.

        Raises
        ------
        ComponentError
            With the time of the step that failed; ``index`` counts the steps that were completed.
        """
        try:
            self._loop.advance(self.index, count, self.clock.step_size)
        finally:
            self.index += self._loop.completed

    # -- runs ------------------------------------------------------------------------------------

    def run(self, stop_time: float, events: Sequence[Event] = (), observers: Sequence[Observer] = ()) -> StepStatistics:
        """Step until a time [s].

        An event happens at its communication point before the step that starts there, and the
        outputs of its components are read again, so that its partners see the change at once.

        Raises
        ------
        InputError
            If the stop time or an event is not at a communication point.
        ComponentError
            If an FMU fails; observers are ended first, so nothing recorded is lost.
        NotFiniteError
            If a coupled output is no finite number, at whatever step.
        """
        calls.watch()  # again: a notebook hands Ctrl-C back to Python after each cell
        stop = self.clock.index(stop_time, "the stop")
        due: dict[int, list[Event]] = {}
        for event in events:
            due.setdefault(self.clock.index(event.time, "an event"), []).append(event)
        first, start, before = self.index, perf_counter(), self._loop.seconds()
        stops = sorted({stop, *(i for i in due if first <= i < stop)})
        begun: list[Observer] = []
        try:
            for observer in observers:
                observer.begin(self, stop)
                begun.append(observer)
                observer.observe(self)
            self._require_finite(self.components)
            for target in stops:
                self._run_to(target, first, observers)
                if target < stop:
                    self._apply(due[target])
        except ComponentError as error:
            if error.time is None:
                raise ComponentError(error.component, error.call, error.status, error.log, self.time) from error
            raise
        finally:
            for observer in begun:
                observer.end(self)
        return self._statistics(self.index - first, perf_counter() - start, before)

    def _run_to(self, target: int, first: int, observers: Iterable[Observer]) -> None:
        """Step to a communication point, stopping only where an observer looks."""
        while self.index < target:
            done = self.index - first
            self.advance(min([target - self.index, _LONGEST_STRETCH, *(o.every - done % o.every for o in observers)]))
            done = self.index - first
            for observer in observers:
                if done % observer.every == 0:
                    observer.observe(self)

    def _apply(self, events: Sequence[Event]) -> None:
        for event in events:
            for name, settings in event.changes().items():
                self.components[name].set(settings)
            for name in event.changes():
                self.components[name].read(self.exchanges[name].outputs)
            self._require_finite(event.changes())

    def _require_finite(self, names: Iterable[str]) -> None:
        """What components gave without a step, at the start and at events; the inner loop looks after the steps."""
        for name in names:
            outputs = self.exchanges[name].outputs
            for variable, value in zip(outputs.names, outputs.values.tolist(), strict=True):
                if not isfinite(value):
                    raise NotFiniteError(name, variable, value, self.time)

    def _statistics(self, steps: int, seconds: float, before: Sequence[float]) -> StepStatistics:
        names = [name for group in self.schedule.groups for name in group]
        spent = [after - then for after, then in zip(self._loop.seconds(), before, strict=True)]
        return StepStatistics(
            steps,
            seconds,
            tuple(ComponentStatistics(n, steps, s, s / seconds) for n, s in zip(names, spent, strict=True)),
        )

"""The master: brings FMUs to life, exchanges their values, and steps them along a schedule."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from math import isfinite
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.removal import remove_tree
from orchestrator.arrays import Numbers
from orchestrator.coupling.clock import Clock
from orchestrator.coupling.events import Event, NotANumber, Silence, WireFault, WireRecovery
from orchestrator.coupling.loop import Exchange, Turn, make_loop
from orchestrator.coupling.observers import Observer
from orchestrator.coupling.run_state import (
    NOT_KEPT,
    Keeper,
    Resumable,
    RunState,
    resume_observers,
    set_state,
    state_as_bytes,
)
from orchestrator.coupling.schedule import Schedule
from orchestrator.coupling.statistics import ComponentStatistics, StepStatistics
from orchestrator.coupling.system import ComponentPlan, Endpoint, System
from orchestrator.coupling.tracks import Tracks
from orchestrator.coupling.wire_bank import WireBank
from orchestrator.coupling.wires import Wires
from orchestrator.errors import ComponentError, InputError, NotFiniteError, NotTakenUpError
from orchestrator.fmi.archive import extract
from orchestrator.fmi.component import Component, RealBatch
from orchestrator.fmi.instance import open_component
from orchestrator.fmi.interrupts import calls
from orchestrator.fmi.silence import silence

_INITIAL_PASSES = 20
_JUMP = 1e-6
"""Of 1 or of an output: by how much it may change as initialisation ends, with the inputs as they were."""
_LONGEST_STRETCH = 1000
"""Communication steps done at a stretch, so that an interrupt from the keyboard is heard."""


def open_plan(name: str, plan: ComponentPlan, directory: Path) -> Component:
    """A component as its plan has it, on this machine."""
    return open_component(name, plan.description, directory, isolated=plan.isolated)


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
    opener
        Brings a component to life, from its name, its plan and the folder with its FMU's files.

    Attributes
    ----------
    index, time
        Number of communication steps done, and the time [s] reached.
    y
        All coupled outputs, shape (n,), as last exchanged; their names are ``output_names``.
    tracks
        Where each of them went, step by step, since an observer last looked.
    late_starts
        By component, in words, which output was another just after initialisation than just before its end, at the
        same inputs. Its partners were initialised with the first value.
    wires
        The connections that do more than carry a value.

    Raises
    ------
    InputError
        If an input is fed by nothing, the schedule does not fit the components, or a connection's delay does not fit
        the communication step.
    ComponentError
        If an FMU cannot be instantiated or initialised.
    """

    def __init__(
        self,
        system: System,
        schedule: Schedule,
        step_size: float,
        stop_time: float | None = None,
        opener: Callable[[str, ComponentPlan, Path], Component] = open_plan,
    ) -> None:
        open_inputs = [str(endpoint) for endpoint in system.unconnected_inputs()]
        if open_inputs:
            raise InputError(
                f"inputs that nothing feeds: {', '.join(open_inputs)}; connect them or give them a constant value"
            )
        schedule.check(set(system.components))
        self.system, self.schedule, self.clock = system, schedule, Clock(step_size)
        self.index = 0
        self.components: dict[str, Component] = {}
        self.late_starts: dict[str, str] = {}
        self._release = ExitStack()
        try:
            self._instantiate(stop_time, opener)
            self.exchanges = self._connect()
            self._initialise()
        except BaseException:
            self.close()
            raise
        self._single = self._single_wires() if schedule.wire_by_wire else []
        self._handed_over = False
        self._whole = False  # whether every observer has looked at this communication point
        self._applied = -1  # the last communication point whose events have happened
        self.tracks = Tracks(len(self.y), len(self._values) - len(self.y))
        hand_over = self._hand_over if self._single else None
        self._loop = make_loop(self._turns(), self._values, self.tracks, schedule, hand_over)

    # -- life cycle ------------------------------------------------------------------------------

    def _instantiate(self, stop_time: float | None, opener: Callable[[str, ComponentPlan, Path], Component]) -> None:
        folders: dict[Path, Path] = {}
        for name, plan in self.system.components.items():
            path = plan.description.path
            if path not in folders:
                folders[path] = extract(path)
                self._release.callback(remove_tree, folders[path])
            component = opener(name, plan, folders[path])
            self._release.enter_context(component)
            self.components[name] = component
            component.set(plan.parameters)
            component.setup(0.0, stop_time)

    def _connect(self) -> dict[str, Exchange]:
        sources = list(dict.fromkeys(c.source for c in self.system.connections))
        sources.sort(key=lambda s: list(self.components).index(s.component))
        self.output_names = tuple(str(s) for s in sources)
        self._values = np.zeros(len(sources) + len(self.system.wires))
        self.y = self._values[: len(sources)]
        place = {source: i for i, source in enumerate(sources)}
        self.wires = Wires(self.system, self.schedule, self.clock.step_size, place, self._values)
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
                np.array([place[c.source] for c in feeding], dtype=np.int64),
            )
            if arriving := self.wires.delivered:
                exchanges[name].delivered = np.array(
                    [arriving.get(c.target, place[c.source]) for c in feeding], dtype=np.int64
                )
        return exchanges

    def _turns(self) -> list[list[Turn]]:
        """Groups of the schedule, each after the bank of connections that lead into it where there is one."""
        turns: list[list[Turn]] = []
        for group, bank in zip(self.schedule.groups, self.wires.banks, strict=True):
            if bank is not None:
                turns.append([bank])
            turns.append([self.exchanges[name] for name in group])
        return turns

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
            self.wires.settle(first=True)
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
                    self.wires.settle(first=True)
                    self.exchange_inputs(name)
                    self.exchanges[name].outputs.read()
            if np.allclose(before, self.y, rtol=0, atol=1e-14):
                break
        for name, component in self.components.items():
            self.wires.settle(first=True)
            self.exchange_inputs(name)
            component.exit_initialization_mode()
        before = self.y.copy()
        for name, exchange in self.exchanges.items():
            exchange.outputs.read()
            if text := _jump(self.output_names[exchange.window], before[exchange.window], self.y[exchange.window]):
                self.late_starts[name] = text

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
        """Send a component the newest outputs of its partners; over a connection of `wires`, what arrived last."""
        exchange = self.exchanges[name]
        if len(exchange.sources):
            np.take(self._values, exchange.delivered, out=exchange.inputs.values, mode="clip")
            exchange.inputs.write()

    def arriving(self, name: str) -> NDArray[np.float64]:
        """What a component's connected inputs are given, shape (number of inputs,)."""
        arriving: NDArray[np.float64] = self._values[self.exchanges[name].delivered]
        return arriving

    def renew(self, name: str) -> None:
        """Send a component the newest outputs of its partners as if they had long been so, and read its own."""
        self.wires.settle()
        self.exchange_inputs(name)
        self.exchanges[name].outputs.read()

    def exchange(self) -> None:
        """Send every component the newest outputs of its partners, all at once or as the schedule has it."""
        for source, target in self._single:
            source.read()
            target.write()
        if not self._single:
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
        if self.wires:
            for index, part in self.wires.stretches(self.index, count):
                self._advance(index, part)
        else:
            self._advance(self.index, count)

    def _advance(self, index: int, count: int) -> None:
        try:
            self._loop.advance(index, count, self.clock.step_size)
        finally:
            self.index += self._loop.completed

    # -- runs ------------------------------------------------------------------------------------

    def run(
        self,
        stop_time: float,
        events: Sequence[Event] = (),
        observers: Sequence[Observer] = (),
        keeper: Keeper = NOT_KEPT,
    ) -> StepStatistics:
        """Step until a time [s].

        An event happens at its communication point before the step that starts there, and the
        outputs of its components are read again, so that its partners see the change at once.

        Parameters
        ----------
        stop_time
            [s]
        events, observers
            What happens, and who looks on.
        keeper
            Says where an earlier run of the same system is taken up, and keeps this one's state when it is due, at
            the end, and where an interrupt ends it.

        Raises
        ------
        InputError
            If the stop time or an event is not at a communication point.
        ComponentError
            If an FMU fails; observers are ended first, so nothing recorded is lost.
        NotFiniteError
            If a coupled output is no finite number, at whatever step.
        NotTakenUpError
            If a component does not go on from its kept state.
        """
        calls.watch()  # again: a notebook hands Ctrl-C back to Python after each cell
        stop = self.clock.index(stop_time, "the stop")
        due: dict[int, list[Event]] = {}
        for event in events:
            due.setdefault(self.clock.index(event.time, "an event"), []).append(event)
        kept = keeper.latest()
        first, start, before = self.index, perf_counter(), np.array(self._loop.seconds())
        if kept is not None:
            start, before = start - kept.seconds, before - kept.spent
        self._whole, self._applied = False, -1

        def state(components: Mapping[str, bytes] | None = None) -> RunState:
            spent = np.array(self._loop.seconds()) - before
            return self._state(observers, components, perf_counter() - start, spent)

        begun: list[Observer] = []
        try:
            self._begin(observers, begun, stop, kept)
            for _ in self._steps(stop, due, first, observers):
                if keeper.is_due():
                    keeper.keep(state)
            keeper.finish(lambda: state({}))
        except KeyboardInterrupt:
            if self._whole:
                keeper.keep(state)
            raise
        except ComponentError as error:
            if error.time is None:
                raise ComponentError(error.component, error.call, error.status, error.log, self.time) from error
            raise
        finally:
            for observer in begun:
                observer.end(self)
        return self._statistics(self.index - first, perf_counter() - start, before.tolist())

    def _begin(self, observers: Sequence[Observer], begun: list[Observer], stop: int, kept: RunState | None) -> None:
        """Have observers look at the beginning, or go on from where a run was kept.

        Parameters
        ----------
        observers, begun
            All of them; each that has begun is noted.
        stop
            Communication point at which the run ends.
        kept
            State to go on from.
        """
        if kept is not None:
            resume_observers(observers, kept)
        for observer in observers:
            observer.begin(self, stop)
            begun.append(observer)
            if kept is None:
                observer.observe(self)
        if kept is not None:
            self._take_up(kept)
        self._require_finite(self.components)

    def _steps(
        self, stop: int, due: Mapping[int, Sequence[Event]], first: int, observers: Iterable[Observer]
    ) -> Iterator[None]:
        """Step from event to event; each time that it yields, the run is whole.

        Parameters
        ----------
        stop
            Communication point at which the run ends.
        due
            Events by their communication point.
        first, observers
            See `_run_to`.
        """
        for target in sorted({stop, *(i for i in due if self.index <= i < stop)}):
            yield from self._run_to(target, first, observers)
            if target < stop and target != self._applied:
                self._whole = False
                with calls:
                    self._apply(due[target])
                    self._whole, self._applied = True, target

    def _run_to(self, target: int, first: int, observers: Iterable[Observer]) -> Iterator[None]:
        """Step to a communication point, stopping only where an observer looks; an interrupt waits until all have."""
        while self.index < target:
            self._whole = False
            with calls:
                done = self.index - first
                self.advance(
                    min([target - self.index, _LONGEST_STRETCH, *(o.every - done % o.every for o in observers)])
                )
                done = self.index - first
                for observer in observers:
                    if done % observer.every == 0:
                        observer.observe(self)
                self._whole = True
            yield

    def _state(
        self,
        observers: Iterable[Observer],
        components: Mapping[str, bytes] | None,
        seconds: float,
        spent: NDArray[np.float64],
    ) -> RunState:
        """All that another process needs to go on from here.

        Parameters
        ----------
        observers
            Those that can go on in another process are asked for their position.
        components
            Serialised state of each FMU; by default they are asked for it.
        seconds, spent
            See `RunState`.
        """
        if components is None:
            components = {name: state_as_bytes(component) for name, component in self.components.items()}
        return RunState(
            index=self.index,
            applied=self._applied == self.index,
            handed_over=self._handed_over,
            seconds=seconds,
            spent=spent,
            y=self.y.copy(),
            tracks=self.tracks.saved(),
            before=np.empty(0) if self._loop.before is None else self._loop.before.copy(),
            components=components,
            observers=[observer.position() for observer in observers if isinstance(observer, Resumable)],
            wires=self.wires.state(),
        )

    def _take_up(self, kept: RunState) -> None:
        """Go to where another run of the same system was."""
        for name, content in kept.components.items():
            try:
                set_state(self.components[name], content)
            except ComponentError as error:
                raise NotTakenUpError(name, str(error)) from error
        self.index, self._handed_over = kept.index, kept.handed_over
        self._applied = kept.index if kept.applied else -1
        if kept.components and not kept.handed_over:  # then inputs are newer than outputs
            self._compare_outputs(kept)
        self.y[:] = kept.y
        self.wires.restore(kept.wires)
        self.tracks.restore(kept.tracks)
        self._loop.before = kept.before if len(kept.before) else None

    def _compare_outputs(self, kept: RunState) -> None:
        """A component that was brought back must give the outputs that it gave before, to the last bit."""
        for name, exchange in self.exchanges.items():
            was = kept.y[exchange.window]
            now = exchange.outputs.read()
            for variable, a, b in zip(exchange.outputs.names, was.tolist(), now.tolist(), strict=True):
                if a != b:
                    raise NotTakenUpError(name, f"{variable} was {a!r} and is {b!r}")

    def _apply(self, events: Sequence[Event]) -> None:
        for event in events:
            match event:
                case WireFault():
                    self.wires.begin(event.connection.target, event.imperfection)
                case WireRecovery():
                    self.wires.end(event.connection.target, type(event.imperfection))
                case NotANumber():
                    self.exchanges[event.component].outputs.values[:] = np.nan
                    self._require_finite([event.component])
                case Silence():
                    silence(self.components[event.component])
                case _:
                    self._set(event)

    def _set(self, event: Event) -> None:
        changes = event.changes()
        for name, settings in changes.items():
            self.components[name].set(settings)
        for name in changes:
            self.components[name].read(self.exchanges[name].outputs)
        self._require_finite(changes)

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
        if self.wires:  # the banks' own share is none of a component
            banks = [isinstance(turn, WireBank) for group in self._turns() for turn in group]
            spent = [seconds for seconds, of_bank in zip(spent, banks, strict=True) if not of_bank]
        return StepStatistics(
            steps,
            seconds,
            tuple(ComponentStatistics(n, steps, s, s / seconds) for n, s in zip(names, spent, strict=True)),
        )


def _jump(names: Sequence[str], before: Numbers, after: Numbers) -> str:
    """Which of a component's outputs changed most as its initialisation ended; "" where all stayed."""
    apart = np.abs(after - before) / np.maximum(1.0, np.maximum(np.abs(before), np.abs(after)))
    if not apart.size or not apart.max() > _JUMP:
        return ""
    k = int(apart.argmax())
    return (
        f"{names[k]} is {before[k]:.4g} before the end of initialisation and {after[k]:.4g} just after it, at the same "
        "inputs"
    )

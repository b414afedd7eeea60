"""One run of a master: from event to event, with its observers, kept on the way and taken up again."""

import os
import signal
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isfinite
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import ComponentError, InputError, NotFiniteError, NotTakenUpError
from orchestrator.core.interrupts import calls
from orchestrator.devices.fmi.bound_component import BoundComponent
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.converted_component import ConvertedComponent
from orchestrator.devices.fmi.isolated_component import IsolatedComponent
from orchestrator.systems.coupling.bus_relays import Relays
from orchestrator.systems.coupling.events import Event, NotANumber, Silence, WireFault, WireRecovery
from orchestrator.systems.coupling.kept_form import check_form, of_this_run
from orchestrator.systems.coupling.observers import Observer
from orchestrator.systems.coupling.run_state import (
    Keeper,
    Resumable,
    RunState,
    resume_observers,
    set_state,
    state_as_bytes,
)
from orchestrator.systems.coupling.statistics import StepStatistics
from orchestrator.systems.coupling.stepping import Stepper


def silence(component: Component) -> None:
    """Stop the processes of an isolated component, so that the limit on its answers ends it as it ends a hang."""
    while isinstance(component, BoundComponent | ConvertedComponent):
        component = component.inner
    if not isinstance(component, IsolatedComponent):
        raise InputError(
            f"component {component.name!r} runs in this process, where nothing limits how long it takes to answer; "
            "give it 'isolated = true' to try a time-out"
        )
    if sys.platform == "win32":
        raise InputError(
            "a time-out cannot be tried on Windows, which stops no process; try it on Linux or macOS"
        )
    os.killpg(component.process_group, signal.SIGSTOP)


# communication steps done at a stretch, so that an interrupt from the keyboard is heard
_LONGEST_STRETCH = 1000


class Run:
    def __init__(self, stepper: Stepper, observers: Sequence[Observer], keeper: Keeper) -> None:
        self._stepper, self._observers, self._keeper = stepper, observers, keeper
        self._relays = [one for one in observers if isinstance(one, Relays)]
        self._whole = False  # whether every observer has looked at this communication point
        self._applied = -1  # the last communication point whose events have happened

    def until(self, stop: int, due: Mapping[int, Sequence[Event]]) -> StepStatistics:
        stepper, keeper = self._stepper, self._keeper
        kept = keeper.latest()
        first, start, before = stepper.index, perf_counter(), np.array(stepper.seconds())
        if kept is not None:
            check_form(stepper, kept, stop)
            start, before = start - kept.seconds, before - kept.spent

        def state(components: Mapping[str, bytes] | None = None) -> RunState:
            spent = np.array(stepper.seconds()) - before
            applied = self._applied == stepper.index
            return state_of(
                stepper, self._observers, components, applied, perf_counter() - start, spent
            )

        begun: list[Observer] = []
        try:
            self._begin(begun, stop, kept)
            for _ in self._steps(stop, due, first):
                if keeper.is_due():
                    keeper.keep(state)
            keeper.finish(lambda: state({}))
        except KeyboardInterrupt:
            if self._whole:
                keeper.keep(state)
            raise
        except ComponentError as error:
            if error.time is None:
                raise ComponentError(
                    error.component, error.call, error.status, error.log, stepper.time
                ) from error
            raise
        finally:
            for observer in begun:
                observer.end(stepper)
        return stepper.statistics(stepper.index - first, perf_counter() - start, before.tolist())

    def _begin(self, begun: list[Observer], stop: int, kept: RunState | None) -> None:
        if kept is not None:
            resume_observers(self._observers, kept)
        for observer in self._observers:
            with of_this_run(kept):
                observer.begin(self._stepper, stop)
            begun.append(observer)
            if kept is None:
                observer.observe(self._stepper)
        if kept is not None:
            with of_this_run(kept):
                take_up(self._stepper, kept)
            self._applied = kept.index if kept.applied else -1
        self._require_finite(self._stepper.components)

    def _steps(self, stop: int, due: Mapping[int, Sequence[Event]], first: int) -> Iterator[None]:
        """Step from event to event; each time that it yields, the run is whole.

        ``first``: communication point at which the run began."""
        for target in sorted({stop, *(i for i in due if self._stepper.index <= i < stop)}):
            yield from self._run_to(target, first)
            if target < stop and target != self._applied:
                self._whole = False
                with calls:
                    self._apply(due[target])
                    self._look_again()
                    self._whole, self._applied = True, target

    def _run_to(self, target: int, first: int) -> Iterator[None]:
        """Step to a communication point, stopping only where an observer looks; an interrupt waits until all have."""
        stepper, observers = self._stepper, self._observers
        while stepper.index < target:
            self._whole = False
            with calls:
                done = stepper.index - first
                stepper.advance(
                    min(
                        [
                            target - stepper.index,
                            _LONGEST_STRETCH,
                            *(o.every - done % o.every for o in observers),
                        ]
                    )
                )
                done = stepper.index - first
                for observer in observers:
                    if done % observer.every == 0:
                        observer.observe(stepper)
                for relays in self._relays:
                    self._apply(relays.ordered(stepper))
                self._whole = True
            yield

    def _look_again(self) -> None:
        """Let relays see what an event changed, from which their times count."""
        for relays in self._relays:
            relays.observe(self._stepper)

    def _apply(self, events: Sequence[Event]) -> None:
        for event in events:
            match event:
                case WireFault():
                    self._stepper.wires.begin(event.connection.target, event.imperfection)
                case WireRecovery():
                    self._stepper.wires.end(event.connection.target, type(event.imperfection))
                case NotANumber():
                    self._stepper.exchanges[event.component].outputs.values[:] = np.nan
                    self._require_finite([event.component])
                case Silence():
                    silence(self._stepper.components[event.component])
                case _:
                    self._set(event)

    def _set(self, event: Event) -> None:
        changes, y = event.changes(), self._stepper.y.copy()
        for name, settings in changes.items():
            self._stepper.components[name].set(settings)
        for name in changes:
            self._stepper.components[name].read(self._stepper.exchanges[name].outputs)
        self._require_finite(changes)
        self._stepper.jumped(y)

    def _require_finite(self, names: Iterable[str]) -> None:
        """Check what components gave without a step, at the start and at events; the inner loop checks the steps."""
        for name in names:
            outputs = self._stepper.exchanges[name].outputs
            for variable, value in zip(outputs.names, outputs.values.tolist(), strict=True):
                if not isfinite(value):
                    raise NotFiniteError(name, variable, value, self._stepper.time)


def state_of(
    stepper: Stepper,
    observers: Iterable[Observer],
    components: Mapping[str, bytes] | None,
    applied: bool,
    seconds: float,
    spent: NDArray[np.float64],
) -> RunState:
    """All that another process needs to go on from here."""
    if components is None:
        components = {
            name: state_as_bytes(component) for name, component in stepper.components.items()
        }
    return RunState(
        index=stepper.index,
        applied=applied,
        handed_over=stepper.handed_over,
        seconds=seconds,
        spent=spent,
        y=stepper.y.copy(),
        tracks=stepper.tracks.saved(),
        before=np.empty(0) if stepper.before is None else stepper.before.copy(),
        components=components,
        observers=[
            observer.position() for observer in observers if isinstance(observer, Resumable)
        ],
        wires=stepper.wires.state(),
    )


def take_up(stepper: Stepper, kept: RunState) -> None:
    for name, content in kept.components.items():
        try:
            set_state(stepper.components[name], content)
        except ComponentError as error:
            raise NotTakenUpError(name, str(error)) from error
    stepper.index, stepper.handed_over = kept.index, kept.handed_over
    if kept.components and not kept.handed_over:  # then inputs are newer than outputs
        _compare_outputs(stepper, kept)
    stepper.y[:] = kept.y
    stepper.wires.restore(kept.wires)
    stepper.tracks.restore(kept.tracks)
    stepper.before = kept.before if len(kept.before) else None


def _compare_outputs(stepper: Stepper, kept: RunState) -> None:
    """A component that was brought back must give the outputs that it gave before, to the last bit."""
    for name, exchange in stepper.exchanges.items():
        was = kept.y[exchange.window]
        now = exchange.outputs.read()
        for variable, a, b in zip(exchange.outputs.names, was.tolist(), now.tolist(), strict=True):
            if a != b:
                raise NotTakenUpError(name, f"{variable} was {a!r} and is {b!r}")

"""FMUs brought to life, connected, and initialised together."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.removal import remove_tree
from orchestrator.core.arrays import Numbers
from orchestrator.core.closing import Closing
from orchestrator.core.errors import ComponentError, InputError
from orchestrator.devices.fmi.archive import extract
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.devices.fmi.instance import is_ours, open_component
from orchestrator.devices.fmi.unpacked import unpacked
from orchestrator.systems.coupling.clock import Clock
from orchestrator.systems.coupling.compiled_loop import apart
from orchestrator.systems.coupling.connections import Endpoint
from orchestrator.systems.coupling.imperfect_wires import Wires
from orchestrator.systems.coupling.schedule import Schedule
from orchestrator.systems.coupling.system import ComponentPlan, System
from orchestrator.systems.coupling.turns import Exchange

_Item = TypeVar("_Item")

_INITIAL_PASSES = 20
# of 1 or of an output: by how much it may change as initialisation ends, with the inputs as they
# were
_JUMP = 1e-6
# relative difference of a parameter from what was set, as of an FMU that computes in single
# precision
_SAME = 1e-6


@dataclass(frozen=True)
class LateStart:
    """An output that is another just after initialisation than just before its end; ``text`` has both values."""

    variable: str
    text: str


def open_plan(name: str, plan: ComponentPlan, directory: Path) -> Component:
    return open_component(name, plan.description, directory, isolated=plan.isolated)


class CoupledComponents(Closing):
    """Components at their common start; a context manager that releases every FMU.

    ``y``: All coupled outputs, shape (n,), as last exchanged; their names are ``output_names``.
    ``wires``: The connections that do more than carry a value.
    ``remembered``: Linear models of components by all that they follow from; None where none is kept."""

    remembered: dict[Any, Any] | None = None

    def __init__(
        self,
        system: System,
        schedule: Schedule,
        step_size: float,
        stop_time: float | None,
        opener: Callable[[str, ComponentPlan, Path], Component],
    ) -> None:
        open_inputs = [str(endpoint) for endpoint in system.unconnected_inputs()]
        if open_inputs:
            raise InputError(
                f"inputs that nothing feeds: {', '.join(open_inputs)}; connect them or give them a constant value"
            )
        schedule.check(set(system.components))
        self.system, self.schedule, self.clock = system, schedule, Clock(step_size)
        self.components: dict[str, Component] = {}
        self.late_starts: dict[str, LateStart] = {}
        self._release, self._stop_time = ExitStack(), stop_time
        try:
            self._instantiate(stop_time, opener)
            self.exchanges = self._connect()
            self._initialise()
        except BaseException:
            self.close()
            raise

    def _instantiate(
        self, stop_time: float | None, opener: Callable[[str, ComponentPlan, Path], Component]
    ) -> None:
        folders: dict[Path, Path] = {}
        for name, plan in self.system.components.items():
            path = plan.description.path
            if path not in folders:
                folders[path] = self._unpacked(path)
            component = opener(name, plan, folders[path])
            self._release.enter_context(component)
            self.components[name] = component
            _begin(component, plan, stop_time)

    def _unpacked(self, path: Path) -> Path:
        """The folder of an FMU's files, until the release."""
        if is_ours(path):
            return self._release.enter_context(unpacked(path))
        folder = extract(path)
        self._release.callback(remove_tree, folder)
        return folder

    def restart(self, system: System) -> None:
        """Bring the same FMUs to another common start, as if they were new."""
        self.system, self.late_starts = system, {}
        for name, plan in system.components.items():
            component = self.components[name]
            component.reset()
            _begin(component, plan, self._stop_time)
        self._values[:] = 0.0
        self._initialise()

    def _connect(self) -> dict[str, Exchange]:
        position = {name: k for k, name in enumerate(self.components)}
        sources = list(dict.fromkeys(c.source for c in self.system.connections))
        sources.sort(key=lambda s: position[s.component])
        self.output_names = tuple(str(s) for s in sources)
        self._values = np.zeros(len(sources) + len(self.system.wires))
        self.y = self._values[: len(sources)]
        place = {source: i for i, source in enumerate(sources)}
        self.wires = Wires(self.system, self.schedule, self.clock.step_size, place, self._values)
        owned = _grouped(enumerate(sources), lambda numbered: numbered[1].component)
        fed = _grouped(self.system.connections, lambda c: c.target.component)
        exchanges = {}
        for name, component in self.components.items():
            own, feeding = [i for i, _ in owned.get(name, ())], fed.get(name, [])
            inputs = [c.target.variable for c in feeding]
            outputs = [sources[i].variable for i in own]
            window = slice(own[0], own[-1] + 1) if own else slice(0)
            exchanges[name] = Exchange(
                component,
                RealBatch(component, inputs, apart(len(inputs))),
                RealBatch(component, outputs, self.y[window]),
                window,
                np.array([place[c.source] for c in feeding], dtype=np.int64),
            )
            arriving = self.wires.delivered
            if arriving:
                exchanges[name].delivered = np.array(
                    [arriving.get(c.target, place[c.source]) for c in feeding], dtype=np.int64
                )
        return exchanges

    def _initialise(self) -> None:
        """Bring all FMUs through initialisation, with the first inputs that the schedule gives them."""
        for name, component in self.components.items():
            component.enter_initialization_mode()
            _check_taken(name, component, self.system.components[name])
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
            late = _jump(
                self.output_names[exchange.window], before[exchange.window], self.y[exchange.window]
            )
            if late:
                self.late_starts[name] = late

    def _take_start_values(self) -> None:
        """Let every output be what the inputs that it feeds start from."""
        starts: dict[Endpoint, tuple[float, Endpoint]] = {}
        for wire in self.system.connections:
            info = self.system.components[wire.target.component].description.variables[
                wire.target.variable
            ]
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

    def exchange_inputs(self, name: str) -> None:
        """Send a component the newest outputs of its partners; over a connection of `wires`, what arrived last."""
        exchange = self.exchanges[name]
        if len(exchange.sources):
            np.take(self._values, exchange.delivered, out=exchange.inputs.values, mode="clip")
            exchange.inputs.write()

    def arriving(self, name: str) -> NDArray[np.float64]:
        """Return what a component's connected inputs are given, shape (number of inputs,)."""
        arriving: NDArray[np.float64] = self._values[self.exchanges[name].delivered]
        return arriving

    def renew(self, name: str) -> None:
        """Send a component the newest outputs of its partners as if they had long been so, and read its own."""
        self.wires.settle()
        self.exchange_inputs(name)
        self.exchanges[name].outputs.read()


def _grouped(
    items: Iterable[_Item], component_of: Callable[[_Item], str]
) -> dict[str, list[_Item]]:
    """The items of each component, in their order."""
    groups: dict[str, list[_Item]] = {}
    for item in items:
        groups.setdefault(component_of(item), []).append(item)
    return groups


def _begin(component: Component, plan: ComponentPlan, stop_time: float | None) -> None:
    """Set a new component up; some FMUs forget the parameters that they were given before that."""
    component.setup(0.0, stop_time)
    component.set(plan.parameters)


def refusal_to_start(name: str, plan: ComponentPlan) -> ComponentError | None:
    """Return the error with which a component of ours refuses to start by itself; None where it starts."""
    with Trials(name, plan) as trials:
        return trials.refusal({})


class Trials(Closing):
    """Starts of a component of ours by itself, one after the other: to open an instance takes longer than a start."""

    def __init__(self, name: str, plan: ComponentPlan) -> None:
        self._name, self._plan, self._release = name, plan, ExitStack()
        self._component: Component | None = None

    def refusal(self, parameters: Mapping[str, float]) -> ComponentError | None:
        """Return the error with which it refuses to start with other values of parameters; None where it starts."""
        plan = replace(self._plan, parameters={**self._plan.parameters, **parameters})
        component = self._renewed()
        try:
            _begin(component, plan, None)
            component.enter_initialization_mode()
            component.set(plan.inputs)
            component.exit_initialization_mode()
        except ComponentError as error:
            return error
        return None

    def _renewed(self) -> Component:
        """The instance as if it were new, or a new one where it cannot be reset any more."""
        if self._component is not None:
            try:
                self._component.reset()
                return self._component
            except ComponentError:
                self._release.close()
        folder = self._release.enter_context(unpacked(self._plan.description.path))
        self._component = self._release.enter_context(open_plan(self._name, self._plan, folder))
        return self._component

    def close(self) -> None:
        self._release.close()


def _check_taken(name: str, component: Component, plan: ComponentPlan) -> None:
    try:
        values = component.values(plan.parameters)
    except ComponentError:
        return  # what cannot be read cannot be judged
    for parameter, given in plan.parameters.items():
        if not math.isclose(values[parameter], given, rel_tol=_SAME):
            raise ComponentError(
                name,
                "fmi2SetReal",
                "OK",
                f"the parameter {parameter} was set to {given:g} and reads {values[parameter]:g}, so the FMU did not "
                "take it; leave it out of the case, or have its author export the FMU with that value",
            )


def _jump(names: Sequence[str], before: Numbers, after: Numbers) -> LateStart | None:
    """Which of a component's outputs changed most as its initialisation ended; None where all stayed."""
    apart = np.abs(after - before) / np.maximum(1.0, np.maximum(np.abs(before), np.abs(after)))
    if not apart.size or not apart.max() > _JUMP:
        return None
    k = int(apart.argmax())
    text = (
        f"{names[k]} is {before[k]:.4g} before the end of initialisation and {after[k]:.4g} just after it, at the same "
        "inputs"
    )
    return LateStart(names[k].partition(".")[2], text)

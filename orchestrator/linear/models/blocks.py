"""Linearised components of a running system, with what connects them."""

import copy
import difflib
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.core.spelling import for_python
from orchestrator.linear.models.component_linearization import (
    ComponentLinearization,
    linearize_alike,
    linearize_by_derivatives,
    linearize_component,
)
from orchestrator.linear.models.delays import WireLink, links_of
from orchestrator.linear.models.held_inputs import LineMap, over_parts
from orchestrator.linear.models.linear_model import Indices
from orchestrator.linear.models.remembered import remembered
from orchestrator.linear.models.sampled import repeating, steps_of_period
from orchestrator.systems.coupling.connections import Endpoint
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import Schedule
from orchestrator.systems.coupling.step_awareness import knows_step, other_step

MANY_INPUTS = 1_000
"""Of a component with so many inputs those that nothing moves are not perturbed: the devices' admittances, half of the
inputs of a large phasor network."""


class Blocks:
    """Linearised components with their wiring.

    ``master``: A running system at its operating point. It is left as it was.
    ``step_size``: Communication step to linearise over [s]; by default the master's own. Components that know the step
    are given this one meanwhile.
    ``inputs``, ``outputs``: Names ``component.variable`` of the inputs and outputs of `state_space`: tunable parameters
    or open inputs, and any outputs.
    ``derivatives``: Difference the FMUs' own derivatives as well, which `continuous_model` needs. This is not done if a
    component knows the step, because blocks for a step map cannot serve a continuous model then.
    ``without_step``: For `continuous`: components that know the step are given 0 meanwhile.
    ``directional``: Take the FMUs' own directional derivatives instead of perturbing them.
    ``known``: Components whose linear model is known already, such as an identified one; they are not perturbed.
    ``once``: Perturb with one size alone, for a search whose result is verified; see `perturb`.
    ``schedule``: That the step maps will be composed for; the master's by default. Where its inputs follow straight
    lines, components are linearised over a part of the step, and not told the step.

    ``period``: Communication steps after which the system repeats; 1 where each step is like every other.
    ``declared``: By component and output: the inputs that its FMU says it depends on directly."""

    def __init__(
        self,
        master: Master,
        step_size: float | None = None,
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = (),
        *,
        derivatives: bool = False,
        without_step: bool = False,
        directional: bool = False,
        known: Mapping[str, ComponentLinearization] | None = None,
        schedule: Schedule | None = None,
        once: bool = False,
    ) -> None:
        known = known or {}
        schedule = schedule or master.schedule
        self._step_aware = [name for name in master.components if knows_step(master, name)]
        self._without_step, self.directional, self._once = without_step, directional, once
        self._untold = without_step or schedule.is_second_order
        self._derivatives = without_step or (derivatives and (self._untold or not self._step_aware))
        self.step_size = step_size or master.clock.step_size
        self.parts = schedule.parts(self.step_size)
        if known and self.parts > 1:
            raise AnalysisError(
                f"components {', '.join(known)} are known over a whole step of {self.step_size:g} s, which schedule "
                f"{schedule.name!r} does in {self.parts} parts; take gauss-seidel or jacobi"
            )
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        self._driven, self._observed = (
            _by_component(master, self.inputs),
            _by_component(master, self.outputs),
        )
        _check_driven(master, self._driven)
        self.period = steps_of_period(master, self.step_size, known)
        self.sampled = tuple(name for name in repeating(master) if name not in set(known))
        self.components = self._linearized(master, known)
        # External inputs follow the coupled outputs, as if a further component gave them.
        first_external = len(master.output_names)
        self.sources = {
            name: np.concatenate(
                [
                    exchange.sources,
                    [first_external + self.inputs.index(f"{name}.{v}") for v in self._driven[name]],
                ]
            ).astype(np.int64)
            for name, exchange in master.exchanges.items()
        }
        self.declared = {
            name: {
                output: master.components[name].description.feedthrough(output)
                for output in e.outputs.names
            }
            for name, e in master.exchanges.items()
        }
        self.schedule = master.schedule
        self.output_names = master.output_names
        self.links: dict[Endpoint, WireLink] = links_of(master)
        first = 0
        self.window: dict[str, slice] = {}
        for name, exchange in master.exchanges.items():
            self.window[name] = slice(first, first + len(exchange.outputs.names))
            first += len(exchange.outputs.names)

    def _linearized(
        self, master: Master, known: Mapping[str, ComponentLinearization]
    ) -> dict[str, ComponentLinearization]:
        """All components, those with most inputs last: by then it is known which of their inputs nothing moves."""
        self._idle: dict[str, frozenset[str]] = {}
        found = self._linearized_alike(master, known)
        for name in sorted(master.exchanges, key=lambda name: _has_many_inputs(master, name)):
            if name not in found:
                found[name] = known.get(name) or self._linearize_beside(master, name, found)
        return {name: found[name] for name in master.exchanges}

    def _linearized_alike(
        self, master: Master, known: Collection[str]
    ) -> dict[str, ComponentLinearization]:
        """Components that are perturbed together with others alike; none where each is remembered by its state."""
        step_size = self.step_size / self.parts
        if self.directional or self._once or master.remembered is not None:
            return {}
        told = 0.0 if self._untold else step_size
        together = [
            exchange
            for name, exchange in master.exchanges.items()
            if not (name in known or self._driven[name] or self._observed[name])
            and not _has_many_inputs(master, name)
            and (told == master.clock.step_size or not knows_step(master, name))
        ]
        alike = linearize_alike(together, master.time, step_size, derivatives=self._derivatives)
        found = {one.name: one for one in alike}
        self._idle |= dict.fromkeys(found, frozenset())
        return found

    def _linearize_beside(
        self, master: Master, name: str, others: Mapping[str, ComponentLinearization]
    ) -> ComponentLinearization:
        """One component, without the inputs that nothing moves where others are as they are."""
        self._idle[name] = (
            _idle_inputs(master, name, others) if _has_many_inputs(master, name) else frozenset()
        )
        return linearize_within(
            master,
            name,
            self.step_size / self.parts,
            self._driven[name],
            self._observed[name],
            derivatives=self._derivatives,
            without_step=self._untold,
            directional=self.directional,
            idle=self._idle[name],
            once=self._once,
        )

    def _anew(self, master: Master, names: Iterable[str]) -> dict[str, ComponentLinearization]:
        """All components, some of them linearised again, and with them those whose idle inputs move now."""
        found = dict(self.components)
        for name in sorted(names, key=lambda name: _has_many_inputs(master, name)):
            found[name] = self._linearize_beside(master, name, found)
        for name, idle in list(self._idle.items()):
            if idle and not idle <= _idle_inputs(master, name, found):
                found[name] = self._linearize_beside(master, name, found)
        return found

    def renew(self, master: Master, names: Iterable[str]) -> None:
        self.components = self._anew(master, names)

    def with_component(self, master: Master, name: str) -> "Blocks":
        """The same blocks, with one component linearised as it is now: beside a parameter that was changed."""
        other = copy.copy(self)
        other._idle = dict(self._idle)
        other.components = other._anew(master, [name])
        return other

    def connected_alone(self) -> "Blocks":
        """The same blocks without ``inputs`` and ``outputs``."""
        other = copy.copy(self)
        other.inputs, other.outputs = (), ()
        other.components = dict(self.components)
        other.sources = dict(self.sources)
        for name in {full.partition(".")[0] for full in (*self.inputs, *self.outputs)}:
            component = self.components[name]
            count = len(component.inputs) - len(self._driven[name])
            other.components[name] = component.connected_alone(count)
            other.sources[name] = self.sources[name][:count]
        other._idle = dict(self._idle)
        other._driven = {name: [] for name in self.components}
        other._observed = {name: [] for name in self.components}
        return other

    def check_made_for(self, schedule: Schedule | None) -> None:
        """Refuse blocks whose components were given another communication step than a schedule's; None: no step."""
        told = schedule is not None and not schedule.is_second_order
        if self._step_aware and told == self._untold:
            raise ValueError(
                f"components {', '.join(self._step_aware)} know the communication step; linearise them with "
                f"without_step={not told} for a {'step map' if told else 'continuous model'}"
            )
        if (
            schedule is not None
            and schedule.is_second_order
            and schedule.parts(self.step_size) != self.parts
        ):
            raise ValueError(
                f"components were linearised for {self.parts} parts of a step, and schedule {schedule.name!r} has "
                f"{schedule.parts(self.step_size)}"
            )

    def over_step(self, name: str) -> LineMap:
        """The map of a component over the whole step, with inputs that follow straight lines."""
        c = self.components[name]
        return (
            LineMap(c.A, c.B, np.zeros_like(c.B))
            if self.parts == 1
            else over_parts(c.A, c.B, self.parts)
        )

    @property
    def serves_continuous(self) -> bool:
        return self._without_step or not self._step_aware

    @property
    def how(self) -> dict[str, str]:
        return {name: c.source for name, c in self.components.items()}

    @property
    def disagreement(self) -> float:
        return max(c.disagreement for c in self.components.values())

    def linked(self, name: str) -> dict[int, int]:
        """Inputs of a component that a connection of `links` feeds: their place among its inputs, and the link's."""
        inputs, targets = self.components[name].inputs, list(self.links)
        return {inputs.index(t.variable): targets.index(t) for t in targets if t.component == name}

    def entries(self, name: str, newest: Indices, arriving: Indices) -> Indices:
        """Where the values that reach a component's inputs stand in w."""
        found: Indices = newest[self.sources[name]].copy()
        for place, link in self.linked(name).items():
            found[place] = arriving[link]
        return found

    def state_names(self) -> list[str]:
        return [f"{name}.{state}" for name, c in self.components.items() for state in c.states]

    def state_windows(self) -> dict[str, slice]:
        windows, first = {}, 0
        for name, c in self.components.items():
            windows[name] = slice(first, first + len(c.states))
            first += len(c.states)
        return windows


def linearize_within(
    master: Master,
    name: str,
    step_size: float,
    inputs: Sequence[str] = (),
    observed: Sequence[str] = (),
    *,
    derivatives: bool = False,
    without_step: bool = False,
    directional: bool = False,
    idle: Collection[str] = (),
    once: bool = False,
) -> ComponentLinearization:
    """Linearise one component of a running system, which is given the step [s] meanwhile if it knows the step."""
    exchange, time = master.exchanges[name], master.time

    def linearized() -> ComponentLinearization:
        if directional:
            return linearize_by_derivatives(exchange, time, step_size, inputs, observed)
        return linearize_component(
            exchange,
            time,
            step_size,
            inputs,
            observed,
            derivatives=derivatives,
            idle=idle,
            once=once,
        )

    with other_step(master, name, 0.0 if without_step else step_size):
        asked = (step_size, *inputs, "", *observed, derivatives, directional, *sorted(idle), once)
        return remembered(master, name, asked, linearized)


def _has_many_inputs(master: Master, name: str) -> bool:
    return len(master.exchanges[name].inputs.names) >= MANY_INPUTS


def _idle_inputs(
    master: Master, name: str, found: Mapping[str, ComponentLinearization]
) -> frozenset[str]:
    """Inputs of a component whose sources answer nothing at all, to the last bit."""
    feeds = {str(c.target): c.source for c in master.system.connections}
    still = {
        f"{source}.{output}"
        for source, c in found.items()
        for output, C, D in zip(c.outputs, c.C, c.D, strict=True)
        if not (C.any() or D.any())
    }
    inputs = master.exchanges[name].inputs.names
    return frozenset(
        variable for variable in inputs if str(feeds.get(f"{name}.{variable}")) in still
    )


def _by_component(master: Master, names: Sequence[str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {name: [] for name in master.components}
    for full in names:
        component, _, variable = full.partition(".")
        if (
            component not in found
            or variable not in master.components[component].description.variables
        ):
            known = [
                f"{name}.{own}"
                for name, one in master.components.items()
                for own in one.description.variables
            ]
            near = difflib.get_close_matches(full, known, 3)
            where = (
                "scenario.parameters() and run.dataset list names"
                if for_python()
                else "`gfor fmu info` lists the variables of an FMU"
            )
            hint = f"did you mean {' or '.join(near)}?" if near else where
            raise InputError(f"linear model: there is no variable {full!r}; {hint}")
        found[component].append(variable)
    return found


def _check_driven(master: Master, driven: Mapping[str, Sequence[str]]) -> None:
    """Refuse an input that cannot be changed during a run, or that a connection feeds."""
    fed = {str(c.target): str(c.source) for c in master.system.connections}
    for name, variables in driven.items():
        for variable in variables:
            info = master.components[name].description.variables[variable]
            if f"{name}.{variable}" in fed:
                raise InputError(
                    f"linear model: {name}.{variable} is fed by {fed[f'{name}.{variable}']}"
                )
            if info.type != "Real" or not (
                info.causality == "input" or info.variability == "tunable"
            ):
                raise InputError(
                    f"linear model: {name}.{variable} is a {info.variability} {info.causality} of type {info.type}; "
                    "an input must be a Real tunable parameter or an open Real input"
                )

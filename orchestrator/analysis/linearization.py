"""The linear step map of a coupled system, composed from its components along the schedule.

The coupled state z holds the states of all components and, where the schedule makes an output
travel one step late, that output as well: an output with direct feed-through from an input that is
older than itself is memory that the exchange adds. So is what is on its way over a connection with a delay. Everything
else follows from the states.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from orchestrator.analysis.component_linearization import (
    ComponentLinearization,
    linearize_by_derivatives,
    linearize_component,
)
from orchestrator.analysis.delays import DelayLine, WireLink, continuous_line, delay_line, links_of
from orchestrator.analysis.linear_model import DELAYED, HELD, LinearModel
from orchestrator.arrays import Matrix
from orchestrator.coupling.master import Master
from orchestrator.coupling.schedule import Schedule
from orchestrator.coupling.step_awareness import knows_step, other_step
from orchestrator.coupling.system import Endpoint
from orchestrator.errors import AnalysisError, InputError

Indices = NDArray[np.int64]


class Blocks:
    """Linearised components with their wiring.

    Parameters
    ----------
    master
        A running system at its operating point. It is left as it was.
    step_size
        Communication step to linearise over [s]; by default the master's own. Components that know the step are
        given this one meanwhile.
    inputs, outputs
        Names ``component.variable`` of the inputs and outputs of `state_space`: tunable parameters or open inputs, and
        any outputs.
    derivatives
        Difference the FMUs' own derivatives as well, which `continuous_model` needs. This is not done if a component
        knows the step, because blocks for a step map cannot serve a continuous model then.
    without_step
        For `continuous`: components that know the step are given 0 meanwhile.
    directional
        Take the FMUs' own directional derivatives instead of perturbing them.
    known
        Components whose linear model is known already, such as an identified one; they are not perturbed.

    Raises
    ------
    InputError
        If there is no such variable, or an input cannot be perturbed.
    """

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
    ) -> None:
        known = known or {}
        self._step_aware = [name for name in master.components if knows_step(master, name)]
        self._without_step, self._directional = without_step, directional
        self._derivatives = without_step or (derivatives and not self._step_aware)
        self.step_size = step_size or master.clock.step_size
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        self._driven, self._observed = _by_component(master, self.inputs), _by_component(master, self.outputs)
        _check_driven(master, self._driven)
        self.components = {name: known.get(name) or self._linearize(master, name) for name in master.exchanges}
        # External inputs follow the coupled outputs, as if a further component gave them.
        first_external = len(master.output_names)
        self.sources = {
            name: np.concatenate(
                [exchange.sources, [first_external + self.inputs.index(f"{name}.{v}") for v in self._driven[name]]]
            ).astype(np.int64)
            for name, exchange in master.exchanges.items()
        }
        self.schedule = master.schedule
        self.output_names = master.output_names
        self.links: dict[Endpoint, WireLink] = links_of(master)
        first = 0
        self.window: dict[str, slice] = {}
        for name, exchange in master.exchanges.items():
            self.window[name] = slice(first, first + len(exchange.outputs.names))
            first += len(exchange.outputs.names)

    def renew(self, master: Master, names: Iterable[str]) -> None:
        """Linearise some components again, whose parameters were changed."""
        self.components.update({name: self._linearize(master, name) for name in names})

    def _linearize(self, master: Master, name: str) -> ComponentLinearization:
        return linearize_within(
            master, name, self.step_size, self._driven[name], self._observed[name],
            derivatives=self._derivatives, without_step=self._without_step, directional=self._directional,
        )  # fmt: skip

    def check_made_for(self, *, step_map: bool) -> None:
        """Refuse blocks whose components were given another communication step."""
        if self._step_aware and step_map == self._without_step:
            raise ValueError(
                f"components {', '.join(self._step_aware)} know the communication step; linearise them with "
                f"without_step={not step_map} for a {'step map' if step_map else 'continuous model'}"
            )

    @property
    def serves_continuous(self) -> bool:
        """Whether the components were linearised without a communication step."""
        return self._without_step or not self._step_aware

    @property
    def how(self) -> dict[str, str]:
        """How the linear model of every component was found."""
        return {name: c.source for name, c in self.components.items()}

    @property
    def disagreement(self) -> float:
        """The largest of all components' disagreements."""
        return max(c.disagreement for c in self.components.values())

    def linked(self, name: str) -> dict[int, int]:
        """Inputs of a component that a connection of `links` feeds: their place among its inputs, and the link's."""
        inputs, targets = self.components[name].inputs, list(self.links)
        return {inputs.index(t.variable): targets.index(t) for t in targets if t.component == name}

    def entries(self, name: str, newest: Indices, arriving: Indices) -> Indices:
        """Where the values that reach a component's inputs stand in w.

        Parameters
        ----------
        name
            Of the component.
        newest
            Where the values of all outputs and external inputs stand.
        arriving
            Where what arrives over the links stands.
        """
        found: Indices = newest[self.sources[name]].copy()
        for place, link in self.linked(name).items():
            found[place] = arriving[link]
        return found

    def state_names(self) -> list[str]:
        """Names ``component.state`` of all states, in their order."""
        return [f"{name}.{state}" for name, c in self.components.items() for state in c.states]

    def state_windows(self) -> dict[str, slice]:
        """The range of each component's states in the vector of all states."""
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
) -> ComponentLinearization:
    """Linearise one component of a running system, which is given the step [s] meanwhile if it knows the step.

    Parameters
    ----------
    master
        At the operating point; it is left as it was.
    name
        Of the component.
    step_size
        Communication step to linearise over [s].
    inputs, observed, derivatives
        As `linearize_component`.
    without_step, directional
        As `Blocks`.
    """
    exchange, time = master.exchanges[name], master.time
    with other_step(master, name, 0.0 if without_step else step_size):
        if directional:
            return linearize_by_derivatives(exchange, time, step_size, inputs, observed)
        return linearize_component(exchange, time, step_size, inputs, observed, derivatives=derivatives)


def linearize(master: Master, step_size: float | None = None, schedule: Schedule | None = None) -> LinearModel:
    """Linearise the coupled step map around the master's present state.

    Parameters
    ----------
    master
        At an operating point; it is left as it was.
    step_size, schedule
        By default the master's own; other values show the coupling's effect with another step or schedule.

    Raises
    ------
    AnalysisError
        If a component cannot be perturbed.
    """
    return compose(Blocks(master, step_size), schedule or master.schedule)


def compose(blocks: Blocks, schedule: Schedule) -> LinearModel:
    """Walk once through the schedule. Every output gets an index in w each time that it is computed.

    Raises
    ------
    AnalysisError
        If direct feed-through closes a loop.
    """
    blocks.check_made_for(step_map=True)
    windows, names = blocks.state_windows(), blocks.state_names()
    held = _held_outputs(blocks, schedule)
    memory = [i for name in held for i in range(len(blocks.output_names))[blocks.window[name]]]
    n, p = len(names), len(blocks.output_names)
    links = len(blocks.links)
    arrived, arriving = 2 * p + np.arange(links), 2 * p + links + np.arange(links)  # in the step before, and in this
    external = 2 * p + 2 * links + np.arange(len(blocks.inputs))
    lines = _delay_lines(blocks, n + len(memory), blocks.step_size)
    total = n + len(memory) + sum(len(line.A) for line, _ in lines.values())
    equations = _Equations(total, 2 * p + 2 * links + len(external))
    newest = np.concatenate([np.arange(p), external])  # where in w the newest value of every output stands
    _check_feedthrough(blocks, [name for name in blocks.components if name not in held])
    for k, (line, where) in lines.items():
        equations.output(arrived[k : k + 1], where, line.C_before, newest[:0], np.zeros((1, 0)))
    for name, c in blocks.components.items():
        if name not in held:
            entries = blocks.entries(name, newest, arrived)
            equations.output(newest[blocks.window[name]], windows[name], c.C, entries, c.D)
    for k, i in enumerate(memory):
        equations.output(newest[i : i + 1], slice(n + k, n + k + 1), np.eye(1), newest[:0], np.zeros((1, 0)))
    for group in schedule.groups:
        inputs = {name: blocks.entries(name, newest, arriving) for name in group}
        for name in group:
            for place, k in blocks.linked(name).items():
                if k in lines:
                    (line, where), sent = lines[k], newest[blocks.sources[name][place : place + 1]]
                    equations.output(arriving[k : k + 1], where, line.C, sent, np.full((1, 1), line.d))
                    equations.next_state(where, where, line.A, sent, line.B)
        for name in group:
            c, x, u = blocks.components[name], windows[name], inputs[name]
            equations.next_state(x, x, c.A, u, c.B)
            newest[blocks.window[name]] = p + np.arange(p)[blocks.window[name]]
            equations.output(newest[blocks.window[name]], x, c.C @ c.A, u, c.C @ c.B + c.D)
    for k, i in enumerate(memory):
        equations.next_state(slice(n + k, n + k + 1), slice(0, 0), np.zeros((1, 0)), newest[i : i + 1], np.eye(1))
    all_names = (*names, *(f"{blocks.output_names[i]}{HELD}" for i in memory), *_line_names(blocks, lines))
    return equations.model(blocks, all_names, blocks.step_size)


def _delay_lines(blocks: Blocks, first: int, step_size: float | None) -> dict[int, tuple[DelayLine, slice]]:
    """By the number of their link: delays, and where their states stand, from ``first`` on."""
    lines = {}
    for k, link in enumerate(blocks.links.values()):
        if not link.is_cut:
            line = continuous_line(link.delay) if step_size is None else delay_line(link.delay, step_size)
            lines[k] = line, slice(first, first + len(line.A))
            first += len(line.A)
    return lines


def _line_names(blocks: Blocks, lines: Mapping[int, tuple[DelayLine, slice]]) -> list[str]:
    links = list(blocks.links.values())
    return [f"{links[k].name}{DELAYED} {i + 1})" for k, (line, _) in lines.items() for i in range(len(line.A))]


def continuous(blocks: Blocks) -> LinearModel:
    """The same components, connected without any communication step: ẋ = A·x.

    Raises
    ------
    AnalysisError
        If a component does not give its derivatives, or direct feed-through closes a loop.
    """
    blocks.check_made_for(step_map=False)
    silent = [name for name, c in blocks.components.items() if c.A_c is None]
    if silent:
        raise AnalysisError(
            f"components {', '.join(silent)} do not give their derivatives, so no continuous model can be made"
        )
    windows, names = blocks.state_windows(), blocks.state_names()
    _check_feedthrough(blocks, list(blocks.components))
    p, links = len(blocks.output_names), len(blocks.links)
    lines = _delay_lines(blocks, len(names), None)
    newest = np.concatenate([np.arange(p), p + links + np.arange(len(blocks.inputs))])
    arriving = p + np.arange(links)
    total = len(names) + sum(len(line.A) for line, _ in lines.values())
    equations = _Equations(total, p + links + len(blocks.inputs))
    for name, c in blocks.components.items():
        entries = blocks.entries(name, newest, arriving)
        if c.A_c is not None and c.B_c is not None:
            equations.next_state(windows[name], windows[name], c.A_c, entries, c.B_c)
        equations.output(np.arange(p)[blocks.window[name]], windows[name], c.C, entries, c.D)
        for place, k in blocks.linked(name).items():
            if k in lines:
                (line, where), sent = lines[k], newest[blocks.sources[name][place : place + 1]]
                equations.output(arriving[k : k + 1], where, line.C, sent, np.zeros((1, 1)))
                equations.next_state(where, where, line.A, sent, line.B)
    return equations.model(blocks, [*names, *_line_names(blocks, lines)], None)


def continuous_model(master: Master, blocks: Blocks | None = None) -> LinearModel | None:
    """The system without a communication step; None if a component gives no derivatives.

    Parameters
    ----------
    blocks
        Blocks with derivatives, if they exist already. They are used if no component knows the step.
    """
    if blocks is None or not blocks.serves_continuous:
        return where_given(lambda: continuous(Blocks(master, without_step=True)))
    return where_given(lambda: continuous(blocks))


def where_given(make: Callable[[], LinearModel]) -> LinearModel | None:
    """A continuous model, or None where a component gives no derivatives; a verdict then rests on the step map."""
    try:
        return make()
    except AnalysisError:
        return None


def _by_component(master: Master, names: Sequence[str]) -> dict[str, list[str]]:
    """Variables of every component among names ``component.variable``."""
    found: dict[str, list[str]] = {name: [] for name in master.components}
    for full in names:
        component, _, variable = full.partition(".")
        if component not in found or variable not in master.components[component].description.variables:
            raise InputError(f"linear model: there is no variable {full!r}; `gfor info` lists the variables of an FMU")
        found[component].append(variable)
    return found


def _check_driven(master: Master, driven: Mapping[str, Sequence[str]]) -> None:
    """Refuse an input that cannot be changed during a run, or that a connection feeds."""
    fed = {str(c.target): str(c.source) for c in master.system.connections}
    for name, variables in driven.items():
        for variable in variables:
            info = master.components[name].description.variables[variable]
            if f"{name}.{variable}" in fed:
                raise InputError(f"linear model: {name}.{variable} is fed by {fed[f'{name}.{variable}']}")
            if info.type != "Real" or not (info.causality == "input" or info.variability == "tunable"):
                raise InputError(
                    f"linear model: {name}.{variable} is a {info.variability} {info.causality} of type {info.type}; "
                    "an input must be a Real tunable parameter or an open Real input"
                )


class _Equations:
    """Collects the blocks of z⁺ = F·z + G·w, w = H·z + K·w."""

    def __init__(self, n: int, m: int) -> None:
        self._shapes = {"F": (n, n), "G": (n, m), "H": (m, n), "K": (m, m)}
        self._parts: dict[str, list[tuple[Indices, Indices, Matrix]]] = {name: [] for name in self._shapes}

    def next_state(self, rows: slice, states: slice, A: Matrix, w: Indices, B: Matrix) -> None:
        """z⁺[rows] = A·z[states] + B·w."""
        n = self._shapes["F"][0]
        self._add("F", np.arange(n)[rows], np.arange(n)[states], A)
        self._add("G", np.arange(n)[rows], w, B)

    def output(self, rows: Indices, states: slice, C: Matrix, w: Indices, D: Matrix) -> None:
        """w[rows] = C·z[states] + D·w."""
        self._add("H", rows, np.arange(self._shapes["F"][0])[states], C)
        self._add("K", rows, w, D)

    def _add(self, name: str, rows: Indices, columns: Indices, block: Matrix) -> None:
        i, k = np.nonzero(block)
        self._parts[name].append((rows[i], columns[k], block[i, k]))

    def model(self, blocks: Blocks, names: Iterable[str], step_size: float | None) -> LinearModel:
        F, G, H, K = (self._matrix(name) for name in self._shapes)
        return LinearModel(F, G, H, K, tuple(names), step_size, blocks.disagreement, blocks.how)

    def _matrix(self, name: str) -> sp.csr_array:
        rows, columns, values = (np.concatenate(part) for part in zip(*self._parts[name], strict=True))
        return sp.coo_array((values, (rows, columns)), shape=self._shapes[name]).tocsr()


def _check_feedthrough(blocks: Blocks, names: list[str]) -> None:
    """No output of the named components may depend on itself within one instant."""
    waiting = list(names)
    while waiting:
        pending = {i for name in waiting for i in range(len(blocks.output_names))[blocks.window[name]]}
        ready = [name for name in waiting if not pending & _feedthrough_sources(blocks, name)]
        if not ready:
            raise AnalysisError(
                f"direct feed-through closes an algebraic loop through {', '.join(waiting)}; "
                "one of them must give an output that does not depend directly on its inputs"
            )
        waiting = [name for name in waiting if name not in ready]


def _feedthrough_sources(blocks: Blocks, name: str) -> set[int]:
    """Indices in y that a component's outputs depend on directly: not over a delay, nor over a cut connection."""
    used = np.abs(blocks.components[name].D).max(axis=0, initial=0.0) > 0
    used[list(blocks.linked(name))] = False
    return {i for i in blocks.sources[name][used].tolist() if i < len(blocks.output_names)}


def _held_outputs(blocks: Blocks, schedule: Schedule) -> list[str]:
    """Components whose outputs at the end of a step still depend on inputs from its beginning."""
    renewed: set[str] = set()
    owner = {i: name for name in blocks.components for i in range(len(blocks.output_names))[blocks.window[name]]}
    for group in schedule.groups:
        fresh = [name for name in group if all(owner[i] in renewed for i in _feedthrough_sources(blocks, name))]
        renewed.update(fresh)
    return [name for name in blocks.components if name not in renewed]

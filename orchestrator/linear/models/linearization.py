"""The linear step map of a coupled system, composed from its components along the schedule.

The coupled state z holds the states of all components and, where the schedule makes an output
travel one step late, that output as well: an output with direct feed-through from an input that is
older than itself is memory that the exchange adds. So is what is on its way over a connection with a delay. Everything
else follows from the states."""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import AnalysisError
from orchestrator.core.options import Option, command
from orchestrator.linear.models.blocks import MANY_INPUTS, Blocks, linearize_within
from orchestrator.linear.models.delays import DelayLine, continuous_line, delay_line
from orchestrator.linear.models.linear_model import DELAYED, HELD, Equations, Indices, LinearModel
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import Schedule

__all__ = [
    "Blocks",
    "compose",
    "continuous",
    "continuous_model",
    "linearize",
    "linearize_within",
    "where_given",
]


def linearize(
    master: Master, step_size: float | None = None, schedule: Schedule | None = None
) -> LinearModel:
    return compose(Blocks(master, step_size), schedule or master.schedule)


def compose(blocks: Blocks, schedule: Schedule, *, within_period: bool = False) -> LinearModel:
    """Walk once through the schedule. Every output gets an index in w each time that it is computed."""
    blocks.check_made_for(schedule)
    if blocks.period > 1 and not within_period:
        raise AnalysisError(
            f"sampled components ({', '.join(blocks.sampled)}) repeat only after "
            f"{blocks.period} communication steps of {blocks.step_size:g} s ("
            f"{blocks.period * blocks.step_size:g} s), and the linear model that is asked "
            "for is of a single step, which differs from the next; `gfor modes`, `gfor "
            "run` and `gfor sweep` take the whole period, "
            + command("modes", Option.BLACK_BOX)
            + " measures such a component through its port"
        )
    if schedule.is_second_order:
        return line_model(blocks, schedule)
    held = _held_outputs(blocks, schedule)
    check_feedthrough(blocks, [name for name in blocks.components if name not in held])
    walk = _Walk(blocks, held)
    walk.begin()
    for group in schedule.groups:
        walk.deliver(group)
        walk.step(group)
    return walk.end()


class _Walk:
    """A walk through one communication step, which writes down how every output and state follows from others.

    The vector z holds the components' states, the outputs that are memory, and what is on its way over delays. In w
    stand all outputs as of the step before, then as of this step; what has arrived over each link before this step,
    then what arrives in it; and the external inputs."""

    def __init__(self, blocks: Blocks, held: Sequence[str]) -> None:
        self._blocks, self._held = blocks, held
        self._windows, self._names = blocks.state_windows(), blocks.state_names()
        every = range(len(blocks.output_names))
        self._memory = [i for name in held for i in every[blocks.window[name]]]
        states = len(self._names) + len(self._memory)
        self._lines = _delay_lines(blocks, states, blocks.step_size)
        states += sum(len(line.A) for line, _ in self._lines.values())
        p, links, externals = len(every), len(blocks.links), len(blocks.inputs)
        self._arrived = 2 * p + np.arange(links)
        self._arriving = 2 * p + links + np.arange(links)
        # where in w the newest value of every output stands, and that of every external input
        self._newest = np.concatenate([np.arange(p), 2 * p + 2 * links + np.arange(externals)])
        self._inputs: dict[str, Indices] = {}  # where in w the inputs of the group stand
        self._equations = Equations(states, 2 * p + 2 * links + externals)

    def begin(self) -> None:
        """Give the outputs at the beginning, and what has arrived, by the states."""
        equations, newest, nothing = self._equations, self._newest, self._newest[:0]
        for k, (line, where) in self._lines.items():
            arrived = self._arrived[k : k + 1]
            equations.output(arrived, where, line.C_before, nothing, np.zeros((1, 0)))
        for name, c in self._blocks.components.items():
            if name not in self._held:
                entries = self._blocks.entries(name, newest, self._arrived)
                window = newest[self._blocks.window[name]]
                equations.output(window, self._windows[name], c.C, entries, c.D)
        for i, place in self._places_of_memory():
            equations.output(newest[i : i + 1], place, np.eye(1), nothing, np.zeros((1, 0)))

    def deliver(self, group: Sequence[str]) -> None:
        """Let the components of a group take their inputs, and delays what is sent to these."""
        blocks, newest = self._blocks, self._newest
        self._inputs = {name: blocks.entries(name, newest, self._arriving) for name in group}
        for name in group:
            for place, k in blocks.linked(name).items():
                if k not in self._lines:
                    continue
                (line, where), arriving = self._lines[k], self._arriving[k : k + 1]
                sent = newest[blocks.sources[name][place : place + 1]]
                self._equations.output(arriving, where, line.C, sent, np.full((1, 1), line.d))
                self._equations.next_state(where, where, line.A, sent, line.B)

    def step(self, group: Sequence[str]) -> None:
        """Let the components of a group step; their outputs are those of this step from now on."""
        p = len(self._blocks.output_names)
        for name in group:
            c, x, u = self._blocks.components[name], self._windows[name], self._inputs[name]
            window = self._blocks.window[name]
            A, B, _ = self._blocks.over_step(name)
            self._equations.next_state(x, x, A, u, B)
            self._newest[window] = p + np.arange(p)[window]
            D = _after_step(c.C, B) + c.D
            self._equations.output(self._newest[window], x, c.C @ A, u, D)

    def end(self) -> LinearModel:
        """Keep the outputs that are memory for the next step, and give the model."""
        blocks = self._blocks
        nothing = np.zeros((1, 0))
        for i, place in self._places_of_memory():
            newest = self._newest[i : i + 1]
            self._equations.next_state(place, slice(0, 0), nothing, newest, np.eye(1))
        memory = [f"{blocks.output_names[i]}{HELD}" for i in self._memory]
        links = [link.name for link in blocks.links.values()]
        return self._equations.model(
            [*self._names, *memory, *_line_names(blocks, self._lines)],
            blocks.step_size,
            blocks.disagreement,
            blocks.how,
            wires=[*blocks.output_names, *blocks.output_names, *links, *links, *blocks.inputs],
        )

    def _places_of_memory(self) -> Iterator[tuple[int, slice]]:
        """The outputs that are memory, by number, and where they stand among the states."""
        for place, i in enumerate(self._memory, start=len(self._names)):
            yield i, slice(place, place + 1)


def _after_step(C: Matrix, B: Matrix) -> Matrix:
    """C·B; half of the columns of a large network's B are those of idle inputs."""
    if B.shape[1] < MANY_INPUTS:
        return C @ B
    used = np.flatnonzero(B.any(axis=0))
    found = np.zeros((len(C), B.shape[1]))
    found[:, used] = C @ B[:, used]
    return found


def _delay_lines(
    blocks: Blocks, first: int, step_size: float | None
) -> dict[int, tuple[DelayLine, slice]]:
    """By the number of their link: delays, and where their states stand, from ``first`` on."""
    lines = {}
    for k, link in enumerate(blocks.links.values()):
        if not link.is_cut:
            line = (
                continuous_line(link.delay)
                if step_size is None
                else delay_line(link.delay, step_size)
            )
            lines[k] = line, slice(first, first + len(line.A))
            first += len(line.A)
    return lines


def _line_names(blocks: Blocks, lines: Mapping[int, tuple[DelayLine, slice]]) -> list[str]:
    links = list(blocks.links.values())
    return [
        f"{links[k].name}{DELAYED} {i + 1})"
        for k, (line, _) in lines.items()
        for i in range(len(line.A))
    ]


def continuous(blocks: Blocks) -> LinearModel:
    """The same components, connected without any communication step: ẋ = A·x."""
    blocks.check_made_for(None)
    silent = [name for name, c in blocks.components.items() if c.A_c is None]
    if silent:
        raise AnalysisError(
            f"components {', '.join(silent)} do not give their derivatives, so no continuous model can be made"
        )
    windows, names = blocks.state_windows(), blocks.state_names()
    check_loops(blocks)
    p, links = len(blocks.output_names), len(blocks.links)
    lines = _delay_lines(blocks, len(names), None)
    newest = np.concatenate([np.arange(p), p + links + np.arange(len(blocks.inputs))])
    arriving = p + np.arange(links)
    total = len(names) + sum(len(line.A) for line, _ in lines.values())
    equations = Equations(total, p + links + len(blocks.inputs))
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
    wired = [*blocks.output_names, *(link.name for link in blocks.links.values())]
    return equations.model(
        [*names, *_line_names(blocks, lines)],
        None,
        blocks.disagreement,
        blocks.how,
        wires=[*wired, *blocks.inputs],
    )


def continuous_model(master: Master, blocks: Blocks | None = None) -> LinearModel | None:
    """The system without a communication step; None if a component gives no derivatives.

    ``blocks``: blocks with derivatives, if they exist already. They are used if no component knows the step."""
    if blocks is None or not blocks.serves_continuous:
        return where_given(lambda: continuous(Blocks(master, without_step=True)))
    return where_given(lambda: continuous(blocks))


def where_given(make: Callable[[], LinearModel]) -> LinearModel | None:
    """A continuous model, or None where a component gives no derivatives; a verdict then rests on the step map."""
    try:
        return make()
    except AnalysisError:
        return None


def _held_outputs(blocks: Blocks, schedule: Schedule) -> list[str]:
    """Components whose outputs at the end of a step still depend on inputs from its beginning."""
    renewed: set[str] = set()
    owner = {
        i: name
        for name in blocks.components
        for i in range(len(blocks.output_names))[blocks.window[name]]
    }
    for group in schedule.groups:
        fresh = [
            name
            for name in group
            if all(owner[i] in renewed for i in feedthrough_sources(blocks, name))
        ]
        renewed.update(fresh)
    return [name for name in blocks.components if name not in renewed]


def line_model(blocks: Blocks, schedule: Schedule) -> LinearModel:
    """Compose the step map of ``midpoint`` or ``newton``.

    In w stand all outputs at the step's beginning, those at its end, those on the extrapolated lines' ends, and the
    external inputs, which are held.

    Raises an `AnalysisError` if direct feed-through closes a loop; if an output depends on an input of which its FMU
    says that it does not, as such an output is not read again after the step; or if a connection does more than carry
    its value."""
    _check_links(blocks, schedule)
    check_feedthrough(blocks, list(blocks.components))
    _check_declared(blocks)
    p, windows, names = len(blocks.output_names), blocks.state_windows(), blocks.state_names()
    guessed = _guessed(blocks, schedule)
    n, first_external = len(names), 3 * p
    equations = Equations(n + len(guessed), 3 * p + len(blocks.inputs))
    every = np.arange(p)

    def entries(name: str, first: Indices) -> Indices:
        """Where a component's inputs stand in w; ``first`` has that of each output."""
        sources = blocks.sources[name]
        return np.where(
            sources < p, first[np.minimum(sources, p - 1)], first_external + sources - p
        )

    for name, c in blocks.components.items():
        equations.output(every[blocks.window[name]], windows[name], c.C, entries(name, every), c.D)
    for k, i in enumerate(guessed):
        place, nothing = slice(n + k, n + k + 1), np.zeros((1, 0))
        equations.output(
            2 * p + every[i : i + 1], place, -np.eye(1), every[i : i + 1], np.full((1, 1), 2.0)
        )
        equations.next_state(place, slice(0, 0), nothing, every[i : i + 1], np.eye(1))
    newest = every + (p if schedule.coupling == "newton" else 2 * p)
    for group in schedule.groups:
        ends = {name: entries(name, newest) for name in group}
        for name in group:
            c, x, begin, end = (
                blocks.components[name],
                windows[name],
                entries(name, every),
                ends[name],
            )
            A, B, E = blocks.over_step(name)
            equations.next_state(x, x, A, begin, B / 2 - E)
            equations.next_state(x, slice(0, 0), np.zeros((len(A), 0)), end, B / 2 + E)
            rows = p + every[blocks.window[name]]
            equations.output(rows, x, c.C @ A, begin, c.C @ (B / 2 - E))
            equations.output(
                rows, slice(0, 0), np.zeros((len(rows), 0)), end, c.C @ (B / 2 + E) + c.D
            )
            newest[blocks.window[name]] = rows
    all_names = (*names, *(f"{blocks.output_names[i]}{HELD}" for i in guessed))
    wired = [*blocks.output_names] * 3 + [*blocks.inputs]
    return equations.model(
        all_names, blocks.step_size, blocks.disagreement, blocks.how, wires=wired
    )


def _guessed(blocks: Blocks, schedule: Schedule) -> list[int]:
    """Outputs whose end is extrapolated, because somebody takes them before they are stepped."""
    if schedule.coupling == "newton":
        return []
    known: set[int] = set()
    found: set[int] = set()
    p = len(blocks.output_names)
    for members in schedule.groups:
        found |= {i for name in members for i in blocks.sources[name].tolist() if i < p} - known
        known |= {i for name in members for i in range(p)[blocks.window[name]]}
    return sorted(found)


def _check_links(blocks: Blocks, schedule: Schedule) -> None:
    if blocks.links:
        disturbed = ", ".join(link.name for link in blocks.links.values())
        raise AnalysisError(
            f"schedule {schedule.name!r} has no place for a connection with a delay or a cut: {disturbed}"
        )


def _check_declared(blocks: Blocks) -> None:
    for name, c in blocks.components.items():
        connected = blocks.sources[name] < len(blocks.output_names)
        for row, output in enumerate(c.outputs):
            undeclared = np.array(
                [given not in blocks.declared[name][output] for given in c.inputs], dtype=bool
            )
            for column in np.flatnonzero(undeclared & connected & (c.D[row] != 0)).tolist():
                raise AnalysisError(
                    f"component {name!r}: its FMU declares that {output} does not depend on {c.inputs[column]} "
                    f"directly, and it does ({c.D[row, column]:.3g}); a schedule of second order relies on that: take "
                    "gauss-seidel, or mend the dependencies in its modelDescription.xml"
                )


def check_feedthrough(blocks: Blocks, names: list[str]) -> None:
    """No output of the named components may depend on itself within one instant."""
    waiting = list(names)
    while waiting:
        pending = {
            i for name in waiting for i in range(len(blocks.output_names))[blocks.window[name]]
        }
        ready = [name for name in waiting if not pending & feedthrough_sources(blocks, name)]
        if not ready:
            raise _loop_through(waiting)
        waiting = [name for name in waiting if name not in ready]


def check_loops(blocks: Blocks) -> None:
    """No output may depend on itself within one instant.

    Two components may tell each other values at once, if no output comes back to itself, as both stations of a DC line
    do. `check_feedthrough` forbids that, because a component of a run takes all its inputs before it gives outputs."""
    p = len(blocks.output_names)
    every, ends = np.arange(p), [np.empty((2, 0), dtype=np.int64)]
    for name, c in blocks.components.items():
        direct, sources = c.D != 0, blocks.sources[name]
        direct[:, list(blocks.linked(name))] = False
        direct[:, sources >= p] = False
        rows, columns = np.nonzero(direct)
        ends.append(np.stack([every[blocks.window[name]][rows], sources[columns]]))
    to, of = np.hstack(ends)
    of_itself = np.isin(every, to[to == of])
    graph = sp.csr_array((np.ones(len(to)), (to, of)), shape=(p, p))
    _, groups = connected_components(graph, directed=True, connection="strong")
    looped = of_itself | (np.bincount(groups, minlength=p)[groups] > 1)
    caught = [name for name in blocks.components if looped[blocks.window[name]].any()]
    if caught:
        raise _loop_through(caught)


def _loop_through(names: Sequence[str]) -> AnalysisError:
    return AnalysisError(
        f"direct feed-through closes an algebraic loop through {', '.join(names)}; "
        "one of them must give an output that does not depend directly on its inputs"
    )


def feedthrough_sources(blocks: Blocks, name: str) -> set[int]:
    """Indices in y that a component's outputs depend on directly: not over a delay, nor over a cut connection."""
    used = np.abs(blocks.components[name].D).max(axis=0, initial=0.0) > 0
    used[list(blocks.linked(name))] = False
    return {i for i in blocks.sources[name][used].tolist() if i < len(blocks.output_names)}

"""The linear step map of a coupled system, composed from its components along the schedule.

The coupled state z holds the states of all components and, where the schedule makes an output
travel one step late, that output as well: an output with direct feed-through from an input that is
older than itself is memory that the exchange adds. Everything else follows from the states.
"""

from dataclasses import dataclass

import numpy as np

from orchestrator.analysis.component_linearization import Matrix, linearize_component
from orchestrator.coupling.master import Master
from orchestrator.coupling.schedule import Schedule
from orchestrator.errors import AnalysisError


@dataclass(frozen=True)
class LinearModel:
    """z⁺ = A·z around an operating point.

    Attributes
    ----------
    A
        Step map, shape (n, n), or for ``step_size`` None the continuous matrix [1/s].
    names
        ``component.state`` for states, ``component.output (held)`` for what the exchange remembers.
    step_size
        Communication step [s]; None for a continuous model.
    disagreement
        Largest difference between the two perturbation sizes, in elements of the components' matrices.
    """

    A: Matrix
    names: tuple[str, ...]
    step_size: float | None
    disagreement: float

    @property
    def number_of_states(self) -> int:
        """States of the components, without what the exchange remembers."""
        return sum(not name.endswith(HELD) for name in self.names)


HELD = " (held)"


class Blocks:
    """Linearised components with their wiring.

    Parameters
    ----------
    master
        A running system at its operating point. It is left as it was.
    step_size
        Communication step to linearise over [s]; by default the master's own.
    """

    def __init__(self, master: Master, step_size: float | None = None) -> None:
        self.step_size = step_size or master.clock.step_size
        self.components = {
            name: linearize_component(exchange, master.time, self.step_size)
            for name, exchange in master.exchanges.items()
        }
        self.sources = {name: exchange.sources for name, exchange in master.exchanges.items()}
        self.schedule = master.schedule
        self.output_names = master.output_names
        first = 0
        self.window: dict[str, slice] = {}
        for name, exchange in master.exchanges.items():
            self.window[name] = slice(first, first + len(exchange.outputs.names))
            first += len(exchange.outputs.names)

    @property
    def disagreement(self) -> float:
        return max(c.disagreement for c in self.components.values())

    def state_names(self) -> list[str]:
        return [f"{name}.{state}" for name, c in self.components.items() for state in c.states]

    def state_windows(self) -> dict[str, slice]:
        windows, first = {}, 0
        for name, c in self.components.items():
            windows[name] = slice(first, first + len(c.states))
            first += len(c.states)
        return windows


def linearize(master: Master, step_size: float | None = None, schedule: Schedule | None = None) -> LinearModel:
    """Linearise the coupled step map around where the master is.

    Parameters
    ----------
    master
        At an operating point; it is left as it was.
    step_size, schedule
        By default the master's own; others show what the coupling would do with them.

    Raises
    ------
    AnalysisError
        If a component cannot be perturbed.
    """
    return compose(Blocks(master, step_size), schedule or master.schedule)


def compose(blocks: Blocks, schedule: Schedule) -> LinearModel:
    """Walk once through the schedule with every quantity written as a row over z."""
    windows, names = blocks.state_windows(), blocks.state_names()
    held = _held_outputs(blocks, schedule)
    n, memory = len(names), [i for name in held for i in range(len(blocks.output_names))[blocks.window[name]]]
    z = np.eye(n + len(memory))
    x = z[:n].copy()
    y = np.zeros((len(blocks.output_names), n + len(memory)))
    y[memory] = z[n:]
    order = [name for group in schedule.groups for name in group]
    _settle_outputs(blocks, windows, x, y, [name for name in order if name not in held])
    for group in schedule.groups:
        inputs = {name: y[blocks.sources[name]] for name in group}
        for name in group:
            c = blocks.components[name]
            x[windows[name]] = c.A @ x[windows[name]] + c.B @ inputs[name]
        for name in group:
            c = blocks.components[name]
            y[blocks.window[name]] = c.C @ x[windows[name]] + c.D @ inputs[name]
    A = np.vstack([x, y[memory]])
    all_names = (*names, *(f"{blocks.output_names[i]}{HELD}" for i in memory))
    return LinearModel(A, all_names, blocks.step_size, blocks.disagreement)


def continuous(blocks: Blocks) -> LinearModel:
    """The same components, connected without any communication step: ẋ = A·x.

    Raises
    ------
    AnalysisError
        If a component does not give its derivatives, or direct feed-through closes a loop.
    """
    windows, names = blocks.state_windows(), blocks.state_names()
    silent = [name for name, c in blocks.components.items() if c.A_c is None]
    if silent:
        raise AnalysisError(
            f"components {', '.join(silent)} do not give their derivatives, so no continuous model can be made"
        )
    x = np.eye(len(names))
    y = np.zeros((len(blocks.output_names), len(names)))
    _settle_outputs(blocks, windows, x, y, list(blocks.components))
    A = np.zeros_like(x)
    for name, c in blocks.components.items():
        assert c.A_c is not None
        assert c.B_c is not None
        A[windows[name]] = c.A_c @ x[windows[name]] + c.B_c @ y[blocks.sources[name]]
    return LinearModel(A, tuple(names), None, blocks.disagreement)


def _settle_outputs(blocks: Blocks, windows: dict[str, slice], x: Matrix, y: Matrix, names: list[str]) -> None:
    """Write y = C·x + D·u for the named components, those without open feed-through first."""
    waiting = list(names)
    while waiting:
        pending = {i for name in waiting for i in range(len(y))[blocks.window[name]]}
        ready = [name for name in waiting if not pending & _feedthrough_sources(blocks, name)]
        if not ready:
            raise AnalysisError(
                f"direct feed-through closes an algebraic loop through {', '.join(waiting)}; "
                "one of them must give an output that does not depend directly on its inputs"
            )
        for name in ready:
            c = blocks.components[name]
            y[blocks.window[name]] = c.C @ x[windows[name]] + c.D @ y[blocks.sources[name]]
            waiting.remove(name)


def _feedthrough_sources(blocks: Blocks, name: str) -> set[int]:
    """Indices in y that a component's outputs depend on directly."""
    used = np.abs(blocks.components[name].D).max(axis=0, initial=0.0) > 0
    return set(blocks.sources[name][used].tolist())


def _held_outputs(blocks: Blocks, schedule: Schedule) -> list[str]:
    """Components whose outputs, at the end of a step, still rest on inputs from its beginning."""
    renewed: set[str] = set()
    owner = {i: name for name in blocks.components for i in range(len(blocks.output_names))[blocks.window[name]]}
    for group in schedule.groups:
        fresh = [name for name in group if all(owner[i] in renewed for i in _feedthrough_sources(blocks, name))]
        renewed.update(fresh)
    return [name for name in blocks.components if name not in renewed]

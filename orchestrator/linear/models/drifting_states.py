"""States that go on at an even rate at rest and move no port, as a battery's charge: they are held where they are.

Such a state is no part of a steady state, and nothing else answers it: without it the rest is exact. Linear models and
steady states then leave it out; a run goes on to move it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Matrix
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.linear.models.blocks import linearize_within
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.systems.coupling.master import Master

LOOK = 60.0  # time [s] within which its going on must move no port
_MOVES = 1e-6  # largest change of a port in that time, in parts of max(1, its value)
_HARDLY = 1e-2  # the same up to which it can be taken for a store
_UNEVEN = 1e-3  # part by which its rate may change
_STEPS = 1000  # communication steps over which that is watched
# as in steady_state: an angle that turns freely makes I − A singular
_SHIFT = 1e-7


@dataclass(frozen=True)
class HeldState:
    """A state that is held.

    Attributes
    ----------
    name
        ``component.state``.
    value
        Where it is held [its own unit].
    rate
        How fast it goes on at rest [its own unit per second].
    later_rate
        The same some steps later.
    output, moves
        The coupled output that its going on for `LOOK` moves most, and by how much [that output's unit].
    still
        Largest movement that is none [that output's unit].
    """

    name: str
    value: float
    rate: float
    later_rate: float
    output: str
    moves: float
    still: float

    @property
    def is_even(self) -> bool:
        """Return whether its rate stays as it is."""
        return abs(self.later_rate - self.rate) <= _UNEVEN * abs(self.rate)

    @property
    def is_silent(self) -> bool:
        """Return whether it moves no port."""
        return self.moves <= self.still

    @property
    def looks_silent(self) -> bool:
        """Return whether it hardly moves a port, so that it can be taken for a store."""
        return self.moves <= _HARDLY / _MOVES * self.still

    @property
    def reason(self) -> str:
        """Why it cannot be held; "" where it can."""
        goes = f"{self.name} goes on by {self.rate:.3g} a second at rest"
        if not self.is_even:
            return f"{goes}, and by {self.later_rate:.3g} a second {_STEPS} steps later"
        if not self.is_silent:
            return f"{goes}, which moves {self.output} by {self.moves:.3g} in {LOOK:g} s"
        return ""

    @property
    def sentence(self) -> str:
        """The sentence that a result has about it."""
        return (
            f"{self.name} goes on by {self.rate:.3g} a second at rest and moves no port, as a charge does: it is held "
            f"at {self.value:.6g}, and the modes are those of that value"
        )


def held_names(master: Master) -> list[str]:
    """The states that are held, ``component.state``."""
    return [f"{name}.{s}" for name, c in master.components.items() for s in c.held_states]


def hold(master: Master, names: Iterable[str]) -> None:
    """Leave states out of steady states and linear models."""
    for component, states in _by_component(names).items():
        master.components[component].hold(states)


def release(master: Master, names: Iterable[str]) -> None:
    """Undo `hold`."""
    for component in _by_component(names):
        master.components[component].hold(())


def examine_held(master: Master, names: Sequence[str]) -> tuple[HeldState, ...]:
    """Watch states that are held, at a steady state of all others.

    Parameters
    ----------
    master
        A running system at that steady state; it is left as it was.
    names
        The held states, ``component.state``.
    """
    rates = _rates(master, names) if names else {}
    return tuple(
        found
        for component, states in _by_component(names).items()
        for found in _of_component(master, component, states, rates)
    )


def _rates(master: Master, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """How fast each goes on in the first step, and in a later one [a second]."""
    h = master.clock.step_size
    batches = [
        RealBatch(master.components[component], states)
        for component, states in _by_component(names).items()
    ]

    def read() -> Matrix:
        return np.concatenate([batch.read() for batch in batches])

    rows = []
    with CoupledState(master).put_back():
        for steps in (0, 1, _STEPS - 2, 1):
            master.advance(steps)
            rows.append(read())
    early, late = (rows[1] - rows[0]) / h, (rows[3] - rows[2]) / h
    ordered = [f"{c}.{s}" for c, states in _by_component(names).items() for s in states]
    return {name: (float(a), float(b)) for name, a, b in zip(ordered, early, late, strict=True)}


def _of_component(
    master: Master, name: str, states: Sequence[str], rates: Mapping[str, tuple[float, float]]
) -> Iterator[HeldState]:
    """Move each held state by what it goes on in `LOOK`, and see where that moves the rest and the outputs."""
    component, exchange, h = master.components[name], master.exchanges[name], master.clock.step_size
    rest = linearize_within(master, name, h)
    outputs = RealBatch(component, exchange.outputs.names)
    others = RealBatch(component, rest.states)

    def answer(state: str, by: float) -> tuple[float, Matrix, Matrix]:
        saved = component.save_state()
        try:
            batch = RealBatch(component, [state])
            value = float(batch.read()[0])
            batch.values[0] = value + by
            batch.write()
            at_once = outputs.read().copy()
            component.step(master.time, h)
            return value, at_once, others.read().copy()
        finally:
            component.restore_state(saved)
            component.free_state(saved)

    turned = (1 + _SHIFT) * np.eye(len(rest.states)) - rest.A
    for state in states:
        rate, later = rates[f"{name}.{state}"]
        value, before, x = answer(state, 0.0)
        _, after, moved = answer(state, LOOK * rate)
        change = np.abs(after - before + rest.C @ np.linalg.solve(turned, moved - x))
        still = _MOVES * np.maximum(1.0, np.abs(before))
        worst = int(np.argmax(change / still)) if len(change) else 0
        output = f"{name}.{exchange.outputs.names[worst]}" if len(change) else ""
        most = (float(change[worst]), float(still[worst])) if len(change) else (0.0, 0.0)
        yield HeldState(f"{name}.{state}", value, rate, later, output, *most)


def _by_component(names: Iterable[str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for name in names:
        component, _, state = name.partition(".")
        found.setdefault(component, []).append(state)
    return found

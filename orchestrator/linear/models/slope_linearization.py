"""Continuous model of one running FMU from differences of its own derivatives, without a step.

A screening linearises thousands of operating points, and only a system without a communication step is asked for. What
answers differently up and down, as at a limit, or a tenth of the perturbation otherwise than the whole, as between two
limits, is left to the perturbation over a step, which tries smaller sizes."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.linear.models.component_linearization import (
    ComponentLinearization,
    linearize_component,
)
from orchestrator.systems.coupling.turns import Exchange

_SIZE = 1e-5  # of a perturbation, relative to max(1, |value|)
_NEAR = 0.1  # part of it, upwards, whose answer shows whether a limit lies within it on both sides
# an element's answer to that part may differ from what the whole lets expect by this part of it: as
# two sizes of a perturbation over a step do
_AGREE = 5e-3
# an element's answers up and down may differ by this part of it; beyond, a limit is near
_EVEN = 0.1
_FLOOR = 1e-2  # rate [1/s] of which they may differ by the same part as well

# part of an answer's largest slope that counts as this rate: |v| is curved, and a gain makes it
# large
_OF_ROW = 1e-3
_MANY = 100  # from this number of states and inputs on, variables are perturbed together
_HOLDS = 1e-3
"""Part of its answer by which a perturbation in all directions at once may differ from the sum of the single ones: more
is an effect that the pattern does not have."""

_ROUNDING = 1e-9  # part of the answer at rest by which it may differ as well


def gives_slopes(exchange: Exchange) -> bool:
    """Return whether a component lets its states be set and gives all their derivatives."""
    description = exchange.component.description
    return description.states_are_settable and len(description.rates) == len(description.states)


def linearize_slopes(
    exchange: Exchange,
    time: float,
    step_size: float,
    inputs: Sequence[str] = (),
    observed: Sequence[str] = (),
    like: ComponentLinearization | None = None,
) -> ComponentLinearization:
    """ẋ = A_c·x + B_c·u and y = C·x + D·u of one component; it has no step map.

    ``like``: the same FMU at another operating point. Variables that had no common effect there are perturbed together;
    a perturbation in all directions then shows whether that holds here, too. It serves where it has all states, inputs
    and outputs that are asked for."""
    component = exchange.component
    states, rates = component.description.states, component.description.rates
    entries, exits = (*exchange.inputs.names, *inputs), (*exchange.outputs.names, *observed)
    n, p = len(states), len(exchange.outputs.names)
    point = _Point(component, (*states, *entries), (*rates, *exits))
    pattern = (
        None
        if like is None or len(point.names) < _MANY
        else _pattern(like, point.names, _answers(states, exits))
    )
    found = None if pattern is None else point.together(pattern)
    slopes = found or point.one_by_one()
    whole = slopes.central
    if not slopes.are_of_one_line:
        return linearize_component(exchange, time, step_size, inputs, observed, derivatives=True)
    none = np.zeros((0, 0))
    return ComponentLinearization(
        component.name,
        states,
        entries,
        exchange.outputs.names,
        A=none,
        B=none,
        C=whole[n : n + p, :n],
        D=whole[n : n + p, n:],
        observed=tuple(observed),
        C_o=whole[n + p :, :n],
        D_o=whole[n + p :, n:],
        A_c=whole[:n, :n],
        B_c=whole[:n, n:],
        disagreement=0.0,
    )


class Slopes(NamedTuple):
    """Difference quotients, shape (answers, variables): upwards, downwards, and upwards of the part `_NEAR`."""

    up: Matrix
    down: Matrix
    near: Matrix

    @property
    def central(self) -> Matrix:
        return (self.up + self.down) / 2

    @property
    def are_of_one_line(self) -> bool:
        """Tell if a limit is neither on one side nor within the perturbation on both."""
        whole, bend = self.central, self.up - self.down
        floor = _FLOOR + _OF_ROW * np.abs(whole).max(axis=1, keepdims=True, initial=0.0)
        size = np.abs(whole) + floor
        expected = whole + _NEAR * bend / 2  # the curvature grows with the size
        is_even, agrees = (
            np.abs(bend) <= _EVEN * size,
            np.abs(self.near - expected) <= _AGREE * size,
        )
        return bool((is_even & agrees).all())


_TURNS = (1.0, -1.0, _NEAR)
"""Sizes of the three perturbations of a variable, as parts of the usual one."""


class _Point:
    """A component at its operating point, perturbed and put back."""

    def __init__(self, component: Component, names: Sequence[str], answers: Sequence[str]) -> None:
        self.names = tuple(names)
        self._component = component
        self._all, self._answers = RealBatch(component, names), RealBatch(component, answers)
        self._values = self._all.read().copy()
        self._steps = _SIZE * np.maximum(1.0, np.abs(self._values))

    def one_by_one(self) -> Slopes:
        with self._put_back():
            at_rest = self._answers.read().copy()
            found = [np.empty((len(at_rest), len(self.names))) for _ in _TURNS]
            for k, name in enumerate(self.names):
                value, step, perturbed = (
                    self._values[k],
                    self._steps[k],
                    RealBatch(self._component, [name]),
                )
                for part, slopes in zip(_TURNS, found, strict=True):
                    perturbed.values[0] = value + part * step
                    perturbed.write()
                    slopes[:, k] = (self._answers.read() - at_rest) / (part * step)
                perturbed.values[0] = value
                perturbed.write()
        return Slopes(*found)

    def together(self, pattern: NDArray[np.bool_]) -> Slopes | None:
        """The same by groups of variables without a common answer; None where the pattern does not hold."""
        found = [np.zeros(pattern.shape) for _ in _TURNS]
        with self._put_back():
            at_rest = self._answers.read().copy()
            for group in _groups(pattern):
                for part, slopes in zip(_TURNS, found, strict=True):
                    change = (self._answer(part, group) - at_rest) / part
                    for k in group.tolist():
                        slopes[pattern[:, k], k] = change[pattern[:, k]] / self._steps[k]
            turns = np.random.default_rng(0).choice([-1.0, 1.0], len(self.names)) * self._steps
            change = (self._answer_at(turns) - self._answer_at(-turns)) / 2
        central = Slopes(*found).central
        expected = central @ turns
        size = np.abs(central) @ np.abs(turns) + np.abs(at_rest) * _ROUNDING + _ROUNDING * _SIZE
        is_whole = bool((np.abs(change - expected) <= _HOLDS * size).all())
        return Slopes(*found) if is_whole else None

    def _answer(self, part: float, group: NDArray[np.int64]) -> Matrix:
        turns = np.zeros(len(self.names))
        turns[group] = part * self._steps[group]
        return self._answer_at(turns)

    def _answer_at(self, turns: Matrix) -> Matrix:
        self._all.values[:] = self._values + turns
        self._all.write()
        return self._answers.read().copy()

    @contextmanager
    def _put_back(self) -> Iterator[None]:
        saved = self._component.save_state()
        try:
            yield
        finally:
            self._component.restore_state(saved)
            self._component.free_state(saved)


def covers(like: ComponentLinearization, other: ComponentLinearization) -> bool:
    """Return whether a linear model has all states, inputs and outputs of another one."""
    return set(_entries(other)) <= set(_entries(like)) and set(_exits(other)) <= set(_exits(like))


def _entries(c: ComponentLinearization) -> tuple[str, ...]:
    return (*c.states, *c.inputs)


def _exits(c: ComponentLinearization) -> tuple[str, ...]:
    return _answers(c.states, (*c.outputs, *c.observed))


def _answers(states: Sequence[str], exits: Sequence[str]) -> tuple[str, ...]:
    """Names of derivatives and outputs; an output may have the name of a state."""
    return (*(f"der({name})" for name in states), *exits)


def _pattern(
    like: ComponentLinearization, entries: Sequence[str], exits: Sequence[str]
) -> NDArray[np.bool_] | None:
    """Which answer depends on which variable, both by name; None where the model lacks one of them."""
    assert like.A_c is not None
    assert like.B_c is not None
    row, column = (
        {name: k for k, name in enumerate(names)} for names in (_exits(like), _entries(like))
    )
    if not (set(exits) <= set(row) and set(entries) <= set(column)):
        return None
    blocks = (like.A_c, like.B_c), (like.C, like.D), (like.C_o, like.D_o)
    whole = np.asarray(np.vstack([np.hstack(block) for block in blocks]) != 0, dtype=bool)
    return whole[np.ix_([row[name] for name in exits], [column[name] for name in entries])]


def _groups(pattern: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Columns without a common row, greedily, those with most rows first."""
    order = np.argsort(-pattern.sum(axis=0), kind="stable")
    columns = np.ascontiguousarray(pattern.T)
    taken = np.zeros_like(
        columns
    )  # which rows each group has; there are no more groups than columns
    groups: list[list[int]] = []
    for k in order.tolist():
        rows = np.flatnonzero(columns[k])
        free = np.flatnonzero(~taken[: len(groups), rows].any(axis=1))
        place = int(free[0]) if len(free) else len(groups)
        if place == len(groups):
            groups.append([])
        groups[place].append(k)
        taken[place, rows] = True
    return [np.array(group, dtype=np.int64) for group in groups]

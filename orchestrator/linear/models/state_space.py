"""The linear model with inputs and outputs. It gives the response to a disturbance, and other tools can import it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.core.arrays import Matrix, Numbers
from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.linear_model import read_embedded_model
from orchestrator.linear.models.held_inputs import over_held_inputs
from orchestrator.linear.models.linearization import Blocks, compose, continuous
from orchestrator.systems.coupling.schedule import Schedule

_ON_THE_STEP = 1e-6
"""How far a time may be from a step [steps]: more than rounding in a long record, and no time that was meant."""


def _numbers(given: Any, argument: str) -> Numbers:
    """Finite numbers in one row."""
    try:
        found = np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        found = np.array([np.nan])
    if not np.isfinite(found).all():
        raise InputError(f"{argument} = {given!r}; give finite numbers")
    return found


@dataclass(frozen=True)
class StateSpace:
    """x⁺ = A·x + B·u and y = C·x + D·u in deviations from an operating point."""

    # A, B, C, D: Shapes (n, n), (n, m), (p, n), (p, m). Units are those of the variables; for a continuous model A and
    # B give derivatives per second.
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    # states, inputs, outputs: names ``component.variable``; among the states may be ``component.output (held)`` and
    # ``a.out -> b.in (delayed k)``
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    step_size: float | None  # communication step [s]; None for a continuous model, ẋ for x⁺
    # how the linear model of every component was found
    sources: Mapping[str, str] = field(default_factory=dict)

    def step_response(self, change: Matrix, times: Matrix) -> Matrix:
        """Deviations of the outputs, shape (k, p), after a step of the inputs at t = 0.

        ``times``: [s], not before 0 and in equal distances; of a step map, multiples of its step."""
        u, times = _numbers(change, "change"), _numbers(times, "times")
        if u.shape != (len(self.inputs),):
            raise InputError(
                f"change = {change!r}; give one number for each input: {', '.join(self.inputs)}"
            )
        distances = np.diff(times) if len(times) > 1 else np.zeros(1)
        if times.ndim != 1 or not times.size or times[0] < -1e-9 or np.ptp(distances) > 1e-9:
            raise InputError(
                "times: give one or more, from 0 on and in equal distances, such as np.arange(0, 5, 0.01)"
            )
        self._check_on_the_step(times)
        A, B = self._over(distances[0])
        x, rows = self._over(times[0])[1] @ u, []
        for _ in times:
            rows.append(self.C @ x + self.D @ u)
            x = A @ x + B @ u
        return np.array(rows)

    def _check_on_the_step(self, times: Numbers) -> None:
        """Refuse times between the steps of a step map, which says nothing of them."""
        if self.step_size is None:
            return
        steps = times / self.step_size
        between = np.flatnonzero(np.abs(steps - np.round(steps)) > _ON_THE_STEP)
        if len(between):
            raise InputError(
                f"times: {times[between[0]]:.6g} s lies between the steps of the step map, each {self.step_size:g} s "
                "long; give multiples of the step, or ask the model of continuous=True"
            )

    def _over(self, duration: float) -> tuple[Matrix, Matrix]:
        """The map over a time [s] with the input held."""
        if self.step_size is None:
            return over_held_inputs(self.A, self.B, duration)
        steps = round(duration / self.step_size)
        A, B = self.A, self.B
        A_all, B_all = np.eye(len(A)), np.zeros_like(B)
        while steps:  # by squaring: many steps cost little more than one
            if steps & 1:
                A_all, B_all = A @ A_all, A @ B_all + B
            A, B = A @ A, A @ B + B
            steps >>= 1
        return A_all, B_all


def read_linear_model(path: Path) -> StateSpace:
    """The continuous linear model that an FMU carries; names are those of its variables."""
    model = read_embedded_model(path)
    if model is None:
        raise InputError(
            f"{path}: there is no linear model inside; `gfor fmu build --with-linear-model` packs one"
        )
    names = (tuple(model.states), tuple(model.inputs), tuple(model.outputs))
    return StateSpace(model.A, model.B, model.C, model.D, *names, step_size=None)


def state_space(blocks: Blocks, schedule: Schedule | None) -> StateSpace:
    """The state space between the inputs and outputs that ``blocks`` was made with: the step map of a schedule, or the
    continuous model for None."""
    model = compose(blocks, schedule) if schedule else continuous(blocks)
    n, m = model.G.shape
    external = m - len(blocks.inputs) + np.arange(len(blocks.inputs))
    drive = np.zeros((m, len(blocks.inputs)))
    drive[external, np.arange(len(blocks.inputs))] = 1.0
    by_state, by_input = model.settle(model.H.toarray()), model.settle(drive)
    p = len(blocks.output_names)
    newest = np.concatenate([np.arange(p), external])
    # of a step map, what arrived before
    arriving = (2 * p if schedule else p) + np.arange(len(blocks.links))
    C, D = np.zeros((len(blocks.outputs), n)), np.zeros((len(blocks.outputs), len(blocks.inputs)))
    windows = blocks.state_windows()
    for name, c in blocks.components.items():
        rows = [blocks.outputs.index(f"{name}.{variable}") for variable in c.observed]
        w = blocks.entries(name, newest, arriving)
        C[rows] = c.D_o @ by_state[w]
        C[rows, windows[name]] += c.C_o
        D[rows] = c.D_o @ by_input[w]
    names = (model.names, blocks.inputs, blocks.outputs)
    return StateSpace(model.A, model.G @ by_input, C, D, *names, model.step_size, model.sources)

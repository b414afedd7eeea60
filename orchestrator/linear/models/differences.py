"""Differences of one running FMU over one communication step, by perturbing its states and inputs one at a time."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orchestrator.core.arrays import Matrix
from orchestrator.devices.fmi.component import Component, RealBatch

# change of a state in a step [of max(1, |value|)] up to which the component rests
RESTS = 1e-9


class Differences(NamedTuple):
    """Columns of d(x⁺), d(y) and d(ẋ) by what was perturbed; ``_up`` from the perturbation upwards only."""

    after: Matrix
    outputs: Matrix
    slopes: Matrix
    after_up: Matrix
    outputs_up: Matrix
    slopes_up: Matrix


@dataclass(frozen=True)
class PerturbedStep:
    """One communication step of a component, which begins a little beside its operating point."""

    component: Component
    # inputs, exits: names of the inputs that are perturbed after the states, and of the outputs that are read
    inputs: Sequence[str]
    exits: Sequence[str]
    # time, step_size: of the operating point, and the communication step [s]
    time: float
    step_size: float

    @property
    def states(self) -> tuple[str, ...]:
        return self.component.description.states

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.states, *self.inputs)

    def differences(
        self,
        varied: Sequence[int],
        size: float,
        rates: Sequence[str] = (),
        unstepped: Collection[int] = (),
    ) -> Differences:
        """Central differences, one column for each perturbed state or input; the component is put back.

        ``size``: of the perturbation, relative to max(1, |value|); ``rates`` are read before the step; ``unstepped``:
        those of ``varied`` after which no step is done; the caller gives their columns of d(x⁺)."""
        component, names = self.component, self.names
        perturbed = RealBatch(component, names)
        z_0 = perturbed.read().copy()
        after, outputs, slopes = (
            RealBatch(component, group) for group in (self.states, self.exits, rates)
        )
        columns = tuple(
            np.zeros((len(varied), len(batch.names))) for batch in (after, outputs, slopes)
        )
        upwards = tuple(np.zeros_like(column) for column in columns)
        saved = component.save_state()
        try:
            outputs_0, slopes_0 = outputs.read().copy(), slopes.read().copy()
            component.step(self.time, self.step_size)
            after_0 = after.read().copy()
            component.restore_state(saved)
            for k, place in enumerate(varied):
                value = z_0[place]
                step = size * max(1.0, abs(value))
                signs = _allowed_signs(component, names[place], value, step)
                for sign in signs:
                    perturbed.values[place] = value + sign * step
                    perturbed.write_one(place)
                    for batch, column in zip((outputs, slopes), columns[1:], strict=True):
                        column[k] += sign * batch.read()
                    if place not in unstepped:
                        component.step(self.time, self.step_size)
                        columns[0][k] += sign * after.read()
                    if sign == signs[0]:
                        upwards[0][k] = sign * (after.values - after_0)
                        upwards[1][k] = sign * (outputs.values - outputs_0)
                        upwards[2][k] = sign * (slopes.values - slopes_0)
                    component.restore_state(saved)
                if len(signs) == 1:
                    for column, at_rest in zip(
                        columns, (after_0, outputs_0, slopes_0), strict=True
                    ):
                        column[k] -= signs[0] * at_rest
                for column in columns:
                    column[k] /= len(signs) * step
                for column in upwards:
                    column[k] /= step
        finally:
            component.restore_state(saved)
            component.free_state(saved)
        return Differences(*(column.T for column in (*columns, *upwards)))

    def moves_at_rest(self) -> bool:
        """Return whether a step from the operating point itself changes a state by more than `RESTS`."""
        before, after = self._states_around(np.zeros(len(self.inputs)))
        return bool((np.abs(after - before) > RESTS * np.maximum(1.0, np.abs(before))).any())

    def response(self, turns: Matrix) -> Matrix:
        """States' central difference after steps with all inputs moved at once by ±``turns``, shape (n,)."""
        return (self._states_around(turns)[1] - self._states_around(-turns)[1]) / 2

    def sizes(self, size: float) -> Matrix:
        """Perturbation of each input, for a size relative to max(1, |value|)."""
        return size * np.maximum(1.0, np.abs(RealBatch(self.component, self.inputs).read()))

    def all_sizes(self, size: float) -> Matrix:
        """Perturbation of each state and input, for a size relative to max(1, |value|)."""
        return size * np.maximum(1.0, np.abs(RealBatch(self.component, self.names).read()))

    def answer_to_all(self, turns: Matrix) -> tuple[Matrix, Matrix]:
        """Central differences of states after a step and of outputs before it, with all moved by ±``turns``."""
        component = self.component
        moved, after, outputs = (
            RealBatch(component, names) for names in (self.names, self.states, self.exits)
        )
        before = moved.read().copy()
        answers = [np.zeros(len(batch.names)) for batch in (after, outputs)]
        saved = component.save_state()
        try:
            for sign in (+1.0, -1.0):
                moved.values[:] = before + sign * turns
                moved.write()
                answers[1] += sign * outputs.read() / 2
                component.step(self.time, self.step_size)
                answers[0] += sign * after.read() / 2
                component.restore_state(saved)
        finally:
            component.restore_state(saved)
            component.free_state(saved)
        return answers[0], answers[1]

    def _states_around(self, turns: Matrix) -> tuple[Matrix, Matrix]:
        """States before and after a step whose inputs are moved; the component is put back."""
        component = self.component
        inputs, states = RealBatch(component, self.inputs), RealBatch(component, self.states)
        before = states.read().copy()
        saved = component.save_state()
        try:
            inputs.read()
            inputs.values += turns
            inputs.write()
            component.step(self.time, self.step_size)
            return before, states.read().copy()
        finally:
            component.restore_state(saved)
            component.free_state(saved)


def _allowed_signs(component: Component, name: str, value: float, step: float) -> tuple[float, ...]:
    """Directions of a perturbation that stay within a parameter's declared bounds; both, where none does."""
    info = component.description.variables[name]
    if info.causality != "parameter":
        return (+1.0, -1.0)
    above = info.maximum is None or value + step <= info.maximum
    below = info.minimum is None or value - step >= info.minimum
    return tuple(sign for sign, within in ((+1.0, above), (-1.0, below)) if within) or (+1.0, -1.0)

"""Differences of one running FMU over one communication step, by perturbing its states and inputs one at a time."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix, Vector
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.linear.models.answers_to_moves import Moves, answers_to_moves

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
        moved, after, outputs = self._batches
        slopes = RealBatch(component, rates)
        values = moved.read()[list(varied)]
        sizes = size * np.maximum(1.0, np.abs(values))
        signs = [
            _allowed_signs(component, names[place], value, step)
            for place, value, step in zip(varied, values.tolist(), sizes.tolist(), strict=True)
        ]
        first = np.array([each[0] for each in signs])
        both = np.flatnonzero([len(each) == 2 for each in signs])
        stepped = np.array([place not in unstepped for place in varied], dtype=bool)
        places = np.array(varied, dtype=np.int64)
        moves = Moves(
            moved,
            np.concatenate([places, places[both]]),
            np.concatenate([values + first * sizes, values[both] - sizes[both]]),
            np.concatenate([stepped, stepped[both]]),
            before=(outputs, slopes),
            after=after,
            time=self.time,
            step_size=self.step_size,
        )
        saved = component.save_state()
        try:
            at_rest = self._at_rest(slopes, saved)
            answers = answers_to_moves(component, moves, saved)
        finally:
            component.restore_state(saved)
            component.free_state(saved)
        every = zip((answers.after, *answers.before), at_rest, strict=True)
        columns, upwards = zip(
            *(_quotients(each, rest, first, sizes, both) for each, rest in every), strict=True
        )
        for column in (columns[0], upwards[0]):
            column[~stepped] = 0.0
        return Differences(*(column.T for column in (*columns, *upwards)))

    @cached_property
    def _batches(self) -> tuple[RealBatch, RealBatch, RealBatch]:
        """All variables that are moved, the states, and the outputs."""
        groups = (self.names, self.states, self.exits)
        moved, states, outputs = (RealBatch(self.component, names) for names in groups)
        return moved, states, outputs

    def _at_rest(self, slopes: RealBatch, saved: Any) -> tuple[Matrix, Matrix, Matrix]:
        """States after a step, outputs and rates before it where nothing is moved; the component is put back."""
        _, after, outputs = self._batches
        outputs.read()
        slopes.read()
        self.component.step(self.time, self.step_size)
        after.read()
        self.component.restore_state(saved)
        return after.values.copy(), outputs.values.copy(), slopes.values

    def moves_at_rest(self) -> bool:
        """Return whether a step from the operating point itself changes a state by more than `RESTS`."""
        before, after = self._states_around(self.inputs, np.zeros(len(self.inputs)))
        return bool((np.abs(after - before) > RESTS * np.maximum(1.0, np.abs(before))).any())

    def response(self, turns: Matrix) -> Matrix:
        """States' central difference after steps with all inputs moved at once by ±``turns``, shape (n,)."""
        return self._response(self.inputs, turns)

    def response_to_states(self, turns: Matrix) -> Matrix:
        """States' central difference after steps with all states moved at once by ±``turns``, shape (n,)."""
        return self._response(self.states, turns)

    def sizes(self, size: float) -> Matrix:
        """Perturbation of each input, for a size relative to max(1, |value|)."""
        return self.all_sizes(size)[len(self.states) :]

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

    def _response(self, names: Sequence[str], turns: Matrix) -> Matrix:
        upwards, downwards = (self._states_around(names, way * turns)[1] for way in (1.0, -1.0))
        return (upwards - downwards) / 2

    def _states_around(self, names: Sequence[str], turns: Matrix) -> tuple[Matrix, Matrix]:
        """States before and after a step before which some variables are moved; the component is put back."""
        component = self.component
        moved, states = RealBatch(component, names), RealBatch(component, self.states)
        before = states.read().copy()
        saved = component.save_state()
        try:
            moved.read()
            moved.values += turns
            moved.write()
            component.step(self.time, self.step_size)
            return before, states.read().copy()
        finally:
            component.restore_state(saved)
            component.free_state(saved)


def _quotients(
    answers: Matrix, at_rest: Vector, first: Vector, sizes: Vector, both: NDArray[np.int64]
) -> tuple[Matrix, Matrix]:
    """Central difference quotients, and those of the first direction alone; a row for each variable.

    Answers are those in the first direction, then those in the other of the variables that have ``both``."""
    count = len(sizes)
    other = np.empty((count, len(at_rest)))
    other[:] = at_rest
    other[both] = answers[count:]
    width = sizes.copy()
    width[both] *= 2
    central = np.subtract(answers[:count], other, out=other)
    central *= first[:, None]
    central /= width[:, None]
    one_sided = answers[:count] - at_rest
    one_sided *= first[:, None]
    one_sided /= sizes[:, None]
    return central, one_sided


def _allowed_signs(component: Component, name: str, value: float, step: float) -> tuple[float, ...]:
    """Directions of a perturbation that stay within a parameter's declared bounds; both, where none does."""
    info = component.description.variables[name]
    if info.causality != "parameter":
        return (+1.0, -1.0)
    above = info.maximum is None or value + step <= info.maximum
    below = info.minimum is None or value - step >= info.minimum
    return tuple(sign for sign, within in ((+1.0, above), (-1.0, below)) if within) or (+1.0, -1.0)

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


_Read = tuple[Matrix, Matrix, Matrix]


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
        (found,) = self.differences_of_sizes(varied, (size,), rates, unstepped)
        return found

    def differences_of_sizes(
        self,
        varied: Sequence[int],
        sizes: Sequence[float],
        rates: Sequence[str] = (),
        unstepped: Collection[int] = (),
    ) -> tuple[Differences, ...]:
        """The same for several sizes, whose moves are made one after the other without a look at Python between."""
        places = np.array(varied, dtype=np.int64)
        values = self.values()[places]
        stepped = np.array([place not in unstepped for place in varied], dtype=bool)
        turns = [self._turns(places, values, size) for size in sizes]
        each = [turn.moves(places, values, stepped) for turn in turns]
        moved, targets, follow = (np.concatenate(part) for part in zip(*each, strict=True))
        answers, at_rest = self.answers(moved, targets, follow, rates)
        found = _quotients(turns, answers, at_rest)
        for one in found:
            one.after[:, ~stepped] = one.after_up[:, ~stepped] = 0.0
        return found

    def values(self) -> Vector:
        """Return the values of all variables where the component is."""
        return self._batches[0].read()

    def answers(
        self,
        places: NDArray[np.int64],
        values: Vector,
        steps: NDArray[np.bool_],
        rates: Sequence[str],
    ) -> tuple[_Read, _Read]:
        """States after a step, outputs and rates before it: after each move, a row each, and where nothing is moved.

        All variables are as `values` read them; the component is put back."""
        component = self.component
        moved, after, outputs = self._batches
        slopes = RealBatch(component, rates)
        moves = Moves(
            moved,
            places,
            values,
            steps,
            before=(outputs, slopes),
            after=after,
            time=self.time,
            step_size=self.step_size,
        )
        saved = component.save_state()
        try:
            at_rest = self._at_rest(slopes, saved)
            found = answers_to_moves(component, moves, saved)
        finally:
            component.restore_state(saved)
            component.free_state(saved)
        return (found.after, *found.before), at_rest

    def _turns(self, places: NDArray[np.int64], values: Vector, size: float) -> "_Turns":
        """Both directions of each variable, but one alone where a parameter's bounds allow no other."""
        sizes = size * np.maximum(1.0, np.abs(values))
        first, both = np.ones(len(places)), np.ones(len(places), dtype=bool)
        for k in np.flatnonzero(self._bounded[places]).tolist():
            name = self.names[places[k]]
            signs = _allowed_signs(self.component, name, float(values[k]), float(sizes[k]))
            first[k], both[k] = signs[0], len(signs) == 2
        return _Turns(sizes, first, np.flatnonzero(both))

    @cached_property
    def _bounded(self) -> NDArray[np.bool_]:
        """Which variables are parameters."""
        variables = self.component.description.variables
        return np.array([variables[name].causality == "parameter" for name in self.names], bool)

    @cached_property
    def _batches(self) -> tuple[RealBatch, RealBatch, RealBatch]:
        """All variables that are moved, the states, and the outputs."""
        groups = (self.names, self.states, self.exits)
        moved, states, outputs = (RealBatch(self.component, names) for names in groups)
        return moved, states, outputs

    def _at_rest(self, slopes: RealBatch, saved: Any) -> _Read:
        """States after a step, outputs and rates before it where nothing is moved; the component is put back."""
        _, after, outputs = self._batches
        outputs.read()
        slopes.read()
        self.component.step(self.time, self.step_size)
        after.read()
        self.component.restore_state(saved)
        return after.values.copy(), outputs.values.copy(), slopes.values.copy()

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


@dataclass(frozen=True)
class _Turns:
    """How far each variable is moved in its first direction, and those that are moved in the other one as well."""

    sizes: Vector  # of several components alike with a row for each
    first: Vector  # 1 or −1
    both: NDArray[np.int64]

    @property
    def count(self) -> int:
        """Number of moves of a component."""
        return len(self.first) + len(self.both)

    def moves(
        self, places: NDArray[np.int64], values: Vector, steps: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], Vector, NDArray[np.bool_]]:
        """Places, values and whether a step follows: all in the first direction, then some in the other."""
        both, there = self.both, values + self.first * self.sizes
        return (
            np.concatenate([places, places[both]]),
            np.concatenate([there, values[..., both] - self.sizes[..., both]], axis=-1),
            np.concatenate([steps, steps[both]]),
        )

    def quotients(self, answers: Matrix, at_rest: Vector) -> tuple[Matrix, Matrix]:
        """Central difference quotients, and those of the first direction alone; a row for each variable."""
        count, first, both = len(self.first), self.first[:, None], self.both
        at_rest = at_rest[..., None, :]
        width = self.sizes.copy()
        width[..., both] *= 2
        if len(both) == count:
            central = answers[..., :count, :] - answers[..., count:, :]
        else:
            other = np.empty((*answers.shape[:-2], count, answers.shape[-1]))
            other[:] = at_rest
            other[..., both, :] = answers[..., count:, :]
            central = np.subtract(answers[..., :count, :], other, out=other)
        one_sided = answers[..., :count, :] - at_rest
        if (first != 1).any():
            central *= first
            one_sided *= first
        central /= width[..., None]
        one_sided /= self.sizes[..., None]
        return central, one_sided


def _quotients(
    turns: Sequence[_Turns], answers: Sequence[Matrix], at_rest: Sequence[Matrix]
) -> tuple[Differences, ...]:
    """Differences of each size from the answers to all moves, whose rows are those of one size after the other."""
    found, first = [], 0
    for turn in turns:
        own = slice(first, first + turn.count)
        every = zip((batch[..., own, :] for batch in answers), at_rest, strict=True)
        columns, upwards = zip(*(turn.quotients(*one) for one in every), strict=True)
        found.append(Differences(*(np.swapaxes(c, -1, -2) for c in (*columns, *upwards))))
        first += turn.count
    return tuple(found)


def differences_of_alike(
    steps: Sequence[PerturbedStep], sizes: Sequence[float], rates: Sequence[str] = ()
) -> tuple[Differences, ...]:
    """`PerturbedStep.differences_of_sizes` of all variables, for several components at once, as stacks of matrices.

    ``steps``: of components whose variables have the same names in the same order, none of them a parameter."""
    names = steps[0].names
    places, stepped = np.arange(len(names)), np.ones(len(names), dtype=bool)
    values = np.array([step.values() for step in steps])
    turns = [
        _Turns(size * np.maximum(1.0, np.abs(values)), np.ones(len(names)), places)
        for size in sizes
    ]
    each = [turn.moves(places, values, stepped) for turn in turns]
    moved, targets, follow = (np.concatenate(part, axis=-1) for part in zip(*each, strict=True))
    answered = [
        step.answers(moved, own, follow, rates) for step, own in zip(steps, targets, strict=True)
    ]
    answers, at_rest = (
        tuple(np.array(part) for part in zip(*group, strict=True))
        for group in zip(*answered, strict=True)
    )
    return _quotients(turns, answers, at_rest)


def _allowed_signs(component: Component, name: str, value: float, step: float) -> tuple[float, ...]:
    """Directions of a perturbation that stay within a parameter's declared bounds; both, where none does."""
    info = component.description.variables[name]
    above = info.maximum is None or value + step <= info.maximum
    below = info.minimum is None or value - step >= info.minimum
    return tuple(sign for sign, within in ((+1.0, above), (-1.0, below)) if within) or (+1.0, -1.0)

"""Communication steps whose length follows from a tolerance: step doubling.

Each pair of steps is done twice from the same state: as one step of double length, and as two. Their difference
estimates the error of the two (C. Runge; Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, II.4). A
pair whose error is above the tolerance is taken back and done in shorter steps."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import (
    ComponentError,
    CosimError,
    CouplingError,
    EndedError,
    InputError,
)
from orchestrator.systems.coupling.schedule import Schedule
from orchestrator.systems.coupling.statistics import StepCounts
from orchestrator.systems.coupling.tracks import Tracks
from orchestrator.systems.coupling.turns import Exchange, Loop

# of schedules in which inputs follow straight lines: a pair's error falls with this power plus 1
_ORDER = 2
_SAFETY = 0.5  # part of the tolerance that the next pair is aimed at
_SHORTEST = 1 / 1024  # shortest step, as a part of the communication step
_FIRST = 1 / 4  # first pair, and the first after an event, as a part of the communication step
_MOST_HALVINGS = 4  # so often a pair is halved at once, at most
_PROVEN_EVERY = 100  # pairs between two proofs that all components go back to their saved states
# of 1 or an output: what a step may differ by from the same, done again; ``newton`` agrees to 1e-10
_SAME = 1e-8

Values = NDArray[np.float64]


class AdaptiveLoop:
    """Does communication steps in shorter ones, or several in one, as the tolerance has it.

    A step ends at every communication point at which the caller stops: at events, and where something is recorded.
    Between them it has the length of that stretch, halved as often as is needed."""

    def __init__(
        self,
        inner: Loop,
        groups: Sequence[Sequence[Exchange]],
        y: Values,
        tracks: Tracks,
        schedule: Schedule,
        step_size: float,
    ) -> None:
        if schedule.tolerance is None:
            raise ValueError(f"schedule {schedule.name!r} has no tolerance")
        self._inner, self._y, self._tracks, self._tolerance = inner, y, tracks, schedule.tolerance
        self._turns = [exchange for group in groups for exchange in group]
        stuck = [
            t.component.name for t in self._turns if not t.component.description.can_save_state
        ]
        if stuck:
            raise InputError(
                f"tolerance = {self._tolerance:g}: steps that are too long are taken back, and component "
                f"{', '.join(map(repr, stuck))} declares no canGetAndSetFMUstate; leave the tolerance out, and find a "
                "fixed step with `gfor steps`"
            )
        self._communication_step = step_size
        self._pair = step_size * _FIRST
        self._last = step_size  # between the newest outputs and those before
        self._until_proof = 0
        self.counts = StepCounts()
        self.completed = 0

    @property
    def before(self) -> Values | None:
        return self._inner.before

    @before.setter
    def before(self, values: Values | None) -> None:
        self._inner.before = values

    def begin_anew(self) -> None:
        """After an event: what was learnt of the length of steps holds no more."""
        self._pair = min(self._pair, self._communication_step * _FIRST)
        self._until_proof = 0

    def advance(self, index: int, count: int, step_size: float) -> None:
        self.completed, end = 0, index + count
        while index < end:
            # The longest stretch that begins at a whole number of its lengths: then its halves do so too.
            steps = next(n for n in range(end - index, 0, -1) if index % n == 0)
            self._stretch(index // steps, steps * step_size)
            index += steps
            self.completed += steps

    def _stretch(self, index: int, length: float) -> None:
        """Step from ``index``·length to the next multiple of the length [s], in pairs of length/2^m."""
        done, m = 0, max(0, math.ceil(math.log2(length / self._pair) - 1e-9))
        while done < 1 << m:
            pair = length / (1 << m)
            error = self._try((index << m) + done, pair)
            factor = (_SAFETY / max(error, 1e-12)) ** (1 / (_ORDER + 1))
            if error > 1:
                halvings = min(_MOST_HALVINGS, math.ceil(-math.log2(factor)))
                done, m = done << halvings, m + halvings
                self._pair = length / (1 << m)
                continue
            done += 1
            self._pair = 2 * pair if factor >= 2 else pair
            if factor >= 2 and m and not done % 2:
                done, m = done // 2, m - 1

    def _try(self, index: int, pair: float) -> float:
        """Do a pair of steps of this length [s]; it is taken back where its error, in tolerances, is above 1."""
        can_halve = pair / 4 >= _SHORTEST * self._communication_step
        with self._saved() as start:
            try:
                coarse = self._once(index, pair, start)
                if self._until_proof == 0:
                    self._prove(coarse, self._once(index, pair, start), index * pair)
                    self._until_proof = _PROVEN_EVERY
                start.go_back(pair / 2)
                self._inner.advance(2 * index, 1, pair / 2)
                self._last = pair / 2
                self._inner.advance(2 * index + 1, 1, pair / 2)
            except EndedError:
                raise
            except CosimError as error:
                if not can_halve or isinstance(error, _NotTakenBackError):
                    raise
                self._go_back_after(error, start)
                self.counts.rejected += 1
                return float(1 << 3 * (_ORDER + 1))
            apart = np.abs(self._y - coarse) / (2**_ORDER - 1) / np.maximum(1.0, np.abs(self._y))
            error_in_tolerances = float(apart.max(initial=0.0)) / self._tolerance
            if error_in_tolerances <= 1:
                self.counts.accept(2, pair / 2)
                self._until_proof -= 1
                return error_in_tolerances
            if not can_halve:
                turn, variable = self._place(int(apart.argmax()))
                raise CouplingError(
                    f"tolerance = {self._tolerance:g} at {index * pair:.6g} s: in steps of {pair / 2:.3g} s, the "
                    f"shortest, the error of {turn.component.name}.{variable} is still {apart.max():.3g}; give a "
                    "larger tolerance, or a shorter communication step"
                )
            start.go_back(pair)
            self.counts.rejected += 1
            return error_in_tolerances

    def _once(self, index: int, length: float, start: "_Start") -> Values:
        start.go_back(length)
        self._inner.advance(index, 1, length)
        return self._y.copy()

    @staticmethod
    def _go_back_after(error: CosimError, start: "_Start") -> None:
        try:
            start.go_back(start.last)
        except ComponentError:
            raise error from None

    def _prove(self, once: Values, again: Values, time: float) -> None:
        """Refuse components that are not where they were after they went back: then every error is a wrong one."""
        apart = np.abs(once - again) / np.maximum(1.0, np.abs(once))
        if apart.max(initial=0.0) <= _SAME:
            return
        turn, variable = self._place(int(apart.argmax()))
        raise _NotTakenBackError(
            f"tolerance = {self._tolerance:g}: at {time:.6g} s the same step was done twice from the same saved state, "
            f"and {turn.component.name}.{variable} differs by {apart.max():.3g}; some FMU does not restore all of its "
            "state (`gfor fmu check`): leave the tolerance out"
        )

    def _place(self, output: int) -> tuple[Exchange, str]:
        turn = next(t for t in self._turns if t.window.start <= output < t.window.stop)
        return turn, turn.outputs.names[output - turn.window.start]

    @contextmanager
    def _saved(self) -> Iterator["_Start"]:
        states = [turn.component.save_state() for turn in self._turns]
        try:
            yield _Start(self, states)
        finally:
            for turn, state in zip(self._turns, states, strict=True):
                turn.component.free_state(state)

    def seconds(self) -> list[float]:
        return self._inner.seconds()

    @property
    def threads(self) -> int:
        return self._inner.threads

    def close(self) -> None:
        self._inner.close()


class _NotTakenBackError(CouplingError):
    """A component does not go back to its saved state."""


class _Start:
    """Where a pair of steps begins: all components, what they give and take, and the lines of their inputs."""

    def __init__(self, loop: AdaptiveLoop, states: Sequence[Any]) -> None:
        self._loop, self._states = loop, states
        self._y, self._tracks = loop._y.copy(), loop._tracks.saved()
        self._inputs = [turn.inputs.values.copy() for turn in loop._turns]
        before, self.last = loop.before, loop._last
        self._change = None if before is None else self._y - before

    def go_back(self, step: float) -> None:
        """Bring everything back; lines that are extrapolated go on with the slope that they had, over a step [s]."""
        loop = self._loop
        for turn, state, inputs in zip(loop._turns, self._states, self._inputs, strict=True):
            turn.component.restore_state(state)
            turn.inputs.values[:] = inputs
        loop._y[:] = self._y
        loop._tracks.restore(self._tracks)
        loop.before = None if self._change is None else self._y - self._change * (step / self.last)
        loop._last = step

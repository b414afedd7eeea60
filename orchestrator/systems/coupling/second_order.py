"""Communication steps in which inputs follow straight lines: schedules of second order.

A component does its step in parts, each with the input of the part's middle, so that an FMU that only knows held inputs
sees a line. Held over the whole step, a current would hide its rate of change from the network's inductances."""

import ctypes
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.errors import CouplingError, InputError
from orchestrator.core.interrupts import calls
from orchestrator.systems.coupling import compiled_loop
from orchestrator.systems.coupling.compiled_loop import CompiledLoop
from orchestrator.systems.coupling.schedule import Schedule
from orchestrator.systems.coupling.tracks import Tracks
from orchestrator.systems.coupling.turns import Exchange, not_finite

_PASSES = 20  # most exchanges after a step until outputs that depend on inputs directly agree
_REPETITIONS = 12  # most repetitions of a step under ``newton``
# of 1 or of an output: by how much it may differ from what the step was made with, under ``newton``
_AGREED = 1e-10
# A repetition that leaves more than this part of the disagreement asks for new derivatives
_SLOW = 0.1
_UNSETTLED = -2
_NUDGE = 1e-6  # of 1 or of an input: change for the derivatives of a step

Values = NDArray[np.float64]


class _LineLoop:
    threads = 1

    def __init__(
        self, groups: Sequence[Sequence[Exchange]], y: Values, tracks: Tracks, schedule: Schedule
    ) -> None:
        self._groups, self._y, self._tracks, self._schedule = groups, y, tracks, schedule
        self._turns = [exchange for group in groups for exchange in group]
        self._direct = {
            exchange.component.name: exchange.follows_directly for exchange in self._turns
        }
        self._spent = dict.fromkeys(self._direct, 0.0)
        self.before: Values | None = None
        self.completed = 0

    def advance(self, index: int, count: int, step_size: float) -> None:
        self.completed = 0
        for k in range(index, index + count):
            with calls:
                start = self._y.copy()
                self._step(k, step_size, start, start if self.before is None else self.before)
                self.before = start
                for turn in self._turns:
                    bad = self._tracks.follow(turn.window, self._y[turn.window])
                    if bad is not None:
                        raise not_finite(turn.outputs, bad, (k + 1) * step_size)
                self.completed += 1

    def _step(self, index: int, step_size: float, start: Values, before: Values) -> None:
        raise NotImplementedError

    def _walk(
        self, turn: Exchange, index: int, step_size: float, start: Values, end: Values
    ) -> None:
        """Let a component do its step with inputs that go from one value to another."""
        parts = self._schedule.parts(step_size)
        first = start[turn.delivered]
        slope = end[turn.delivered] - first
        part = step_size / parts
        with self._timed(turn):
            for j in range(parts):
                turn.inputs.values[:] = first + slope * ((j + 0.5) / parts)
                turn.inputs.write()
                turn.component.step((index * parts + j) * part, part)

    def _give(self, turn: Exchange, known: Values) -> None:
        with self._timed(turn):
            turn.inputs.values[:] = known[turn.delivered]
            turn.inputs.write()
            turn.outputs.read()

    @contextmanager
    def _timed(self, turn: Exchange) -> Iterator[None]:
        began = perf_counter()
        yield
        self._spent[turn.component.name] += perf_counter() - began

    def settle(self) -> None:
        """Give all components the newest outputs, until those that depend on inputs directly agree."""
        for _ in range(_PASSES):
            changed = False
            for turn in self._turns:
                if np.array_equal(turn.inputs.values, self._y[turn.delivered]):
                    continue
                if self._direct[turn.component.name]:
                    self._give(turn, self._y)
                    changed = True
                else:
                    with self._timed(turn):
                        turn.inputs.values[:] = self._y[turn.delivered]
                        turn.inputs.write()
            if not changed:
                return
        if not np.all(np.isfinite(self._y)):
            return  # said by the tracks
        raise self.unsettled()

    def unsettled(self) -> CouplingError:
        names = ", ".join(name for name, direct in self._direct.items() if direct)
        return CouplingError(
            f"schedule {self._schedule.name!r}: after {_PASSES} exchanges outputs still change with the inputs of the "
            f"same instant; direct feed-through closes a loop through some of {names}: give one of them an output that "
            "is a state, or take gauss-seidel"
        )

    def seconds(self) -> list[float]:
        return list(self._spent.values())

    def close(self) -> None:
        """See `orchestrator.systems.coupling.turns.Loop.close`."""


class MidpointLoop(_LineLoop):
    """Steps a system once, with lines that end at outputs as far as they are known."""

    def _step(self, index: int, step_size: float, start: Values, before: Values) -> None:
        end = 2 * start - before
        for group in self._groups:
            for turn in group:
                self._walk(turn, index, step_size, start, end)
            for turn in group:
                if self._direct[turn.component.name]:
                    self._give(turn, end)
                else:
                    with self._timed(turn):
                        turn.outputs.read()
            for turn in group:
                end[turn.window] = self._y[turn.window]
        self.settle()


class CompiledMidpointLoop(CompiledLoop):
    """The same as `MidpointLoop` in C, to the last bit."""

    def __init__(
        self,
        library: Any,
        groups: Sequence[Sequence[Exchange]],
        y: Values,
        tracks: Tracks,
        schedule: Schedule,
    ) -> None:
        super().__init__(library, groups, y, tracks)
        self._schedule = schedule
        self._lines = MidpointLoop(groups, y, tracks, schedule)
        turns = [exchange for group in groups for exchange in group]
        self._direct = np.array([exchange.follows_directly for exchange in turns], dtype=np.int64)
        self._end = np.empty_like(y)

    def advance(self, index: int, count: int, step_size: float) -> None:
        self.before = np.array(self._y if self.before is None else self.before, dtype=float)
        with calls:
            status: int = self._library.advance_lines(
                ctypes.addressof(self._calls),
                ctypes.addressof(self._groups),
                len(self._groups),
                self._place,
                self._direct.ctypes.data,
                self.before.ctypes.data,
                self._end.ctypes.data,
                len(self._y),
                self._schedule.parts(step_size),
                index,
                count,
                step_size,
                ctypes.addressof(self._failure),
            )
            self.completed = self._failure[0] - index if status else count
        self._judge(status, step_size)

    def _judge(self, status: int, step_size: float) -> None:
        if status == _UNSETTLED:
            raise self._lines.unsettled()
        super()._judge(status, step_size)

    def settle(self) -> None:
        self._lines.settle()


class NewtonLoop(_LineLoop):
    """Repeats each step until its lines end at the outputs that it gives.

    The derivatives of the outputs by the lines' ends come from nudged steps of each component alone. Those of each
    step size are kept as long as the repetitions converge."""

    def __init__(
        self, groups: Sequence[Sequence[Exchange]], y: Values, tracks: Tracks, schedule: Schedule
    ) -> None:
        super().__init__(groups, y, tracks, schedule)
        stuck = [
            t.component.name for t in self._turns if not t.component.description.can_save_state
        ]
        if stuck:
            raise InputError(
                f"schedule 'newton' takes steps back and repeats them: component {', '.join(map(repr, stuck))} "
                "declares no canGetAndSetFMUstate; take midpoint"
            )
        self._solves: dict[float, Any] = {}

    def _step(self, index: int, step_size: float, start: Values, before: Values) -> None:
        saved = [turn.component.save_state() for turn in self._turns]
        try:
            self._repeat(index, step_size, start, before, saved)
        finally:
            for turn, state in zip(self._turns, saved, strict=True):
                turn.component.free_state(state)

    def _repeat(
        self, index: int, step_size: float, start: Values, before: Values, saved: Sequence[Any]
    ) -> None:
        end, last, renewed = 2 * start - before, np.inf, False
        for repetition in range(_REPETITIONS):
            if repetition:
                self._take_back(saved)
            for turn in self._turns:
                self._walk(turn, index, step_size, start, end)
            for turn in self._turns:
                self._give(turn, end)
            apart = self._y - end
            size = float((np.abs(apart) / np.maximum(1.0, np.abs(self._y))).max(initial=0.0))
            if not np.isfinite(size) or size <= _AGREED:
                return
            solve = self._solves.get(step_size)
            if solve is None or (size > _SLOW * last and repetition > 1 and not renewed):
                self._take_back(saved)
                renewed, solve = True, self._derivatives(index, step_size, start, saved)
                self._solves[step_size] = solve
            end, last = end + solve(apart), size
        worst = int(np.argmax(np.abs(apart)))
        turn = next(t for t in self._turns if t.window.start <= worst < t.window.stop)
        raise CouplingError(
            f"schedule 'newton' at {index * step_size:.6g} s: after {_REPETITIONS} repetitions of the step "
            f"{turn.component.name}.{turn.outputs.names[worst - turn.window.start]} still differs by "
            f"{apart[worst]:.3g} from what the step was made with; take a shorter step"
        )

    def _take_back(self, saved: Sequence[Any]) -> None:
        for turn, state in zip(self._turns, saved, strict=True):
            with self._timed(turn):
                turn.component.restore_state(state)

    def _derivatives(
        self, index: int, step_size: float, start: Values, saved: Sequence[Any]
    ) -> Any:
        """A solver for (1 − J)·x = b, J being the outputs' derivatives by the ends of the lines; states are left as
        saved."""
        rows, columns, values = [], [], []
        for turn, state in zip(self._turns, saved, strict=True):
            if not turn.outputs.names:
                continue

            def outputs(end: Values, turn: Exchange = turn, state: Any = state) -> Values:
                self._walk(turn, index, step_size, start, end)
                self._give(turn, end)
                turn.component.restore_state(state)
                return turn.outputs.values.copy()

            plain = outputs(start)
            for source in dict.fromkeys(turn.delivered.tolist()):
                nudge = _NUDGE * max(1.0, abs(start[source]))
                end = start.copy()
                end[source] += nudge
                slope = (outputs(end) - plain) / nudge
                kept = np.flatnonzero(slope)
                rows.append(turn.window.start + kept)
                columns.append(np.full(len(kept), source))
                values.append(slope[kept])
        n = len(start)
        if not rows:
            return lambda b: b
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        return spla.splu(sp.csc_array(sp.eye_array(n) - sp.coo_array(entries, shape=(n, n)))).solve


def line_loop(
    groups: Sequence[Sequence[Exchange]], y: Values, tracks: Tracks, schedule: Schedule
) -> MidpointLoop | CompiledMidpointLoop | NewtonLoop:
    if schedule.coupling == "newton":
        return NewtonLoop(groups, y, tracks, schedule)
    library = compiled_loop.loop_library()
    if library is None:
        return MidpointLoop(groups, y, tracks, schedule)
    return CompiledMidpointLoop(library, groups, y, tracks, schedule)

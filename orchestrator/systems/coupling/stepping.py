"""Communication steps: values are exchanged and components step along a schedule.

The inner loop is in C, where one call does many steps. Where no library can be compiled for the platform, and for what
is special about other masters' steps, it is Python."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.interrupts import calls
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.systems.coupling import compiled_loop
from orchestrator.systems.coupling.adaptive import AdaptiveLoop
from orchestrator.systems.coupling.compiled_loop import CompiledLoop
from orchestrator.systems.coupling.coupled import CoupledComponents, open_plan
from orchestrator.systems.coupling.noted_steps import NotedSteps
from orchestrator.systems.coupling.schedule import Schedule
from orchestrator.systems.coupling.second_order import line_loop
from orchestrator.systems.coupling.statistics import ComponentStatistics, StepStatistics
from orchestrator.systems.coupling.system import ComponentPlan, System
from orchestrator.systems.coupling.tracks import Tracks
from orchestrator.systems.coupling.turns import Loop, Turn, not_finite
from orchestrator.systems.coupling.wire_bank import WireBank


class PythonLoop:
    threads = 1

    def __init__(
        self,
        groups: Sequence[Sequence[Turn]],
        y: NDArray[np.float64],
        tracks: Tracks,
        schedule: Schedule,
        hand_over: Callable[[], None] | None = None,
    ) -> None:
        self._groups, self._y, self._tracks, self._hand_over = groups, y, tracks, hand_over
        self._extrapolation, self._ticks_per_second = (
            schedule.extrapolation,
            schedule.ticks_per_second,
        )
        self.before: NDArray[np.float64] | None = None
        self._spent = [[0.0] * len(group) for group in groups]
        self.completed = 0

    def advance(self, index: int, count: int, step_size: float) -> None:
        self.completed = 0
        for k in range(index, index + count):
            with calls:
                self._step(*self._interval(k, step_size))
                self.completed += 1

    def _step(self, time: float, size: float) -> None:
        known = self._extrapolated() if self._extrapolation else self._y
        if self._hand_over is not None:
            self._hand_over()
        for group, spent in zip(self._groups, self._spent, strict=True):
            for i, exchange in enumerate(group):
                np.take(known, exchange.delivered, out=exchange.inputs.values, mode="clip")
                start = perf_counter()
                component = exchange.component
                if exchange.inputs.names and self._hand_over is None:
                    component.check(
                        component.set_real(*exchange.inputs.arguments), "fmi2SetReal", time
                    )
                component.step(time, size)
                spent[i] += perf_counter() - start
            for i, exchange in enumerate(group):
                start = perf_counter()
                if exchange.outputs.names:
                    component = exchange.component
                    component.check(
                        component.get_real(*exchange.outputs.arguments), "fmi2GetReal", time
                    )
                known[exchange.window] = exchange.outputs.values
                spent[i] += perf_counter() - start
                bad = self._tracks.follow(exchange.window, exchange.outputs.values)
                if bad is not None:
                    raise not_finite(exchange.outputs, bad, time + size)

    def _interval(self, index: int, step_size: float) -> tuple[float, float]:
        if self._ticks_per_second is None:
            return index * step_size, step_size
        ticks = round(step_size * self._ticks_per_second)
        time = index * ticks / self._ticks_per_second
        return time, (index + 1) * ticks / self._ticks_per_second - time

    def _extrapolated(self) -> NDArray[np.float64]:
        """All outputs as they would go on rising; what has stepped since then is overwritten group by group."""
        known = self._y + self._extrapolation * (
            self._y - (self._y if self.before is None else self.before)
        )
        self.before = self._y.copy()
        return known

    def seconds(self) -> list[float]:
        return [seconds for group in self._spent for seconds in group]

    def close(self) -> None:
        """See `Loop.close`."""


def make_loop(
    groups: Sequence[Sequence[Turn]],
    y: NDArray[np.float64],
    tracks: Tracks,
    schedule: Schedule,
    hand_over: Callable[[], None] | None = None,
    threads: int | None = 1,
) -> Loop:
    """The compiled loop where there is one and it can do what is asked, else the loop in Python."""
    library = compiled_loop.loop_library() if schedule.is_plain else None
    if library is None:
        return PythonLoop(groups, y, tracks, schedule, hand_over)
    return CompiledLoop(library, groups, y, tracks, threads)


class Stepper(CoupledComponents):
    def __init__(
        self,
        system: System,
        schedule: Schedule,
        step_size: float,
        stop_time: float | None = None,
        opener: Callable[[str, ComponentPlan, Path], Component] = open_plan,
        threads: int | None = 1,
    ) -> None:
        self.index = 0
        super().__init__(system, schedule, step_size, stop_time, opener)
        self._single = self._single_wires() if schedule.wire_by_wire else []
        self.handed_over = False
        self.tracks = Tracks(len(self.y), len(self._values) - len(self.y))
        hand_over = self._hand_over if self._single else None
        self._loop: Loop
        self._adaptive: AdaptiveLoop | None = None
        if schedule.is_second_order:
            groups = [[self.exchanges[name] for name in group] for group in schedule.groups]
            self._loop = self._lines = line_loop(groups, self.y, self.tracks, schedule)
            if schedule.tolerance is not None:
                self._loop = self._adaptive = AdaptiveLoop(
                    self._lines, groups, self.y, self.tracks, schedule, step_size
                )
        else:
            self._loop = make_loop(
                self._turns(), self._values, self.tracks, schedule, hand_over, threads
            )
        self._release.callback(self._loop.close)

    def _turns(self) -> list[list[Turn]]:
        """Groups of the schedule, each after the bank of connections that lead into it where there is one."""
        turns: list[list[Turn]] = []
        for group, bank in zip(self.schedule.groups, self.wires.banks, strict=True):
            if bank is not None:
                turns.append([bank])
            turns.append([self.exchanges[name] for name in group])
        return turns

    def _single_wires(self) -> list[tuple[RealBatch, RealBatch]]:
        """Source and target of every connection by themselves, sharing their value."""
        wires = []
        for wire in self.system.connections:
            source = RealBatch(self.components[wire.source.component], [wire.source.variable])
            target = RealBatch(
                self.components[wire.target.component], [wire.target.variable], source.values
            )
            wires.append((source, target))
        return wires

    @property
    def time(self) -> float:
        return self.clock.time(self.index)

    def rows_of_steps(self, batches: Sequence[RealBatch], most: int) -> NotedSteps | None:
        """See `ObservedRun.rows_of_steps`."""
        loop = self._loop
        if not isinstance(loop, CompiledLoop) or self.schedule.is_second_order:
            return None
        if loop.rows is not None and loop.rows.address is not None:
            return None
        loop.rows = NotedSteps(batches, most, self.clock.time)
        return loop.rows

    def exchange(self) -> None:
        """Send every component the newest outputs of its partners, all at once or as the schedule has it."""
        for source, target in self._single:
            source.read()
            target.write()
        if not self._single:
            for name in self.components:
                self.exchange_inputs(name)
        self.handed_over = True

    def _hand_over(self) -> None:
        """Exchange before a step, unless an observer had it done: wire by wire, a second time gives other values."""
        if not self.handed_over:
            self.exchange()
        self.handed_over = False

    def advance(self, count: int) -> None:
        if self.wires:
            for index, part in self.wires.stretches(self.index, count):
                self._advance(index, part)
        else:
            self._advance(self.index, count)

    def _advance(self, index: int, count: int) -> None:
        try:
            self._loop.advance(index, count, self.clock.step_size)
        finally:
            self.index += self._loop.completed

    @property
    def before(self) -> NDArray[np.float64] | None:
        """The outputs one step earlier, where inputs are extrapolated."""
        return self._loop.before

    @before.setter
    def before(self, values: NDArray[np.float64] | None) -> None:
        self._loop.before = values

    def jumped(self, y: NDArray[np.float64]) -> None:
        """After an event: where inputs follow lines, all outputs agree again, and the lines go on from the jump."""
        if self.schedule.is_second_order:
            self._lines.settle()
            if self._loop.before is not None:
                self._loop.before = self._loop.before + (self.y - y)
        if self._adaptive is not None:
            self._adaptive.begin_anew()

    def seconds(self) -> Sequence[float]:
        """Wall-clock time inside each turn's calls so far [s], in the order of the schedule."""
        return self._loop.seconds()

    def statistics(self, steps: int, seconds: float, before: Sequence[float]) -> StepStatistics:
        names = [name for group in self.schedule.groups for name in group]
        spent = [after - then for after, then in zip(self.seconds(), before, strict=True)]
        if self.wires:  # the banks' own share is none of a component
            banks = [isinstance(turn, WireBank) for group in self._turns() for turn in group]
            spent = [seconds for seconds, of_bank in zip(spent, banks, strict=True) if not of_bank]
        threads = self._loop.threads
        adaptive = None if self._adaptive is None else replace(self._adaptive.counts)
        reasons = {name: c.one_thread for name, c in self.components.items() if c.one_thread}
        return StepStatistics(
            steps if adaptive is None else adaptive.accepted,
            seconds,
            components=tuple(
                ComponentStatistics(n, steps, s, s / (threads * seconds))
                for n, s in zip(names, spent, strict=True)
            ),
            simulated=self.clock.time(steps),
            threads=threads,
            one_thread=reasons,
            adaptive=adaptive,
        )

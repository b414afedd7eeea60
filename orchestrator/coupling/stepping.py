"""Communication steps: values are exchanged and components step along a schedule."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.coupling.adaptive import AdaptiveLoop
from orchestrator.coupling.coupled import CoupledComponents, open_plan
from orchestrator.coupling.loop import make_loop
from orchestrator.coupling.schedule import Schedule
from orchestrator.coupling.second_order import line_loop
from orchestrator.coupling.statistics import ComponentStatistics, StepStatistics
from orchestrator.coupling.system import ComponentPlan, System
from orchestrator.coupling.tracks import Tracks
from orchestrator.coupling.turns import Loop, Turn
from orchestrator.coupling.wire_bank import WireBank
from orchestrator.fmi.component import Component, RealBatch


class Stepper(CoupledComponents):
    def __init__(
        self, system: System, schedule: Schedule, step_size: float, stop_time: float | None = None,
        opener: Callable[[str, ComponentPlan, Path], Component] = open_plan, threads: int | None = 1,
    ) -> None:  # fmt: skip
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
            self._loop = make_loop(self._turns(), self._values, self.tracks, schedule, hand_over, threads)
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
            target = RealBatch(self.components[wire.target.component], [wire.target.variable], source.values)
            wires.append((source, target))
        return wires

    @property
    def time(self) -> float:
        return self.clock.time(self.index)

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
        return StepStatistics(
            steps if adaptive is None else adaptive.accepted, seconds,
            tuple(ComponentStatistics(n, steps, s, s / (threads * seconds)) for n, s in zip(names, spent, strict=True)),
            self.clock.time(steps), threads,
            {name: reason for name, c in self.components.items() if (reason := c.one_thread)}, adaptive,
        )  # fmt: skip

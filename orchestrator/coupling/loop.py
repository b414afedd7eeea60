"""The inner loop of the master: in C, where one call does many communication steps, or in Python.

Where no library can be compiled for the platform, and for what is special about other masters' steps, it is Python."""

from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from orchestrator.coupling import compiled_loop
from orchestrator.coupling.compiled_loop import CompiledLoop
from orchestrator.coupling.schedule import Schedule
from orchestrator.coupling.tracks import Tracks
from orchestrator.coupling.turns import Loop, Turn, not_finite
from orchestrator.fmi.interrupts import calls


class PythonLoop:
    threads = 1

    def __init__(
        self, groups: Sequence[Sequence[Turn]], y: NDArray[np.float64], tracks: Tracks, schedule: Schedule,
        hand_over: Callable[[], None] | None = None,
    ) -> None:  # fmt: skip
        self._groups, self._y, self._tracks, self._hand_over = groups, y, tracks, hand_over
        self._extrapolation, self._ticks_per_second = schedule.extrapolation, schedule.ticks_per_second
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
                    component.check(component.set_real(*exchange.inputs.arguments), "fmi2SetReal", time)
                component.step(time, size)
                spent[i] += perf_counter() - start
            for i, exchange in enumerate(group):
                start = perf_counter()
                if exchange.outputs.names:
                    component = exchange.component
                    component.check(component.get_real(*exchange.outputs.arguments), "fmi2GetReal", time)
                known[exchange.window] = exchange.outputs.values
                spent[i] += perf_counter() - start
                bad = self._tracks.follow(exchange.window, exchange.outputs.values)
                if bad is not None:
                    raise not_finite(exchange.outputs, bad, time + size)

    def _interval(self, index: int, step_size: float) -> tuple[float, float]:
        """Time and size of a step [s]."""
        if self._ticks_per_second is None:
            return index * step_size, step_size
        ticks = round(step_size * self._ticks_per_second)
        time = index * ticks / self._ticks_per_second
        return time, (index + 1) * ticks / self._ticks_per_second - time

    def _extrapolated(self) -> NDArray[np.float64]:
        """All outputs as they would go on rising; what has stepped since then is overwritten group by group."""
        known = self._y + self._extrapolation * (self._y - (self._y if self.before is None else self.before))
        self.before = self._y.copy()
        return known

    def seconds(self) -> list[float]:
        return [seconds for group in self._spent for seconds in group]

    def close(self) -> None:
        """See `Loop.close`."""


def make_loop(
    groups: Sequence[Sequence[Turn]], y: NDArray[np.float64], tracks: Tracks, schedule: Schedule,
    hand_over: Callable[[], None] | None = None, threads: int | None = 1,
) -> Loop:  # fmt: skip
    """The compiled loop where there is one and it can do what is asked, else the loop in Python."""
    library = compiled_loop.loop_library() if schedule.is_plain else None
    if library is None:
        return PythonLoop(groups, y, tracks, schedule, hand_over)
    return CompiledLoop(library, groups, y, tracks, threads)

"""Observers watch a run from outside: recording, progress and anything a user adds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from orchestrator.devices.fmi.component import Component, RealBatch
    from orchestrator.systems.coupling.noted_steps import NotedSteps
    from orchestrator.systems.coupling.tracks import Tracks


class ObservedRun(Protocol):
    """The view that an observer has of a run; the master is one."""

    @property
    def index(self) -> int:
        """Number of communication steps done."""

    @property
    def time(self) -> float:
        """Present time [s]."""

    @property
    def components(self) -> Mapping[str, Component]: ...

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names ``component.variable`` of the coupled outputs, in the order of y."""

    @property
    def y(self) -> NDArray[np.float64]:
        """All coupled outputs, shape (n,), as last exchanged."""

    @property
    def tracks(self) -> Tracks:
        """Where each coupled output went, step by step, since an observer last looked."""

    def rows_of_steps(self, batches: Sequence[RealBatch], most: int) -> NotedSteps | None:
        """Return what the inner loop will read after each step from now on, at most so many steps before it is taken.

        None where the loop cannot, or does it for another observer: then one has to look after each step."""

    def exchange(self) -> None:
        """Hand every component the newest outputs of its partners."""


class Observer(Protocol):
    """Called by the master at communication points."""

    every: int  # number of communication steps between two calls of `observe`

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        """Called once, when the run is about to start."""

    def observe(self, run: ObservedRun) -> None:
        """Called at the first communication point and after every ``every`` steps."""

    def end(self, run: ObservedRun) -> None:
        """Called once, also after a failure; what was observed so far must survive."""


class Progress:
    """Calls ``report(done, total)`` with communication steps every so often."""

    def __init__(self, report: Callable[[int, int], None], every: int = 2000) -> None:
        self.every = every
        self._report = report
        self._total = 0

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        self._total = stop_index

    def observe(self, run: ObservedRun) -> None:
        self._report(run.index, self._total)

    def end(self, run: ObservedRun) -> None:
        self._report(run.index, self._total)

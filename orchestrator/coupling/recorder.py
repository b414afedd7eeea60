"""Recording of variables at regular communication points."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.coupling.observers import ObservedRun
from orchestrator.errors import InputError
from orchestrator.fmi.component import RealBatch


class Recorder:
    """Records variables named ``component.variable``.

    Parameters
    ----------
    after_exchange
        Hand every component the newest outputs of its partners before anything is read; else outputs are recorded as
        they were read at the end of the step, with the inputs that were held in it.

    Attributes
    ----------
    times
        [s], shape (n,).
    values
        Shape (n, number of names), in the order of ``names``; only what was reached before a failure.
    """

    def __init__(self, names: Sequence[str], every: int, *, after_exchange: bool = False) -> None:
        self.names = tuple(names)
        self.every = every
        self.after_exchange = after_exchange
        self._count = 0
        self._times = np.empty(0)
        self._values = np.empty((0, len(self.names)))
        self._batches: list[tuple[RealBatch, NDArray[np.intp]]] = []

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the recorded rows [s]."""
        return self._times[: self._count]

    @property
    def values(self) -> NDArray[np.float64]:
        """Recorded values, a row for each time and a column for each name."""
        return self._values[: self._count]

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        """See `Observer.begin`."""
        by_component: dict[str, list[tuple[int, str]]] = {}
        for column, name in enumerate(self.names):
            component, _, variable = name.partition(".")
            if component not in run.components or variable not in run.components[component].description.variables:
                raise InputError(f"cannot record {name!r}: there is no such variable; `gfor info` lists them")
            by_component.setdefault(component, []).append((column, variable))
        self._batches = [
            (
                RealBatch(run.components[component], [v for _, v in entries]),
                np.array([c for c, _ in entries]),
            )
            for component, entries in by_component.items()
        ]
        rows = (stop_index - run.index) // self.every + 2
        self._count = 0
        self._times = np.empty(rows)
        self._values = np.empty((rows, len(self.names)))

    def observe(self, run: ObservedRun) -> None:
        """See `Observer.observe`."""
        if self.after_exchange:
            run.exchange()
        self._times[self._count] = run.time
        row = self._values[self._count]
        for batch, columns in self._batches:
            row[columns] = batch.read()
        self._count += 1

    def end(self, run: ObservedRun) -> None:
        """Nothing to do: what was recorded stays."""

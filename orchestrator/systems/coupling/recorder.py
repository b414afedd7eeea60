"""Recording of variables at regular communication points; rows go on in blocks (`recording_blocks`)."""

from collections.abc import Mapping, Sequence
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.systems.coupling.observers import ObservedRun
from orchestrator.systems.coupling.recording_blocks import (
    PATIENCE,
    MemoryRows,
    RowSink,
    patience_after,
    rows_of_block,
)


class Recorder:
    """Records variables named ``component.variable``.

    Rows are collected in a block. A full block, or one that waited for `PATIENCE`, is handed to the sink, such as a
    folder on the disk; so the memory that is needed does not grow with the run, but for the rows that are kept.

    ``every``: Communication steps between two rows.
    ``after_exchange``: Hand every component the newest outputs of its partners before anything is read; else outputs
    are recorded as they were read at the end of the step, with the inputs that were held in it.
    ``keep``: Each ``keep``-th row stays in memory, beginning with the first.

    ``times``: [s], shape (n,), of the rows that are kept.
    ``values``: Shape (n, number of names), in the order of ``names``; only what was reached before a failure."""

    def __init__(
        self,
        names: Sequence[str],
        every: int,
        *,
        after_exchange: bool = False,
        sink: RowSink | None = None,
        keep: int = 1,
    ) -> None:
        self.names = tuple(names)
        self.every = every
        self.after_exchange = after_exchange
        self.keep = keep
        self._sink = sink
        self._kept = MemoryRows(len(self.names), keep)
        self._first = self._filled = self._handed = 0
        self._times, self._block = np.empty(0), np.empty((0, len(self.names)))
        self._last_index = -1
        self._since = monotonic()
        self._position: Mapping[str, Any] | None = None
        self._failed = False
        self._patience = PATIENCE
        self._batches: list[tuple[RealBatch, NDArray[np.intp]]] = []

    @property
    def times(self) -> NDArray[np.float64]:
        return self._kept.joined(
            self._first, self._times[: self._filled], self._block[: self._filled]
        )[0]

    @property
    def values(self) -> NDArray[np.float64]:
        return self._kept.joined(
            self._first, self._times[: self._filled], self._block[: self._filled]
        )[1]

    @property
    def rows(self) -> int:
        return self._first + self._filled

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        by_component: dict[str, list[tuple[int, str]]] = {}
        for column, name in enumerate(self.names):
            component, _, variable = name.partition(".")
            if (
                component not in run.components
                or variable not in run.components[component].description.variables
            ):
                raise InputError(
                    f"cannot record {name!r}: there is no such variable; `gfor fmu info` lists them"
                )
            by_component.setdefault(component, []).append((column, variable))
        self._batches = []
        for component, entries in by_component.items():
            columns, variables = zip(*entries, strict=True)
            batch = RealBatch(run.components[component], list(variables))
            self._batches.append((batch, np.array(columns)))
        self._allocate((stop_index - run.index) // self.every + 2)
        self._first = self._filled = self._handed = 0
        self._last_index, self._failed = -1, False
        self._kept.clear()
        if self._position is not None:
            self._take_up(self._position)
        elif self._sink is not None:
            self._sink.begin(self.names)
        self._since = monotonic()

    def _allocate(self, expected: int) -> None:
        rows = rows_of_block(len(self.names))
        if self._position is None:
            rows = min(rows, expected)
        self._times, self._block = np.empty(rows), np.empty((rows, len(self.names)))

    def observe(self, run: ObservedRun) -> None:
        if run.index == self._last_index:
            return  # taken up again where this row was recorded already
        if self.after_exchange:
            run.exchange()
        self._last_index = run.index
        self._read(self._block[self._filled])
        self._add(run.time)

    def _read(self, row: NDArray[np.float64]) -> None:
        for batch, columns in self._batches:
            row[columns] = batch.read()

    def _add(self, time: float) -> None:
        """Count a row [s] whose values are in the block."""
        self._times[self._filled] = time
        self._filled += 1
        waited = self._sink is not None and monotonic() - self._since > self._patience
        if waited or self._filled == len(self._times):
            self._hand_over()

    def _hand_over(self) -> None:
        """Give the sink what it does not have yet; begin a new block after a full one."""
        if self._failed:
            return  # it was said once
        times, values = self._times[: self._filled], self._block[: self._filled]
        if self._sink is not None and self._handed < self._filled:
            self._failed, begin = True, monotonic()
            self._sink.keep(self._first, times, values)
            self._failed, self._patience = False, patience_after(monotonic() - begin)
        self._handed = self._filled
        if self._filled == len(self._times):
            self._kept.keep(self._first, times, values)
            self._first += self._filled
            self._filled = self._handed = 0
        self._since = monotonic()

    def end(self, run: ObservedRun) -> None:
        self._hand_over()

    def position(self) -> dict[str, Any]:
        """Where the recording stands, with all rows handed to the sink; without one, the rows themselves.

        Beside ``rows`` and ``block`` (rows of a block) the communication step of the last row; without a sink also
        ``times`` and ``values``, which need ``keep`` = 1."""
        self._hand_over()
        found: dict[str, Any] = {
            "rows": self.rows,
            "index": self._last_index,
            "block": len(self._times),
        }
        if self._sink is None:
            found |= {"times": self.times.copy(), "values": self.values.copy()}
        return found

    def resume(self, position: Mapping[str, Any]) -> None:
        """Go on from a position at the next `begin`; the sink forgets the rows after it."""
        self._position = position

    def _take_up(self, position: Mapping[str, Any]) -> None:
        rows, block = int(position["rows"]), int(position["block"])
        self._times, self._block = np.empty(block), np.empty((block, len(self.names)))
        if self._sink is not None:
            blocks = self._sink.resume(self.names, rows)
        else:
            blocks = iter([(0, np.asarray(position["times"]), np.asarray(position["values"]))])
        for _, times, values in blocks:
            for begin in range(0, len(times), block):
                part = slice(begin, begin + block)
                self._refill(times[part], values[part])
        self._handed = self._filled
        self._last_index = int(position["index"])
        self._position = None

    def _refill(self, times: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        count = len(times)
        self._times[:count], self._block[:count] = times, values
        self._filled = count
        if count == len(self._times):
            self._kept.keep(self._first, times, values)
            self._first, self._filled = self._first + count, 0

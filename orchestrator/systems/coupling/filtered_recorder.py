"""Recording at longer intervals without aliases: every step is read and goes through a low-pass filter."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.systems.coupling.noted_steps import NotedSteps
from orchestrator.systems.coupling.observers import ObservedRun
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.recording_blocks import RowSink

PASS_BAND = 0.4  # frequency up to which the filter lets all pass [1/interval]
STOP_BAND = 0.5  # frequency from which on it takes all away [1/interval]: half the sampling rate
_HALF = 25  # the filter reaches so many intervals to both sides
_BETA = 7.857  # of the Kaiser window: 80 dB

FILTER = (
    f"symmetric FIR filter over all steps of {_HALF} intervals to both sides, Kaiser window with beta = {_BETA:g}; "
    f"passes up to {PASS_BAND:g}/interval, stops from {STOP_BAND:g}/interval on (80 dB), no delay"
)
"""What a row is made by, in words."""

# steps whose values are kept until they are added to the rows that they are part of
_READ = 256  # at most, in whole intervals; a longer interval is one by itself
_MOST_READ = 1024  # of a longer interval


class FilteredRecorder(Recorder):
    """Records a weighted mean of all steps around each row, by a symmetric filter of finite length.

    Its delay is 0: a row at t is made of what was within 25 intervals before and after t. Before the start and after
    the end the first and the last values are taken to hold. What jumps shows beforehand, too, as small ripples.

    ``keep``: each ``keep``-th row stays in memory."""

    def __init__(
        self, names: Sequence[str], interval: int, *, sink: RowSink | None = None, keep: int = 1
    ) -> None:
        super().__init__(names, 1, sink=sink, keep=keep)
        self.interval = interval
        self._weights, self._sums_of_weights = np.empty(0), np.empty(0)
        self._input = np.empty((0, 0))
        self._unread: NotedSteps | None = None
        self._order: NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self._inputs_before = self._inputs = self._next = 0
        self._first_values = self._last_values = np.empty(0)
        self._pending: dict[int, NDArray[np.float64]] = {}
        self._pending_times: dict[int, float] = {}

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        resumed, self.every = self._position, 1
        super().begin(run, stop_index)
        from scipy.signal import firwin  # noqa: PLC0415 - a quarter of a second that few need

        self._half = _HALF * self.interval
        cutoff = (PASS_BAND + STOP_BAND) / self.interval  # in parts of half the sampling frequency
        count = 2 * self._half + 1
        self._weights = (
            firwin(count, cutoff, window=("kaiser", _BETA))
            if self.interval > 1
            else np.zeros(count)
        )
        if self.interval == 1:
            self._weights[self._half] = 1.0
        self._sums_of_weights = np.concatenate([[0.0], np.cumsum(self._weights)])
        read = self.interval * max(1, _READ // self.interval)
        self._input = np.empty((min(_MOST_READ, read), len(self.names)))
        self._let_the_loop_read(run)
        self._inputs_before = self._inputs = self._next = 0
        self._pending, self._pending_times = {}, {}
        if resumed is not None:
            self._restore(resumed)

    def _let_the_loop_read(self, run: ObservedRun) -> None:
        """Look at a block of steps at once where the loop reads after each of them."""
        self._unread = run.rows_of_steps([batch for batch, _ in self._batches], len(self._input))
        if self._unread is None:
            return
        self.every = len(self._input)
        columns = [number for _, of_batch in self._batches for number in of_batch]
        self._order = np.argsort(columns)

    def observe(self, run: ObservedRun) -> None:
        self._take_unread()
        if run.index == self._last_index:
            return  # read with those before it, or before the run was taken up again
        row = np.empty((1, len(self.names)))
        self._read(row[0])
        self._add_steps(row, [run.time])
        self._last_index = run.index

    def _take_unread(self) -> None:
        """Add the steps that the loop read."""
        if self._unread is None:
            return
        indices, times, rows = self._unread.take()
        if indices:
            self._add_steps(rows[:, self._order], times)
            self._last_index = indices[-1]

    def _add_steps(self, rows: NDArray[np.float64], times: Sequence[float]) -> None:
        """Add steps, shape (steps, variables), in as many blocks as they fill."""
        begin = 0
        while begin < len(rows):
            number = self._inputs_before + self._inputs
            part = rows[begin : begin + len(self._input) - self._inputs]
            self._input[self._inputs : self._inputs + len(part)] = part
            if number == 0:
                self._first_values = part[0].copy()
            for k in range(-number % self.interval, len(part), self.interval):
                self._pending_times[(number + k) // self.interval] = times[begin + k]
            self._inputs += len(part)
            begin += len(part)
            if self._inputs == len(self._input):
                self._take_in()

    def _take_in(self) -> None:
        """Add what was read to the rows that it is part of, and record those that are complete."""
        first, values = self._inputs_before, self._input[: self._inputs]
        after = first + len(values)
        if not len(values):
            return
        for number in range(self._next, (after - 1 + self._half) // self.interval + 1):
            begin = number * self.interval - self._half
            if number not in self._pending:
                self._pending[number] = self._first_values * self._sums_of_weights[max(0, -begin)]
            low, high = max(first, begin), min(after, begin + len(self._weights))
            if low < high:
                self._pending[number] += (
                    self._weights[low - begin : high - begin] @ values[low - first : high - first]
                )
        self._last_values = values[-1].copy()
        self._inputs_before, self._inputs = after, 0
        while self._next * self.interval + self._half < after:
            self._record(self._pending.pop(self._next))

    def _record(self, values: NDArray[np.float64]) -> None:
        self._block[self._filled] = values
        time = self._pending_times.pop(self._next)
        self._next += 1
        self._add(time)

    def end(self, run: ObservedRun) -> None:
        """Record the last rows, as if the last values went on."""
        self._take_unread()
        if self._unread is not None:
            self._unread.close()
        self._take_in()
        for number in sorted(self._pending_times):
            missing = number * self.interval + self._half + 1 - self._inputs_before
            self._record(
                self._pending.pop(number) + self._last_values * self._sums_of_weights[missing]
            )
        super().end(run)

    def position(self) -> dict[str, Any]:
        """Position as `Recorder.position` gives it, with the rows that are not complete."""
        self._take_unread()
        numbers = sorted(self._pending)
        sums = np.array([self._pending[n] for n in numbers]).reshape(len(numbers), len(self.names))
        times = np.array([[n, t] for n, t in sorted(self._pending_times.items())]).reshape(-1, 2)
        return super().position() | {
            "filter_numbers": np.array(numbers),
            "filter_sums": sums,
            "filter_times": times,
            "filter_next": self._next,
            "filter_read": self._inputs_before,
            "filter_input": self._input[: self._inputs].copy(),
            "filter_first": self._first_values.copy(),
            "filter_last": self._last_values.copy(),
        }

    def _restore(self, position: Mapping[str, Any]) -> None:
        numbers, sums = (
            np.asarray(position["filter_numbers"]).tolist(),
            np.asarray(position["filter_sums"]),
        )
        self._pending = {int(n): row.copy() for n, row in zip(numbers, sums, strict=True)}
        self._pending_times = {
            int(n): float(t) for n, t in np.asarray(position["filter_times"]).reshape(-1, 2)
        }
        self._next, self._inputs_before = int(position["filter_next"]), int(position["filter_read"])
        values = np.asarray(position["filter_input"])
        self._inputs = len(values)
        self._input[: self._inputs] = values
        self._first_values = np.asarray(position["filter_first"])
        self._last_values = np.asarray(position["filter_last"])

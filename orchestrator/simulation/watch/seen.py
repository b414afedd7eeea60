"""The data of a run that the watch judges: signals at regular looks, and the extremes of the coupled outputs between
two looks."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError
from orchestrator.devices.binding.misfits import FREQUENCY_APART, Misfit
from orchestrator.systems.coupling.observers import ObservedRun
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.system import System

# about the time between two looks [s]; extremes of coupled outputs show what happens between
LOOK_INTERVAL = 5e-3
MOST_LOOKS = 20_000  # largest number of looks; in longer runs the looks are farther apart


_AT_REST = 0.05  # time at the start in which a slip moves the current [s]
_STILL = 0.2  # part of the current by which a slip moves it at least

_SETTLED = 1e-4  # distance of omega from its rest [pu] at which a meter has settled


_DECIMALS = 4  # of the time of a look [s]


@dataclass(frozen=True)
class Seen:
    times: Numbers  # of the looks [s], shape (n,)
    # signals by ``component.variable``, each of shape (n,): the recorded signals, and those that the watch reads in
    # addition.
    values: Mapping[str, Numbers]
    # last, low, high, turns: arrays of shape (n,) by coupled output: its value, its extremes over all communication
    # steps since the previous look, and the number of its turns.
    last: Mapping[str, Numbers]
    low: Mapping[str, Numbers]
    high: Mapping[str, Numbers]
    turns: Mapping[str, Numbers]

    def until(self, time: float) -> "Seen":
        count = int(np.searchsorted(self.times, time * (1 + 1e-12), side="right"))
        if count == len(self.times):
            return self
        parts = (self.values, self.last, self.low, self.high, self.turns)
        return Seen(
            self.times[:count], *({name: y[:count] for name, y in part.items()} for part in parts)
        )

    def moment(self, look: int) -> float:
        """Return the time of a look [s], as it is told."""
        return round(float(self.times[look]), _DECIMALS)

    @property
    def interval(self) -> float:
        return float(self.times[1] - self.times[0]) if len(self.times) > 1 else 0.0


def rescaled(seen: Seen, misfits: Mapping[str, Sequence[Misfit]]) -> Seen:
    """With a frequency that was scaled for another one as the device has it, in pu of its own: it is 1 at rest. While a
    meter settles that begins far from there, it is 1 as well.

    A device that slips from the start stays as it is: its current moves, and at rest it does not."""
    values = dict(seen.values)
    for name in (
        signal.removesuffix(".omega") for signal in seen.values if signal.endswith(".omega")
    ):
        rest = next(
            (m.figures["omega"] for m in misfits.get(name, ()) if "omega" in m.figures), 1.0
        )
        current = seen.last.get(f"{name}.i_re")
        signal: Numbers = values[f"{name}.omega"] / rest
        if current is None or (rest == 1 and abs(signal[0] - 1) <= FREQUENCY_APART):
            continue
        looks = max(2, int(_AT_REST / seen.interval) if seen.interval else 2)
        size = np.hypot(current, seen.last[f"{name}.i_im"])
        most = _STILL * max(size[0], _STILL)
        if np.ptp(size[:looks]) < most:
            moved, apart = (
                np.logical_or.accumulate(np.abs(size - size[0]) >= most),
                np.abs(signal - 1),
            )
            if np.any(~moved & (apart <= FREQUENCY_APART / 2)):
                signal = np.where(moved | np.logical_or.accumulate(apart <= _SETTLED), signal, 1.0)
            values[f"{name}.omega"] = signal
    return replace(seen, values=values)


def is_derivative(name: str) -> bool:
    return name.partition(".")[2].startswith("der(")


def unit(name: str, system: System) -> str:
    component, _, variable = name.partition(".")
    return system.components[component].description.variables[variable].unit


def shown_name(name: str) -> str:
    """A pair of real and imaginary part is shown as its magnitude."""
    return f"|{name[:-3]}|" if name.endswith(("_re", "_im")) else name


def look_every(step_size: float, record_every: int, stop_time: float) -> int:
    """Number of communication steps between two looks. It is a multiple of the steps between two records if the records
    are close enough."""
    target = max(1, round(LOOK_INTERVAL / step_size), int(stop_time / step_size / MOST_LOOKS))
    return record_every * (target // record_every) if record_every <= target else target


class Watcher:
    """An observer that collects the data for the watch.

    ``names``: Signals ``component.variable`` that are read at every look.
    ``every``: Communication steps between two looks."""

    def __init__(self, names: Sequence[str], every: int) -> None:
        self.every = every
        self._recorder = Recorder(names, every)
        self._outputs: tuple[str, ...] = ()
        self._tracks = np.empty((4, 0, 0))
        self._count = 0
        self._last_index = -1
        self._run: ObservedRun | None = None
        self._position: Mapping[str, Any] | None = None

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        self._recorder.begin(run, stop_index)
        self._outputs, self._count, self._last_index, self._run = run.output_names, 0, -1, run
        further = (stop_index - run.index) // self.every + 2
        before = np.empty((4, 0, 0)) if self._position is None else self._position["tracks"]
        self._tracks = np.empty((4, before.shape[1] + further, len(run.output_names)))
        run.tracks.look(run.y)
        if self._position is not None:
            self._count, self._last_index = before.shape[1], int(self._position["index"])
            self._tracks[:, : self._count] = before
            run.tracks.restore(self._position["since"])
            self._position = None

    def observe(self, run: ObservedRun) -> None:
        if run.index == self._last_index:
            return  # taken up again where this look was made already
        self._last_index = run.index
        self._recorder.observe(run)
        tracks = run.tracks
        for kept, now in zip(
            self._tracks, (run.y, tracks.low, tracks.high, tracks.turns), strict=True
        ):
            kept[self._count] = now
        run.tracks.look(run.y)
        self._count += 1

    def end(self, run: ObservedRun) -> None:
        """Do nothing: the collected data stay."""

    def position(self) -> dict[str, Any]:
        """All that was seen so far, for `resume`: numbers, and arrays by name."""
        if self._run is None:
            raise InputError(
                "the watch has seen nothing yet; ask for its position after the run began"
            )
        rows = {f"rows_{name}": value for name, value in self._recorder.position().items()}
        looks = self._tracks[:, : self._count].copy()
        return {
            "index": self._last_index,
            "tracks": looks,
            "since": self._run.tracks.saved(),
            **rows,
        }

    def resume(self, position: Mapping[str, Any]) -> None:
        """Go on from a position at the next `begin`."""
        self._position = position
        rows = {
            name.removeprefix("rows_"): value
            for name, value in position.items()
            if name.startswith("rows_")
        }
        self._recorder.resume(rows)

    def seen(self, recorded: Recorder | None) -> Seen:
        values = dict(_columns(self._recorder.names, self._recorder.values))
        distance = 0 if recorded is None else recorded.every * recorded.keep
        if recorded is not None and self.every % distance == 0:
            further = _columns(recorded.names, recorded.values[:: self.every // distance])
            values |= {name: column[: self._count] for name, column in further}
        last, low, high, turns = (
            dict(_columns(self._outputs, part[: self._count])) for part in self._tracks
        )
        return Seen(self._recorder.times, values, last, low, high, turns)


def _columns(names: Iterable[str], table: Numbers) -> Iterable[tuple[str, Numbers]]:
    return ((name, table[:, k]) for k, name in enumerate(names))

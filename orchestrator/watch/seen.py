"""What the watch sees of a run: signals at regular looks, and where the coupled outputs went between them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.coupling.observers import ObservedRun
from orchestrator.coupling.recorder import Recorder
from orchestrator.coupling.system import System

LOOK_INTERVAL = 5e-3
"""The watch looks about so often [s]; what happens between two looks is seen in the extremes of coupled outputs."""

MOST_LOOKS = 20_000
"""Longer runs are looked at less often."""


@dataclass(frozen=True)
class Seen:
    """Signals of a run.

    Attributes
    ----------
    times
        Of the looks [s], shape (n,).
    values
        By ``component.variable``, each of shape (n,); all that was recorded and what the watch read besides.
    last, low, high, turns
        By coupled output, each of shape (n,): its value, its extremes since the look before, over every communication
        step, and how often it went the other way.
    """

    times: Numbers
    values: Mapping[str, Numbers]
    last: Mapping[str, Numbers]
    low: Mapping[str, Numbers]
    high: Mapping[str, Numbers]
    turns: Mapping[str, Numbers]

    def until(self, time: float) -> "Seen":
        """The same up to a time [s]."""
        count = int(np.searchsorted(self.times, time * (1 + 1e-12), side="right"))
        if count == len(self.times):
            return self
        parts = (self.values, self.last, self.low, self.high, self.turns)
        return Seen(self.times[:count], *({name: y[:count] for name, y in part.items()} for part in parts))

    @property
    def interval(self) -> float:
        """Between two looks [s]."""
        return float(self.times[1] - self.times[0]) if len(self.times) > 1 else 0.0


def is_derivative(name: str) -> bool:
    """Whether a signal is what FMI calls ``der(state)``."""
    return name.partition(".")[2].startswith("der(")


def unit(name: str, system: System) -> str:
    """Of a signal, as its FMU has it."""
    component, _, variable = name.partition(".")
    return system.components[component].description.variables[variable].unit


def look_every(step_size: float, record_every: int, stop_time: float) -> int:
    """Communication steps between two looks: a multiple of those between two records, where these are close enough."""
    target = max(1, round(LOOK_INTERVAL / step_size), int(stop_time / step_size / MOST_LOOKS))
    return record_every * (target // record_every) if record_every <= target else target


class Watcher:
    """An observer that collects what the watch needs.

    Parameters
    ----------
    names
        Signals ``component.variable`` that are read at every look.
    every
        Communication steps between two looks.
    """

    def __init__(self, names: Sequence[str], every: int) -> None:
        self.every = every
        self._recorder = Recorder(names, every)
        self._outputs: tuple[str, ...] = ()
        self._tracks = np.empty((4, 0, 0))
        self._count = 0

    def begin(self, run: ObservedRun, stop_index: int) -> None:
        """See `Observer.begin`."""
        self._recorder.begin(run, stop_index)
        self._outputs, self._count = run.output_names, 0
        self._tracks = np.empty((4, (stop_index - run.index) // self.every + 2, len(run.output_names)))
        run.tracks.look(run.y)

    def observe(self, run: ObservedRun) -> None:
        """See `Observer.observe`."""
        self._recorder.observe(run)
        tracks = run.tracks
        for kept, now in zip(self._tracks, (run.y, tracks.low, tracks.high, tracks.turns), strict=True):
            kept[self._count] = now
        run.tracks.look(run.y)
        self._count += 1

    def end(self, run: ObservedRun) -> None:
        """Nothing to do: what was seen stays."""

    def seen(self, recorded: Recorder) -> Seen:
        """Everything, with what was recorded besides."""
        values = dict(_columns(self._recorder.names, self._recorder.values))
        if self.every % recorded.every == 0:
            further = _columns(recorded.names, recorded.values[:: self.every // recorded.every])
            values |= {name: column[: self._count] for name, column in further}
        last, low, high, turns = (dict(_columns(self._outputs, part[: self._count])) for part in self._tracks)
        return Seen(self._recorder.times, values, last, low, high, turns)


def _columns(names: Iterable[str], table: Numbers) -> Iterable[tuple[str, Numbers]]:
    return ((name, table[:, k]) for k, name in enumerate(names))

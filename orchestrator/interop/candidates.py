"""All schedules that a master may have, with what the probe pair would show in each."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from orchestrator.cases.catalogue_fmus import catalogue_fmu
from orchestrator.coupling.clock import Clock
from orchestrator.coupling.master import Master
from orchestrator.coupling.recorder import Recorder
from orchestrator.coupling.schedule import FirstInputs, Schedule
from orchestrator.coupling.system import System

ORDERS = {"side by side": (("a", "b"),), "a, then b": (("a",), ("b",)), "b, then a": (("b",), ("a",))}
EXTRAPOLATIONS = (0.0, 0.5, 1.0)
SIGNALS = ("a.y", "b.y", "a.u_held", "b.u_held", "a.stepped", "b.stepped")
LABELS = (0, 1, -1)  # how many steps a row's outputs are ahead of its time


@dataclass(frozen=True)
class Candidate:
    order: str  # a key of `ORDERS`
    first_inputs: FirstInputs
    extrapolation: float
    early_label: int  # a row labelled t holds what t/H + ``early_label`` steps gave
    after_exchange: bool  # outputs are read after the inputs of the next step were set
    wire_by_wire: bool  # see `Schedule`


def probe_system() -> System:
    system = System()
    system.add("a", catalogue_fmu("probe_a"))
    system.add("b", catalogue_fmu("probe_b"))
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    return system


MasterTrajectory = tuple[Candidate, NDArray[np.float64]]
"""A schedule, and what it shows: row k holds `SIGNALS` after k + ``early_label`` steps, NaN where unknown."""


@cache
def candidates(step_size: float, steps: int, extrapolation: float = 0.0) -> tuple[MasterTrajectory, ...]:
    """Every schedule with one kind of extrapolation, and its trajectory of ``steps`` + 1 rows."""
    found = []
    for schedule in _schedules(extrapolation):
        for after_exchange, values in enumerate(_trajectories(schedule, step_size, steps + 1)):
            for early in LABELS:
                rows = np.full((steps + 1, len(SIGNALS)), np.nan)
                source = values[max(0, early) : steps + 1 + early]
                rows[max(0, -early) : max(0, -early) + len(source)] = source
                what = schedule.name, schedule.first_inputs, schedule.extrapolation, early, bool(after_exchange)
                found.append((Candidate(*what, schedule.wire_by_wire), rows))
    return tuple(found)


def _schedules(extrapolation: float) -> Iterator[Schedule]:
    for order, first in product(ORDERS, get_args(FirstInputs)):
        yield Schedule(order, ORDERS[order], first, extrapolation)
        if order == "side by side" and not extrapolation and first in ("consistent", "once"):
            # what is handed over wire by wire is read when its turn comes, also the first time
            yield Schedule(order, ORDERS[order], first, wire_by_wire=True)


def _trajectories(schedule: Schedule, step_size: float, steps: int) -> list[NDArray[np.float64]]:
    recorders = [Recorder(SIGNALS, 1), Recorder(SIGNALS, 1, after_exchange=True)]
    with Master(probe_system(), schedule, step_size) as master:
        master.run(Clock(step_size).time(steps), observers=recorders)
    return [recorder.values for recorder in recorders]

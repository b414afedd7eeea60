"""Our master runs a system by the rules of another master."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.coupling.clock import Clock
from orchestrator.coupling.events import Event, faults_among
from orchestrator.coupling.master import Master
from orchestrator.coupling.observers import Observer
from orchestrator.coupling.recorder import Recorder
from orchestrator.coupling.system import System
from orchestrator.errors import InputError
from orchestrator.interop.rules import MasterRules


@dataclass(frozen=True)
class Emulation:
    times: NDArray[np.float64]  # times of the rows, as the other master labels them [s], shape (n,)
    values: NDArray[np.float64]  # shape (n, number of names)
    names: tuple[str, ...]  # ``component.variable``


def emulate(
    system: System, rules: MasterRules, step_size: float, stop_time: float, record: Sequence[str], every: int = 1,
    events: Sequence[Event] = (), order: Sequence[str] | None = None, observers: Sequence[Observer] = (),
) -> Emulation:  # fmt: skip
    """Run a system along another master's rules.

    ``every``: steps between two rows; the first row is that with label 0.
    ``events``: each event happens before the step that starts at the event's time, as with our own schedules. Most
    other masters do not support events.
    ``order``: order in which the components step, for a master that steps them one after the other; by default the
    order of the system."""
    disturbed = [plan.name for plan in system.wires.values()] + [str(fault) for fault in faults_among(events)]
    if disturbed:
        raise InputError(
            f"{rules.title} knows no imperfections of connections and no faults, but the case has some "
            f"({'; '.join(disturbed[:3])}); leave them out to see what it would record"
        )
    clock = Clock(step_size)
    last = min(clock.index(stop_time, "the stop"), rules.rows(step_size, stop_time) - 1)
    if last < 0:
        raise InputError(f"a run of {stop_time:g} s has no row in {rules.title}; give a longer one")
    recorder = Recorder(record, every, after_exchange=rules.after_exchange)
    schedule = rules.schedule(tuple(system.components), order)
    with Master(system, schedule, step_size, stop_time) as master:
        master.run(clock.time(rules.early_label), events)
        master.run(clock.time(last + rules.early_label), events, [recorder, *observers])
    times = np.array([clock.time(row * every) for row in range(len(recorder.times))])
    return Emulation(times, recorder.values, tuple(record))

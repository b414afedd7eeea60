"""A scenario's trajectory as another master would give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.protection_relays import require_no_relays
from orchestrator.core.errors import InputError
from orchestrator.core.late import xr
from orchestrator.output.results.file_writers import trajectory_dataset
from orchestrator.simulation.interop.rules import MasterRules
from orchestrator.systems.coupling.clock import Clock
from orchestrator.systems.coupling.events import Event, faults_among
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.observers import Observer
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.system import System


@dataclass(frozen=True)
class Emulation:
    times: NDArray[np.float64]  # times of the rows, as the other master labels them [s], shape (n,)
    values: NDArray[np.float64]  # shape (n, number of names)
    names: tuple[str, ...]  # ``component.variable``


def emulate(
    system: System,
    rules: MasterRules,
    step_size: float,
    stop_time: float,
    record: Sequence[str],
    every: int = 1,
    events: Sequence[Event] = (),
    order: Sequence[str] | None = None,
    observers: Sequence[Observer] = (),
) -> Emulation:
    """Run a system along another master's rules.

    ``every``: steps between two rows; the first row is that with label 0.
    ``events``: each event happens before the step that starts at the event's time, as with our own schedules. Most
    other masters do not support events.
    ``order``: order in which the components step, for a master that steps them one after the other; by default the
    order of the system."""
    disturbed = [plan.name for plan in system.wires.values()] + [
        str(fault) for fault in faults_among(events)
    ]
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


def run_like(
    prepared: PreparedScenario,
    rules: MasterRules,
    order: Sequence[str] | None = None,
    observers: Sequence[Observer] = (),
) -> xr.Dataset:
    """Run a scenario from what its FMUs start with, along another master's rules.

    The operating point is not improved before and no modes are computed: another master does neither."""
    require_no_relays(prepared.relays, f"{rules.title} knows no")
    emulation = emulate(
        prepared.system,
        rules,
        step_size=prepared.step_size,
        stop_time=prepared.stop_time,
        record=prepared.record,
        every=prepared.record_every,
        events=prepared.events,
        order=order,
        observers=observers,
    )
    schedule = rules.schedule(tuple(prepared.system.components), order)
    dataset = trajectory_dataset(emulation, replace(prepared, schedule=schedule))
    return dataset.assign_attrs(
        like=f"{rules.title}: first inputs {rules.first_inputs}, rows {rules.early_label} steps ahead of their time, "
        f"{'after' if rules.after_exchange else 'before'} the exchange"
    )

"""A scenario's trajectory as another master would give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.cases.prepare import PreparedScenario
from orchestrator.coupling.observers import Observer
from orchestrator.interop.emulation import emulate
from orchestrator.interop.rules import MasterRules
from orchestrator.late import xr
from orchestrator.results.storage import trajectory_dataset


def run_like(
    prepared: PreparedScenario,
    rules: MasterRules,
    order: Sequence[str] | None = None,
    observers: Sequence[Observer] = (),
) -> xr.Dataset:
    """Run a scenario from what its FMUs start with, along another master's rules.

    The operating point is not improved before and no modes are computed: another master does neither."""
    emulation = emulate(
        prepared.system, rules, prepared.step_size, prepared.stop_time, prepared.record, prepared.record_every,
        prepared.events, order, observers,
    )  # fmt: skip
    schedule = rules.schedule(tuple(prepared.system.components), order)
    dataset = trajectory_dataset(emulation, replace(prepared, schedule=schedule))
    return dataset.assign_attrs(
        like=f"{rules.title}: first inputs {rules.first_inputs}, rows {rules.early_label} steps ahead of their time, "
        f"{'after' if rules.after_exchange else 'before'} the exchange"
    )

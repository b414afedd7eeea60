"""The modes of several scenarios, one after the other, with both cores at work.

The eigenvalues of a large system take seconds in linear algebra, which lets Python run. Meanwhile the FMUs of the next
scenario are initialised and linearised, which is Python's work. All calls of FMUs stay in the calling thread.

Where a scenario differs from the one before it in its events alone, as a fault does from the base, both have the same
modes: they are computed once."""

from collections.abc import Sequence
from contextlib import ExitStack

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.service import in_service
from orchestrator.core.threads import side_by_side
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ
from orchestrator.studies.modes.mode_identity import NamedSystem
from orchestrator.studies.modes.modes import (
    Linearised,
    ModesResult,
    compute_modes,
    linearised,
    running,
)


def compute_all_modes(
    scenarios: Sequence[PreparedScenario],
    frequency_range: tuple[float, float] = ELECTROMECHANICAL_HZ,
    critical: float | None = None,
    *,
    directional: bool = False,
) -> list[ModesResult]:
    """The same as `compute_modes` of each scenario, in their order, to the last bit.

    FMUs of others are instantiated by one scenario at a time: they may allow one instance, or share a file."""
    if len(scenarios) < 2 or not all(all_ours(prepared) for prepared in scenarios):
        return [
            compute_modes(one, frequency_range, critical, directional=directional)
            for one in scenarios
        ]
    results: list[ModesResult] = []
    before: Linearised | None = None
    done: dict[str, NamedSystem] = {}
    with side_by_side() as pool, ExitStack() as its_fmus:
        for prepared in scenarios:
            if before is not None and before.stands_as(prepared):
                _finish(before, results, done)
                before = before.of(prepared)
                continue
            with ExitStack() as fmus:
                try:
                    master = fmus.enter_context(running(in_service(prepared)))
                    begun = linearised(
                        prepared, master, frequency_range, critical, directional=directional
                    )
                except Exception:
                    if before is not None:
                        before.finished()  # an error of its own comes first
                    raise
                begun.begin(pool)
                if before is not None:
                    _finish(before, results, done)
                its_fmus.close()
                its_fmus.push(fmus.pop_all())
            before = begun
        if before is not None:
            results.append(before.finished(done))
    return results


def _finish(begun: Linearised, results: list[ModesResult], done: dict[str, NamedSystem]) -> None:
    """Add what a scenario gives to the results, and its names to those done."""
    results.append(begun.finished(done))
    if begun.named is not None:
        done[results[-1].prepared.name] = begun.named


def all_ours(prepared: PreparedScenario) -> bool:
    """Return whether no FMU of a scenario is another's: those may allow one instance, or share a file or a licence."""
    plans = prepared.system.components.values()
    return all(plan.isolated is not True for plan in plans) and all(
        map(is_ours, {p.description.path for p in plans})
    )

"""The modes of several scenarios, one after the other, with both cores at work.

The eigenvalues of a large system take seconds in linear algebra, which lets Python run. Meanwhile the FMUs of the next
scenario are initialised and linearised, which is Python's work. All calls of FMUs stay in the calling thread.

Where a scenario differs from another one in its events alone, as a fault does from the base, both have the same modes:
they are computed once."""

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
    start_alike,
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
    results: dict[int, ModesResult] = {}
    before: Linearised | None = None
    waiting: list[int] = []  # places of the scenarios that start from the system before
    done: dict[str, NamedSystem] = {}
    with side_by_side() as pool, ExitStack() as its_fmus:
        for places in _alike(scenarios):
            prepared = scenarios[places[0]]
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
                    results |= _finished(before, scenarios, waiting, done)
                its_fmus.close()
                its_fmus.push(fmus.pop_all())
            before, waiting = begun, places
        if before is not None:
            results |= _finished(before, scenarios, waiting, done)
    return [results[place] for place in range(len(scenarios))]


def _alike(scenarios: Sequence[PreparedScenario]) -> list[list[int]]:
    """Return the places of the scenarios, those that start from one system together."""
    found: list[list[int]] = []
    for place, prepared in enumerate(scenarios):
        same = (places for places in found if start_alike(scenarios[places[0]], prepared))
        group = next(same, None)
        if group is None:
            found.append([place])
        else:
            group.append(place)
    return found


def _finished(
    begun: Linearised,
    scenarios: Sequence[PreparedScenario],
    places: Sequence[int],
    done: dict[str, NamedSystem],
) -> dict[int, ModesResult]:
    """Return the results of the scenarios that start from one system, by place, and add their names to those done."""
    results = {}
    for place in places:
        own = begun if place == places[0] else begun.of(scenarios[place])
        results[place] = own.finished(done)
        if own.named is not None:
            done[scenarios[place].name] = own.named
    return results


def without_repeated(results: Sequence[ModesResult]) -> list[tuple[ModesResult, list[ModesResult]]]:
    """Return the results that say something new, each with those that repeat it: of one system, with the same names."""
    found: list[tuple[ModesResult, list[ModesResult]]] = []
    for result in results:
        same = (again for first, again in found if _repeats(first, result))
        repeated = next(same, None)
        if repeated is None:
            found.append((result, []))
        else:
            repeated.append(result)
    return found


def _repeats(first: ModesResult, result: ModesResult) -> bool:
    return (
        first.model is result.model
        and first.named == result.named
        and first.unnamed == result.unnamed
        and first.references == result.references
        and first.stability == result.stability
    )


def all_ours(prepared: PreparedScenario) -> bool:
    """Return whether no FMU of a scenario is another's: those may allow one instance, or share a file or a licence."""
    plans = prepared.system.components.values()
    return all(plan.isolated is not True for plan in plans) and all(
        map(is_ours, {p.description.path for p in plans})
    )

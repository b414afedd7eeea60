"""What a device brings: a scenario's damping beside that of another one with the same power flow."""

from collections.abc import Iterator, Sequence

from orchestrator.analysis.mode_tracking import ModeSet, match
from orchestrator.analysis.modes import Mode
from orchestrator.study.modes import ModesResult

_SAME_VOLTAGE = 1e-4  # between two power flows that are one operating point [pu]


def told(results: Sequence[ModesResult]) -> Iterator[str]:
    """A sentence on each scenario that others name as the one beside them, and one where it was left out."""
    for other in results:
        before = min(other.modes, key=lambda mode: mode.damping_percent, default=None)
        beside = [r for r in results if _beside(r) == other.prepared.name]
        if before is not None and beside:
            found = dict.fromkeys(_compared(result, other, before) for result in beside)
            mode = f"{before.frequency_hz:.3f} Hz, {before.damping_percent:.2f} %"
            yield f"Beside {other.prepared.title!r} ({mode}), at the same power flow: {'; '.join(found)}"
    names = {r.prepared.name for r in results}
    if absent := {name: None for r in results if (name := _beside(r)) is not None and name not in names}:
        yield f"What the change of power flow alone does: --scenario {' --scenario '.join(absent)} beside"


def _beside(result: ModesResult) -> str | None:
    scenario = result.prepared.case.table.scenarios.get(result.prepared.name)
    return None if scenario is None else scenario.beside


def _compared(result: ModesResult, other: ModesResult, before: Mode) -> str:
    title = result.prepared.title
    if not _same_flow(result, other):
        return f"{title}: not known, as its power flow is another one"
    sets = [ModeSet.of(r.modes, tuple(r.model.names)) for r in (other, result)]
    now = next((result.modes[x.target] for x in match(*sets) if other.modes[x.source] is before), None)
    if now is None:
        return f"{title}: not known, as no mode is clearly the same"
    return f"{title} {now.damping_percent - before.damping_percent:+.2f} points ({now.damping_percent:.2f} %)"


def _same_flow(one: ModesResult, other: ModesResult) -> bool:
    a, b = one.prepared.power_flow, other.prepared.power_flow
    if a is None or b is None or a.voltages.keys() != b.voltages.keys():
        return a is b
    return all(abs(v - b.voltages[bus]) < _SAME_VOLTAGE for bus, v in a.voltages.items())

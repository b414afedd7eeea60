"""What a device brings: a scenario's damping beside that of another one with the same power flow."""

from collections.abc import Iterator, Sequence

from orchestrator.analysis.mode_tracking import ModeSet, match
from orchestrator.analysis.modes import Mode
from orchestrator.study.modes import ModesResult

_SAME_VOLTAGE = 1e-4  # between two power flows that are one operating point [pu]


def told(results: Sequence[ModesResult]) -> Iterator[str]:
    """A sentence on each scenario that others name as the one beside them, also where it was left out."""
    known = {r.prepared.name: r for r in results}
    wanted = {r.prepared.name: r.prepared.case.scenarios[r.prepared.name].beside for r in results}
    for name in dict.fromkeys(name for name in wanted.values() if name is not None):
        other = known.get(name)
        if other is None:
            yield f"What the change of power flow alone does: --scenario {name} beside"
        elif before := min(other.modes, key=lambda mode: mode.damping_percent, default=None):
            found = "; ".join(_compared(r, other, before) for r in results if wanted[r.prepared.name] == name)
            mode = f"({before.frequency_hz:.3f} Hz, {before.damping_percent:.2f} %), at the same power flow"
            yield f"Beside {other.prepared.title!r} {mode}: {found}"


def _compared(result: ModesResult, other: ModesResult, before: Mode) -> str:
    voltages = [{} if (flow := r.prepared.power_flow) is None else flow.voltages for r in (result, other)]
    if not all(abs(v - voltages[1].get(bus, 0.0)) < _SAME_VOLTAGE for bus, v in voltages[0].items()):
        return f"{result.prepared.title}: not known, as its power flow is another one"
    sets = [ModeSet.of(r.modes, tuple(r.model.names)) for r in (other, result)]
    now = next((result.modes[x.target] for x in match(sets[0], sets[1]) if other.modes[x.source] is before), None)
    if now is None:
        return f"{result.prepared.title}: not known, as no mode is clearly the same"
    points = now.damping_percent - before.damping_percent
    return f"{result.prepared.title} {points:+.2f} points ({now.damping_percent:.2f} %)"

"""The system after a run's events, where these leave a line or a unit switched otherwise."""

from collections.abc import Mapping

from orchestrator.analysis.modes import Mode
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.errors import CosimError
from orchestrator.study.modes import ModesResult, compute_modes


def switched(prepared: PreparedScenario) -> Mapping[str, bool]:
    """Switches by ``component.variable`` that have another state after all events than at the start."""
    now: dict[str, bool] = {}
    for event in sorted(prepared.events, key=lambda event: event.time):
        for name, settings in event.changes().items():
            now |= {f"{name}.{key}": value for key, value in settings.items() if isinstance(value, bool)}
    before = {key: prepared.system.components[key.partition(".")[0]].value(key.partition(".")[2]) for key in now}
    return {key: value for key, value in now.items() if value != bool(before[key])}


def modes_after(prepared: PreparedScenario, frequency_range: tuple[float, float]) -> ModesResult | str | None:
    """The modes from a power flow of the switched system; the reason where there are none, None where nothing is
    switched."""
    values = switched(prepared)
    if not values or prepared.beside is None:
        return None
    try:
        after = prepared.beside(prepared.name, False, values, prepared.stop_time)
        return compute_modes(after, frequency_range) if after else None
    except CosimError as error:
        return f"the modes after the events are not known: {error}"


def least_damped(after: ModesResult | str | None) -> Mode | None:
    return min(after.modes, key=lambda m: m.damping_percent, default=None) if isinstance(after, ModesResult) else None

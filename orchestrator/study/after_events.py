"""The system after a run's events, where these leave a line open or another value changed."""

from collections.abc import Mapping

from orchestrator.analysis.modes import Mode
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.errors import AnalysisError, CosimError
from orchestrator.study.modes import ModesResult, compute_modes


def left_changed(prepared: PreparedScenario) -> Mapping[str, Value]:
    """Values by ``component.variable`` that are others after all events than at the start."""
    now: dict[str, Value] = {}
    for event in sorted(prepared.events, key=lambda event: event.time):
        for name, settings in event.changes().items():
            now |= {f"{name}.{key}": value for key, value in settings.items()}
    faults = tuple(key.removesuffix("on") for key in now if key.endswith(".fault.on"))  # act while they are on
    plans = prepared.system.components
    before = {key: plans[key.partition(".")[0]].value(key.partition(".")[2]) for key in now}
    return {key: value for key, value in now.items() if value != before[key] and not key.startswith(faults)}


def modes_after(prepared: PreparedScenario, frequency_range: tuple[float, float]) -> ModesResult | str | None:
    """The modes from a power flow with what the events leave changed; the reason where there are none beside a switch
    that is left, else None. Units share what loads and references change, which no power flow tells."""
    values = left_changed(prepared)
    if not values or prepared.beside is None:
        return None
    is_switched = any(isinstance(value, bool) for value in values.values())
    try:
        if moved := [key for key in values if key.endswith(".scale") or ".delta_" in key]:
            raise AnalysisError(f"units share what {moved[0]} changes by what their controls do")
        after = prepared.beside(prepared.name, False, values, prepared.stop_time)
        return compute_modes(after, frequency_range) if after else None
    except CosimError as error:
        reason = ": ".join(line.strip(" -:") for line in str(error).splitlines()[:2])
        return f"the modes after the events are not known: {reason}" if is_switched else None


def least_damped(after: ModesResult | str | None) -> Mode | None:
    return min(after.modes, key=lambda m: m.damping_percent, default=None) if isinstance(after, ModesResult) else None

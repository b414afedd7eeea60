"""The system after a run's events, where these leave a line open or another value changed."""

from collections.abc import Mapping

from orchestrator.cases.scenario.dc_lines import other_stations
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import CosimError
from orchestrator.linear.spectra.mode_tracking import ModeSet, match
from orchestrator.linear.spectra.modes import Mode
from orchestrator.simulation.watch.settings import left_changed
from orchestrator.studies.modes.modes import ModesResult, compute_modes


def lasting_changes(prepared: PreparedScenario) -> Mapping[str, float | bool]:
    """Values by ``component.variable`` that the events leave changed; a fault at the end of the run is none."""
    left = left_changed(prepared.system, prepared.events)
    return {name: value for name, value in left.items() if ".fault." not in name}


def same_mode(before: ModesResult, mode: Mode, after: ModesResult) -> Mode | None:
    """The mode that a mode of before the events is after them, by its shape; None where none is clearly the same."""
    if not all(known.left for result in (before, after) for known in result.modes):
        return None  # without left eigenvectors no shape is compared
    one, two = (ModeSet.of(r.modes, tuple(r.model.names)) for r in (before, after))
    links = (link for link in match(one, two) if before.modes[link.source] is mode)
    return next((after.modes[link.target] for link in links), None)


def modes_after(
    prepared: PreparedScenario, frequency_range: tuple[float, float]
) -> ModesResult | str | None:
    """The modes from a power flow with what the events leave changed; the reason where there are none beside a switch
    that is left, else None. Units share what loads and references change, which no power flow tells."""
    values = _with_other_ends(prepared, lasting_changes(prepared))
    if not values or prepared.beside is None:
        return None
    shared = [key for key in values if key.endswith(".scale") or ".delta_" in key]
    poles = [key for key in values if key.endswith(("_pole.R", "_pole.X"))]
    if shared:
        reason = f"units share what {shared[0]} changes by what their controls do"
    elif poles:
        line = poles[0].rpartition(".")[0].rpartition(".")[0]
        return f"the modes after the events are not known: one phase of {line} is open at an end"
    else:
        try:
            after = prepared.beside(prepared.name, False, values, prepared.stop_time)
            return compute_modes(after, frequency_range) if after else None
        except CosimError as error:
            reason = ": ".join(line.strip(" -:") for line in str(error).splitlines()[:2])
    is_switched = any(isinstance(value, bool) for value in values.values())
    return f"the modes after the events are not known: {reason}" if is_switched else None


def _with_other_ends(
    prepared: PreparedScenario, values: Mapping[str, float | bool]
) -> Mapping[str, float | bool]:
    """The values with both stations of a DC line out of service where one is: its line carries nothing any more."""
    if prepared.network is None:
        return values
    units = {port.name for port in prepared.network.ports}
    further = {
        key.replace(f"{lost}.connected", f"{other}.connected"): False
        for lost, other in other_stations(prepared.system, units).items()
        for key, value in values.items()
        if value is False and f".{key}".endswith(f".{lost}.connected")
    }
    return {**values, **further}

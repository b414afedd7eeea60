"""Tell whether a loop that rests within its dead band grows beyond it, where that is cheap to say.

Modes at the operating point are without such a loop, and call a system stable that oscillates across the band."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

from orchestrator.cases.questions.dead_bands import RestingLoop, resting_loops
from orchestrator.cases.questions.plausibility import is_meant
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import CosimError, few
from orchestrator.core.options import Option
from orchestrator.core.spelling import Text
from orchestrator.studies.modes.modes import ModesResult, compute_modes

_MOST_STATES = 200  # of a system whose modes are computed a second time
_SHOWN = 3  # loops that are named


def growth_beyond_dead_bands(results: Sequence[ModesResult]) -> list[str]:
    """Return a question for each scenario that grows where its dead bands are left; each text once."""
    return [*dict.fromkeys(filter(None, map(_growth, results)))]


def _growth(result: ModesResult) -> str:
    """Return the question of one scenario; "" where nothing grows, or more grows without the loops already."""
    prepared = result.prepared
    loops = [one for one in resting_loops(prepared.system.components) if _is_open(prepared, one)]
    small = result.model.number_of_states <= _MOST_STATES
    if not loops or not small or result.stability.stable is False:
        return ""
    try:
        found = compute_modes(_without(prepared, loops)).stability
    except CosimError:
        return ""  # the question about the band itself stands, with the command
    if found.stable is not False or found.mode is None:
        return ""
    names = few([f"{one.loop} ({one.component}.{one.ends[0]})" for one in loops], _SHOWN)
    typed = Text("")
    for one in loops:
        for end in one.ends:
            typed += " " + Option.SET + f" {one.component}.{end}=0"
    mode = found.mode
    return Text(
        f"beyond its dead band {names} makes the system grow: {mode.frequency_hz:.3g} Hz with "
        f"{mode.damping_percent:.2f} % damping where the band is 0. Within it the modes here are without that loop; a "
        "disturbance that leaves the band may start an oscillation across it, which `gfor run` shows; modes with the "
        "loop closed:",
        typed,
    )


def _is_open(prepared: PreparedScenario, one: RestingLoop) -> bool:
    return not is_meant(f"{one.component}.{one.ends[0]}", prepared.case.table.meant)


def _without(prepared: PreparedScenario, loops: Sequence[RestingLoop]) -> PreparedScenario:
    """Return the scenario with the loops closed: at its operating point they feed nothing, so that it stays."""
    plans = dict(prepared.system.components)
    for one in loops:
        plan = plans[one.component]
        closed = plan.parameters | dict.fromkeys(one.ends, 0.0)
        plans[one.component] = replace(plan, parameters=closed)
    system = copy(prepared.system)
    system.components = plans
    return replace(prepared, system=system)

"""Tell whether a loop that rests within its dead band grows beyond it, and into which limit cycle.

Modes at the operating point are without such a loop, and call a system stable that oscillates across the band. In small
systems the modes are computed once more with the band at 0; in large ones the growing mode alone is looked for."""

import fnmatch
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from orchestrator.cases.questions.dead_bands import RestingLoop, resting_loops
from orchestrator.cases.questions.plausibility import is_meant
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import CosimError, few
from orchestrator.core.options import Option
from orchestrator.core.spelling import Text
from orchestrator.linear.spectra.loop_growth import LoopGrowth
from orchestrator.linear.spectra.modes import Mode
from orchestrator.studies.modes.closed_loops import with_plans
from orchestrator.studies.modes.modes import ModesResult, compute_modes

_MOST_STATES = 200  # of a system whose modes are computed a second time
_SHOWN = 3  # loops that are named
_HALVINGS = 50  # of the ratio of a band to a swing, until it is known to the last digit


def growth_beyond_dead_bands(results: Sequence[ModesResult]) -> list[str]:
    """Return a question for each scenario that grows where its dead bands are left; each text once.

    Scenarios with one linear model are looked at once."""
    texts: dict[int, str] = {}
    for result in results:
        if id(result.model) not in texts:
            texts[id(result.model)] = _growth(result)
    return [*dict.fromkeys(filter(None, texts.values()))]


def _growth(result: ModesResult) -> str:
    """Return the question of one scenario; "" where nothing grows, or more grows without the loops already."""
    prepared = result.prepared
    loops = [one for one in resting_loops(prepared.system.components) if _is_open(prepared, one)]
    if not loops or result.stability.stable is False:
        return ""
    try:
        mode, growth = _growth_with(result, _without(prepared, loops))
        if mode is None:
            return ""
        cycle = _limit_cycle(growth, mode)
    except CosimError:
        return ""  # the question about the band itself stands, with the command
    shares = mode.by_component
    loops.sort(key=lambda one: -shares.get(one.component, 0.0))
    typed = Text("")
    for end in _ends(prepared, loops):
        typed += " " + Option.SET + f" {end}"
    names = few([f"{one.loop} ({one.component}.{one.ends[0]})" for one in loops], _SHOWN)
    closed = f"{mode.frequency_hz:.3g} Hz with {mode.damping_percent:.2f} % damping"
    return Text(
        f"beyond {'its dead band' if len(loops) == 1 else 'their dead bands'} {names} "
        f"{'makes' if len(loops) == 1 else 'make'} the system grow{cycle}. Within it the modes here are "
        "without that loop; a disturbance that leaves the band may start an oscillation across it, which `gfor run` "
        f"shows; modes with the loop closed, {closed} where the band is 0:",
        typed,
    )


def _limit_cycle(growth: LoopGrowth | None, mode: Mode) -> str:
    """Return what follows of a band's describing function; "" where what grows does not swing."""
    if growth is None or not mode.is_oscillation:
        return ""
    edge = growth.edge(mode.frequency_hz)
    if edge is None:
        return ""
    gain, hertz = edge
    return (
        f", to a limit cycle of about {hertz:.2g} Hz (by the band's describing function, an estimate): a swing of more "
        f"than {swing_over_band(gain):.2g} times the band grows until a limit holds it, and a smaller one decays"
    )


def swing_over_band(gain: float) -> float:
    """Return the amplitude of a swing, in parts of the end of a dead band, that the band lets a part of it through.

    Parameters
    ----------
    gain
        The part, from 0 to 1: the band's describing function 1 − (2/π)·(arcsin x + x·√(1 − x²)), with the inverse x of
        what is returned. Source: Gelb and Vander Velde, *Multiple-Input Describing Functions* (1968), appendix B."""
    low = 0.0
    high = 1.0
    for _ in range(_HALVINGS):
        x = (low + high) / 2
        let_through = 1 - 2 / np.pi * (np.arcsin(x) + x * np.sqrt(1 - x**2))
        low, high = (x, high) if let_through > gain else (low, x)
    return 2 / (low + high)


def _growth_with(
    result: ModesResult, closed: PreparedScenario
) -> tuple[Mode | None, LoopGrowth | None]:
    """The mode that grows fastest with the loops closed, where one does, and the system beside that with them."""
    if result.model.number_of_states > _MOST_STATES:
        if result.system is None:
            return None, None
        growth = LoopGrowth(result.system, with_plans(result, closed))
        return growth.mode(), growth
    found = compute_modes(closed)
    if found.stability.stable is not False:
        return None, None
    if result.system is None or found.system is None:
        return found.stability.mode, None
    return found.stability.mode, LoopGrowth(result.system, found.system)


def _ends(prepared: PreparedScenario, loops: Sequence[RestingLoop]) -> Iterator[str]:
    """Yield the bands' ends at 0 as they are typed: by a pattern where many have one, and it fits nothing else."""
    ends = dict.fromkeys(f"{one.component}.{end}" for one in loops for end in one.ends)
    variables = dict.fromkeys(end for one in loops for end in one.ends)
    if len(loops) <= _SHOWN:
        yield from (f"{end}=0" for end in ends)
        return
    for variable in variables:
        fitting = {
            f"{name}.{known}"
            for name, plan in prepared.system.components.items()
            for known in plan.description.parameters
            if fnmatch.fnmatchcase(f"{name}.{known}", f"*.{variable}")
        }
        if fitting <= ends.keys():
            yield f"'*.{variable}=0'"
        else:
            yield from (f"{end}=0" for end in ends if end.endswith(f".{variable}"))


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

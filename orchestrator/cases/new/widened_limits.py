"""Limits of exciters and governors that the operating point exceeds, and how far they are widened.

PSS/E starts such a machine, warns of suspect initial conditions and lets it drift to its limit; GridPACK and PowerWorld
widen the limit. The FMU itself is asked what it starts with, so that nothing is known here of its equations."""

from collections.abc import Callable
from dataclasses import dataclass

from orchestrator.cases.form.control_limits import is_limit, is_upper
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.service import in_service
from orchestrator.core.bisection import halve_towards
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.systems.coupling.coupled import Trials
from orchestrator.systems.coupling.system import ComponentPlan

HEADROOM = 0.1
"""By how much a widened limit exceeds the operating point [pu, as the limit]: the figure of GridPACK's IEEEG1 and
ESST4B, so that a perturbation moves the signal to both sides."""

_OPEN = 1e3  # a limit that no operating point reaches [pu]
_ACCURACY = 1e-4  # to which the value at the start is found [pu]; little against the headroom
_DIGITS = 3  # behind the point of a widened limit


@dataclass(frozen=True)
class WidenedLimit:
    """A limit, ``component.variable``, with its values in the files, at the start and as it is taken [pu]."""

    name: str
    given: float
    at_start: float
    taken: float


def limits_to_widen(prepared: PreparedScenario) -> list[WidenedLimit]:
    """Find the limits for which machines in service cannot start; none of a machine that has another cause too.

    Parameters
    ----------
    prepared
        A scenario, whose machines stand at its operating point.

    Returns
    -------
    list of WidenedLimit
        In the order of the machines and of their parameters.
    """
    return [
        limit
        for name, plan in in_service(prepared).system.components.items()
        if plan.kind == "machine" and is_ours(plan.description.path)
        for limit in limits_of_machine(name, plan)
    ]


def limits_of_machine(name: str, plan: ComponentPlan) -> list[WidenedLimit]:
    """Find the limits for which one machine of ours cannot start, in the order of its parameters; see above."""
    with Trials(name, plan) as trials:
        return _limits_found(name, plan, lambda values: trials.refusal(values) is None)


def _limits_found(
    name: str, plan: ComponentPlan, starts: Callable[[dict[str, float]], bool]
) -> list[WidenedLimit]:
    if starts({}):
        return []
    opened = {x: _bounded(plan, x, _OPEN) for x in plan.description.parameters if is_limit(x)}
    if not starts(opened):
        return []
    found = []
    for variable, open_ in opened.items():
        others = {x: value for x, value in opened.items() if x != variable}
        if starts(others):
            continue

        def starts_with(
            value: float, known: dict[str, float] = others, own: str = variable
        ) -> bool:
            return starts(known | {own: value})

        given = plan.number(variable)
        at_start = _nearest(starts_with, given, open_)
        taken = round(_bounded(plan, variable, HEADROOM, at_start), _DIGITS)
        found.append(WidenedLimit(f"{name}.{variable}", given, at_start, taken))
    return found if starts({x.name.removeprefix(f"{name}."): x.taken for x in found}) else []


def _bounded(plan: ComponentPlan, variable: str, distance: float, of: float = 0.0) -> float:
    """Return a limit at a distance outward of a value, within what the FMU takes."""
    info = plan.description.variables[variable]
    if is_upper(variable):
        return of + distance if info.maximum is None else min(of + distance, info.maximum)
    return of - distance if info.minimum is None else max(of - distance, info.minimum)


def _nearest(starts: Callable[[float], bool], refused: float, granted: float) -> float:
    """Return the value nearest to a refused one with which a machine starts."""
    return halve_towards(granted, refused, starts, goes_on=_is_coarse)[0]


def _is_coarse(granted: float, refused: float) -> bool:
    return abs(granted - refused) > _ACCURACY

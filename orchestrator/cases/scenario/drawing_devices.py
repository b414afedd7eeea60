"""Devices that draw power as loads do, such as motors, in what is told of a network's load."""

from collections.abc import Mapping

from orchestrator.systems.coupling.system import ComponentPlan

LOAD = "load"  # kind of the devices that are no sources

_OF_TERMINALS = "V_dc_0"  # parameter that terminals of DC lines have alone


def is_dc_terminal(plan: ComponentPlan) -> bool:
    """Return whether a component is a terminal of a DC line."""
    return _OF_TERMINALS in plan.description.variables


def drawn_mw(plans: Mapping[str, ComponentPlan]) -> dict[str, float]:
    """Return the active power [MW] of the devices that draw some at the operating point, but for those of DC lines."""
    found = {
        name: -plan.number("P_0") * plan.number("S_n")
        for name, plan in plans.items()
        if plan.kind == LOAD and "P_0" in plan.description.variables and not is_dc_terminal(plan)
    }
    return {name: p_mw for name, p_mw in found.items() if p_mw > 0}


def with_motors(words: str, plans: Mapping[str, ComponentPlan]) -> str:
    """Return how loads follow the voltage, in words, with the power of motors; as it is where there are none."""
    p_mw = sum(drawn_mw(plans).values())
    if not p_mw:
        return words
    return ", ".join(filter(None, (words, f"motors for {p_mw:.5g} MW")))

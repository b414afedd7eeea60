"""Components that want to know the communication step, because what they give is for the middle of the next one."""

from collections.abc import Iterator
from contextlib import contextmanager

from orchestrator.coupling.master import Master
from orchestrator.coupling.system import System

STEP_PARAMETER = "communication_step"
"""A component with a parameter of this name is told the communication step [s], unless it is set."""


def tell_step(system: System, step_size: float) -> None:
    """Give the communication step [s] to the components that have the parameter and no value for it."""
    for plan in system.components.values():
        info = plan.description.variables.get(STEP_PARAMETER)
        if info is not None and info.causality == "parameter":
            plan.parameters.setdefault(STEP_PARAMETER, step_size)


@contextmanager
def as_if_told(master: Master, step_size: float) -> Iterator[None]:
    """Inside, components that were told the master's step believe in another one [s]; 0 is the continuous system's.

    Those whose parameter was set to something else, or cannot be changed any more, keep it.
    """
    told = [(component, told_parameters(master, name)) for name, component in master.components.items()]
    try:
        for component, parameters in told:
            component.set(dict.fromkeys(parameters, step_size))
        yield
    finally:
        for component, parameters in told:
            component.set(dict.fromkeys(parameters, master.clock.step_size))


def told_parameters(master: Master, name: str) -> tuple[str, ...]:
    """Parameters by which a component was told the master's step, and may be told another."""
    plan = master.system.components[name]
    if plan.parameters.get(STEP_PARAMETER) != master.clock.step_size:
        return ()
    return (STEP_PARAMETER,) if plan.description.variables[STEP_PARAMETER].variability == "tunable" else ()

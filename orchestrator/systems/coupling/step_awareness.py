"""Components that know the communication step, because their outputs are for the middle of the next one."""

from collections.abc import Iterator
from contextlib import contextmanager

from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.system import System

STEP_PARAMETER = "communication_step"
"""A component with a parameter of this name is given the communication step [s], unless the parameter is set."""


INTERNAL_STEP = "internal_step"  # parameter of our FMUs: longest step of their own integrator [s]


def tell_step(system: System, step_size: float) -> frozenset[str]:
    """Give the communication step [s] to the components that have the parameter and no value for it; their names."""
    told = set()
    for name, plan in system.components.items():
        info = plan.description.variables.get(STEP_PARAMETER)
        if (
            info is not None
            and info.causality == "parameter"
            and STEP_PARAMETER not in plan.parameters
        ):
            plan.parameters[STEP_PARAMETER] = step_size
            told.add(name)
    return frozenset(told)


def shortest_internal_step(system: System) -> float | None:
    """The shortest step [s] of the components' own integrators; None where none says it."""
    plans = [
        plan for plan in system.components.values() if INTERNAL_STEP in plan.description.variables
    ]
    return min((plan.number(INTERNAL_STEP) for plan in plans), default=None)


def knows_step(master: Master, name: str) -> bool:
    """Return whether a component was given the master's step, and takes another one while it runs."""
    plan = master.system.components[name]
    if plan.parameters.get(STEP_PARAMETER) != master.clock.step_size:
        return False
    return plan.description.variables[STEP_PARAMETER].variability == "tunable"


@contextmanager
def other_step(master: Master, name: str, step_size: float) -> Iterator[None]:
    """Inside, a component that knows the master's step is given another one [s]; 0 is the continuous system's.

    A component whose parameter was set to something else, or that takes no other value any more, keeps what it has."""
    component = master.components[name]
    if step_size == master.clock.step_size or not knows_step(master, name):
        yield
        return
    try:
        component.set({STEP_PARAMETER: step_size})
        yield
    finally:
        component.set({STEP_PARAMETER: master.clock.step_size})

"""In which order a scenario's components step, as the case says it or as it is asked for."""

import copy
from collections.abc import Collection
from dataclasses import replace

from orchestrator.cases.form.definition import CaseDefinition
from orchestrator.cases.form.schema import SolverTable
from orchestrator.systems.coupling.schedule import Schedule, ScheduleName, jacobi, of_kind
from orchestrator.systems.coupling.step_awareness import STEP_PARAMETER, shortest_internal_step
from orchestrator.systems.coupling.system import System

Groups = tuple[tuple[str, ...], ...]


def groups_of(
    solver: SolverTable, grid: str | None, names: Collection[str], removed: Collection[str]
) -> Groups:
    """The groups of the file. By default the devices step first and then the grid, or every component is a group of
    its own."""
    if solver.groups is not None:
        groups = [tuple(name for name in group if name not in removed) for group in solver.groups]
        return tuple(group for group in groups if group)
    if grid is not None:
        return tuple(n for n in names if n != grid), (grid,)
    return tuple((name,) for name in names)


def schedule_of(
    name: ScheduleName,
    solver: SolverTable,
    grid: str | None,
    system: System,
    removed: Collection[str],
) -> Schedule:
    """The schedule of a name for a scenario's components, with the case's tolerance where it takes one."""
    if name == "jacobi":
        return jacobi(tuple(system.components))
    micro = solver.micro_step or shortest_internal_step(system)
    found = of_kind(name, groups_of(solver, grid, tuple(system.components), removed), micro)
    return replace(found, tolerance=solver.tolerance) if found.is_second_order else found


def schedule_in(
    case: CaseDefinition, scenario: str, system: System, name: ScheduleName
) -> Schedule:
    flow = case.table.power_flow
    grid = None if flow is None else flow.grid
    return schedule_of(name, case.table.solver, grid, system, case.scenarios[scenario].remove)


def told_again(system: System, told: Collection[str], step_size: float) -> System:
    """The system with another communication step [s] in the components that take one."""
    other = copy.copy(system)
    other.components = {
        name: replace(plan, parameters=plan.parameters | {STEP_PARAMETER: step_size})
        if name in told
        else plan
        for name, plan in system.components.items()
    }
    return other

"""The target of a POD design: the scenario, the components with the controller, and the mode."""

import fnmatch
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from orchestrator.analysis.modes import Mode
from orchestrator.cases.case import Case
from orchestrator.cases.idle_values import DAMPING_CONTROLLERS
from orchestrator.cases.parameter_files import ParameterFile
from orchestrator.cases.schema import CaseTable, NamedModeTable, Value
from orchestrator.coupling.system import ComponentPlan
from orchestrator.errors import InputError

CRITICAL = "least damped swing"  # the mode that is designed for where the case names none


def require_controllers(controllers: Sequence[str]) -> None:
    known = ", ".join(DAMPING_CONTROLLERS)
    if not controllers:
        raise InputError(f"controllers is empty; name one or both of {known}")
    for controller in controllers:
        if controller not in DAMPING_CONTROLLERS:
            raise InputError(f"there is no controller {controller!r}; there are: {known}")


@dataclass(frozen=True)
class Target:
    """A scenario, and those of its components that get one common setting."""

    scenario: str
    components: tuple[str, ...]
    # names of the components in a parameter file: one pattern that fits exactly these components, or each name
    key: tuple[str, ...]
    stages: int  # N_S of the components' lead/lag


def find_target(
    case: Case,
    controller: str,
    *,
    scenario: str | None,
    pattern: str | None,
    stages: int | None,
    overrides: Mapping[str, Value],
    parameters: Sequence[ParameterFile],
) -> Target:
    """Find the scenario and its components. By default it is the scenario in which all PODs exist and are off."""
    if scenario is not None and scenario not in case.scenarios:
        raise InputError(
            f"--scenario: there is no scenario {scenario!r}; the case has: {', '.join(case.scenarios)}"
        )
    names = [scenario] if scenario is not None else list(case.scenarios)
    plans = {name: case.components_of(name, overrides, parameters) for name in names}
    if scenario is None:
        on = {
            name
            for name, plan in plans.items()
            for each in DAMPING_CONTROLLERS
            for unit in with_controller(plan, each)
            if plan[unit].value(f"{each}.enabled")
        }
        fitting = [
            name
            for name, plan in plans.items()
            if with_controller(plan, controller) and name not in on
        ]
        # no fault's, say
        fitting = [name for name in fitting if case.scenarios[name].events is None] or fitting
        if len(fitting) != 1:
            what = (
                "no scenario" if not fitting else f"more than one scenario ({', '.join(fitting)})"
            )
            raise InputError(
                f"{case.name}: {what} has components with {controller} and every POD off, which is what a design "
                f"starts from; name one with --scenario, from: {', '.join(case.scenarios)}"
            )
        (scenario,) = fitting
    return _components(scenario, plans[scenario], controller, pattern, stages)


def _components(
    scenario: str,
    plan: Mapping[str, ComponentPlan],
    controller: str,
    pattern: str | None,
    stages: int | None,
) -> Target:
    having = with_controller(plan, controller)
    if not having:
        raise InputError(
            f"scenario {scenario!r}: no component has the controller {controller} (a parameter {controller}.K); "
            "choose a scenario with converters"
        )
    fitting = fnmatch.filter(plan, pattern) if pattern is not None else having
    chosen = [name for name in fitting if name in having]
    if not chosen:
        raise InputError(
            f"--component {pattern}: scenario {scenario!r} has no component of that name with {controller}; "
            f"those with it: {', '.join(having[:12])}{' …' if len(having) > 12 else ''}"
        )
    key = (pattern,) if pattern is not None and chosen == fitting else tuple(chosen)
    present = {int(plan[name].number(f"{controller}.N_S")) for name in chosen}
    if stages is None and len(present) > 1:
        raise InputError(
            f"the components {', '.join(chosen[:12])} have different numbers of stages ({controller}.N_S = "
            f"{', '.join(map(str, sorted(present)))}); give them one number with --stages"
        )
    if stages is not None:
        check_range(plan, chosen, f"{controller}.N_S", stages, "--stages")
    return Target(scenario, tuple(chosen), key, stages if stages is not None else present.pop())


def check_range(
    plan: Mapping[str, ComponentPlan],
    components: Sequence[str],
    variable: str,
    value: float,
    option: str,
) -> None:
    for name in components:
        info = plan[name].description.variables[variable]
        low = info.minimum if info.minimum is not None else -math.inf
        high = info.maximum if info.maximum is not None else math.inf
        if not low <= value <= high:
            raise InputError(
                f"{option}: {value:g} is out of range: {name}.{variable} takes from {low:g} to {high:g}"
            )


def with_controller(plan: Mapping[str, ComponentPlan], controller: str) -> list[str]:
    wanted = [f"{controller}.{v}" for v in ("enabled", "K", "T_S1", "T_S2", "N_S")]
    return [name for name, c in plan.items() if all(v in c.description.variables for v in wanted)]


def mode_name(case: Case, wanted: str | None) -> str:
    """The name of the mode to design for: the requested one, or by default the first mode that the case names; in a
    case without names the least damped swing, which is called `CRITICAL`."""
    names = [table.name for table in case.table.analysis.modes] or [CRITICAL]
    name = wanted if wanted is not None else names[0]
    if name not in names:
        raise InputError(f"--mode: the case names no mode {name!r}; it names: {', '.join(names)}")
    return name


def naming_critical(table: CaseTable, modes: Sequence[Mode]) -> CaseTable:
    """A case's tables that call the first of some modes `CRITICAL`: by the machines that swing against each other in
    it, else by the state that takes part most."""
    if not modes:
        return table
    speeds = [state for state, _ in modes[0].participation if state.endswith(".omega")]
    together, against = modes[0].swing(speeds)
    if against:
        rule = NamedModeTable(name=CRITICAL, against=(list(together), list(against)))
    else:
        rule = NamedModeTable(name=CRITICAL, states=speeds[:1] or [modes[0].participation[0][0]])
    return table.model_copy(
        update={"analysis": table.analysis.model_copy(update={"modes": [rule]})}
    )

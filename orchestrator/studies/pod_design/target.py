"""The target of a POD design: the scenario, the components with the controller, and the mode."""

import fnmatch
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import repeat

from orchestrator.cases.case import Case
from orchestrator.cases.form.names import no_scenario
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import CaseTable, NamedModeTable, Value
from orchestrator.cases.questions.idle_values import DAMPING_CONTROLLERS
from orchestrator.core.errors import InputError, few
from orchestrator.core.options import Option
from orchestrator.linear.spectra.modes import Mode
from orchestrator.studies.pod_design.stages import (
    GAIN_ALONE,
    NEEDED,
    count_stages,
    fixed_lead_lag,
    neutral_time,
)
from orchestrator.systems.coupling.system import ComponentPlan

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
    stages: int  # of the components' lead/lag: N_S, or the fixed number of a device without that variable
    # both time constants [s] with which stages of a fixed number do nothing; None where N_S can be set, `GAIN_ALONE`
    # where nothing of the lead/lag can
    neutral: float | None = None
    # variables of the lead/lag that a device with a gain alone has not, or not as tunable ones, as component.variable
    fixed: tuple[str, ...] = ()

    @property
    def has_gain_alone(self) -> bool:
        return self.neutral == GAIN_ALONE

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on components whose lead/lag is not designed."""
        if not self.has_gain_alone:
            return ()
        variable = self.fixed[0].split(".", 1)[1]
        return (
            f"only the gain is designed, and the lead/lag stays as it is: {few(self.fixed, 4)} cannot be set while the "
            f"FMU runs, or are not there; where the FMU has them as tunable ones, name them in its binding, as "
            f'[signals."{variable}"]',
        )

    def turned_around(self, plan: Mapping[str, ComponentPlan], controller: str) -> list[str]:
        """Return the values that turn the controllers' signs around, as they are typed; empty where one has no sign."""
        variable = f"{controller}.sign"
        if not all(variable in plan[name].description.variables for name in self.components):
            return []
        return [
            (Option.SET + f" {name}.{variable}={-plan[name].number(variable):g}")
            for name in self.components
        ]


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
    scenario = find_scenario(
        case, controller, scenario=scenario, overrides=overrides, parameters=parameters
    )
    plan = case.components_of(scenario, overrides, parameters)
    chosen, key = _components(scenario, plan, controller, pattern)
    times = {name: neutral_time(plan[name], controller) for name in chosen}
    fixed = [name for name, time in times.items() if time is not None]
    if not fixed:
        return Target(scenario, chosen, key, _stages_set(plan, chosen, controller, stages))
    alone = [name for name, time in times.items() if time == GAIN_ALONE]
    if alone:
        return _target_of_gains(
            Target(scenario, chosen, key, 0, GAIN_ALONE), plan, controller, alone, stages
        )
    others = [name for name in chosen if name not in fixed]
    if others:
        raise InputError(
            f"{fixed[0]} has a fixed number of stages (it has no variable {controller}"
            f".N_S), {others[0]} has not; they cannot have one setting: design them one "
            "after the other with " + Option.COMPONENT
        )
    (prepared,) = case.prepare([scenario], overrides, None, None, parameters)
    counts = {name: count_stages(prepared, name, controller) for name in fixed}
    number = counts[fixed[0]]
    other = next((name for name, count in counts.items() if count != number), None)
    if other:
        raise InputError(
            f"{fixed[0]} has {number} fixed stages in {controller}, {other} has "
            f"{counts[other]}; they cannot have one setting: design them one after the "
            "other with " + Option.COMPONENT
        )
    if stages not in (None, number):
        raise InputError(
            Option.STAGES
            + f" {stages}: {fixed[0]} has {number} stages in {controller}, a fixed number "
            f"(it has no variable {controller}.N_S); leave " + Option.STAGES + " out"
        )
    return Target(scenario, chosen, key, number, times[fixed[0]])


def _target_of_gains(
    found: Target,
    plan: Mapping[str, ComponentPlan],
    controller: str,
    alone: Sequence[str],
    stages: int | None,
) -> Target:
    """Complete the target whose components' lead/lag cannot be set: only their gain is designed."""
    first = alone[0]
    fixed = fixed_lead_lag(plan[first].description, controller)
    other = next((name for name in found.components if name not in alone), None)
    if other:
        raise InputError(
            f"{first} has a lead/lag that cannot be set ({', '.join(fixed)}), {other} has "
            "one that can; they cannot have one setting: design them one after the other "
            "with " + Option.COMPONENT
        )
    if stages is not None:
        raise InputError(
            Option.STAGES + f" {stages}: the lead/lag of {first}.{controller} cannot be set ("
            f"{', '.join(fixed)}), so that only its gain is designed; leave "
            + Option.STAGES
            + " out"
        )
    named = [
        f"{name}.{variable}"
        for name in alone
        for variable in fixed_lead_lag(plan[name].description, controller)
    ]
    return replace(found, fixed=tuple(named))


def find_scenario(
    case: Case,
    controller: str,
    *,
    scenario: str | None,
    overrides: Mapping[str, Value],
    parameters: Sequence[ParameterFile],
) -> str:
    """The scenario that is asked for; by default that in which all PODs exist and are off."""
    if scenario is not None:
        if scenario not in case.scenarios:
            raise InputError(Option.SCENARIO + f": {no_scenario(scenario, case.scenarios)}")
        return scenario
    plans = {name: case.components_of(name, overrides, parameters) for name in case.scenarios}
    on = {
        name
        for name, plan in plans.items()
        for enabled in (f"{each}.enabled" for each in DAMPING_CONTROLLERS)
        for unit in plan.values()
        if enabled in unit.description.variables and unit.value(enabled)
    }
    fitting = [
        name for name, plan in plans.items() if with_controller(plan, controller) and name not in on
    ]
    # no fault's, say
    fitting = [name for name in fitting if case.scenarios[name].events is None] or fitting
    if len(fitting) != 1:
        what = "no scenario" if not fitting else f"more than one scenario ({', '.join(fitting)})"
        lacking = "" if fitting else "".join(map(_lacking, plans.values(), repeat(controller)))
        raise InputError(
            f"{case.name}: {what} has components with {controller} and every POD off, "
            "which is what a design starts from; name one with "
            + Option.SCENARIO
            + f", from: {', '.join(case.scenarios)}{lacking}"
        )
    return fitting[0]


def example_of(case: Case) -> str:
    """Return the words of a design that this case can have; "" where it has nobody to design for."""
    for controller in DAMPING_CONTROLLERS:
        fitting = [
            name
            for name in case.scenarios
            if with_controller(case.components_of(name, {}, []), controller)
        ]
        if not fitting:
            continue
        words = f"{Option.CONTROLLER} {controller}"
        try:
            find_scenario(case, controller, scenario=None, overrides={}, parameters=[])
        except InputError:
            return f"{words} {Option.SCENARIO} {fitting[0]}"
        return words
    return ""


def _lacking(plan: Mapping[str, ComponentPlan], controller: str) -> str:
    """Name the variables that the first component with some of a controller's lacks; "" if there is none."""
    for name, component in plan.items():
        having = [v for v in NEEDED if f"{controller}.{v}" in component.description.variables]
        lacks = [f"{controller}.{v}" for v in NEEDED if v not in having]
        if having and lacks:
            return (
                f". {name} has {controller}.{having[0]}, and lacks {', '.join(lacks)}: name them in its binding, as "
                f'[signals."{lacks[0]}"]'
            )
    return ""


def _components(
    scenario: str, plan: Mapping[str, ComponentPlan], controller: str, pattern: str | None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The components that are asked for, and their names in a parameter file."""
    having = with_controller(plan, controller)
    if not having:
        raise InputError(
            f"scenario {scenario!r}: no component has the controller {controller} (parameters "
            f"{', '.join(f'{controller}.{v}' for v in NEEDED)}); choose a scenario with converters"
            f"{_lacking(plan, controller)}"
        )
    fitting = fnmatch.filter(plan, pattern) if pattern is not None else having
    chosen = [name for name in fitting if name in having]
    if not chosen:
        raise InputError(
            Option.COMPONENT
            + f" {pattern}: scenario {scenario!r} has no component of that name with "
            f"{controller}; those with it: {', '.join(having[:12])}"
            f"{(' …' if len(having) > 12 else '')}"
        )
    key = (pattern,) if pattern is not None and chosen == fitting else tuple(chosen)
    return tuple(chosen), key


def _stages_set(
    plan: Mapping[str, ComponentPlan],
    chosen: Sequence[str],
    controller: str,
    stages: int | None,
) -> int:
    """The number that is asked for, or that the components' N_S have."""
    present = {int(plan[name].number(f"{controller}.N_S")) for name in chosen}
    if stages is not None:
        check_range(plan, chosen, f"{controller}.N_S", stages, Option.STAGES)
        return stages
    if len(present) > 1:
        raise InputError(
            f"the components {', '.join(chosen[:12])} have different numbers of stages ("
            f"{controller}.N_S = {', '.join(map(str, sorted(present)))}); give them one "
            "number with " + Option.STAGES
        )
    return present.pop()


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
                option
                + f": {value:g} is out of range: {name}.{variable} takes from {low:g} to {high:g}"
            )


def with_controller(plan: Mapping[str, ComponentPlan], controller: str) -> list[str]:
    wanted = [f"{controller}.{v}" for v in NEEDED]
    return [name for name, c in plan.items() if all(v in c.description.variables for v in wanted)]


def mode_name(case: Case, wanted: str | None) -> str:
    """The name of the mode to design for: the requested one, or by default the first mode that the case names; in a
    case without names the least damped swing, which is called `CRITICAL`."""
    names = [table.name for table in case.table.analysis.modes] or [CRITICAL]
    name = wanted if wanted is not None else names[0]
    if name not in names:
        raise InputError(
            Option.MODE + f": the case names no mode {name!r}; it names: {', '.join(names)}"
        )
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

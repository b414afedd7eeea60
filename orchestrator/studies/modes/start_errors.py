"""Messages of a component that cannot start, in the words of the case: its place, its operating point, the remedy."""

from collections.abc import Collection, Mapping
from fnmatch import fnmatchcase
from itertools import product

from orchestrator.cases.flow.sharing import power_limits
from orchestrator.cases.new.widened_limits import limits_of_machine
from orchestrator.cases.scenario.feeding_loads import feeding_loads
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import ComponentError, ErrorKind, Problem, StartError
from orchestrator.core.options import Option
from orchestrator.core.question_kinds import besides
from orchestrator.core.spelling import Text
from orchestrator.core.units import whole_percent
from orchestrator.devices.fmi.instance import is_ours
from orchestrator.devices.fmi.refused_calls import refuses_to_start
from orchestrator.systems.coupling.coupled import refusal_to_start
from orchestrator.systems.coupling.system import ComponentPlan

_PREFACE = "parameters cannot be used: "
"""Begins what our models log of values that do not fit together, and is said by "cannot start" already. By FMI a model
can give its reason as a text only; a text of another's FMU stays as it is."""

_FULL = 1.0  # apparent power [pu] beyond which a unit is asked for more than its rating


_MOST_OTHERS = 8
"""So many further components that cannot start are told with the first; the others are counted."""


def start_errors(prepared: PreparedScenario, error: ComponentError) -> StartError | None:
    """The error of a component that refused to initialise, with those of all other units that do; see `start_error`.

    The questions about the values of these components stand besides, as such a value is likely the cause."""
    first = start_error(prepared, error)
    if first is None:
        return None
    units = [
        name
        for name, plan in prepared.system.components.items()
        if name != first.component and "P_0" in plan.description.variables
    ]
    ours = [name for name in units if is_ours(prepared.system.components[name].description.path)]
    refused = {name: refusal_to_start(name, prepared.system.components[name]) for name in ours}
    others, wider, stopped = list[Problem](), [first.wider], [first.component]
    for name, refusal in refused.items():
        if refusal is None or not refuses_to_start(refusal) or name not in prepared.places:
            continue
        limits = _wider_limits(name, prepared.system.components[name])
        cause = _cause(prepared, refusal, name) + _typed(limits)
        place = prepared.places[name]
        others.append(Problem.of_scenario(place, prepared.name, cause, ErrorKind.START))
        wider.append(limits)
        stopped.append(name)
    shown, rest = others[:_MOST_OTHERS], others[_MOST_OTHERS:]
    if rest:
        cause = f"{len(rest)} more units cannot start from their operating point"
        source = prepared.case.source
        shown.append(Problem.of_scenario(source, prepared.name, cause, ErrorKind.START))
    every = (
        {name: value for limits in wider for name, value in limits.items()} if all(wider) else {}
    )
    shown += besides(first.problems, _questions_of(prepared, stopped))
    return StartError(prepared.case.source, first.problems[0], first.component, shown, wider=every)


def _questions_of(prepared: PreparedScenario, names: Collection[str]) -> list[Problem]:
    """Return the questions about values of components, that about the value farthest from what is usual first."""
    excess = dict[Problem, float]()
    for question in prepared.questions:
        named = question.topic.variables if question.topic else ()
        for name, (pattern, _, variable) in product(names, (x.partition(".") for x in named)):
            if fnmatchcase(name, pattern):
                found = _excess(prepared.system.components[name], variable)
                excess[question] = max(found, excess.get(question, 0.0))
    asked = [question for question, factor in excess.items() if factor]
    return sorted(asked, key=lambda question: -excess[question])


def _excess(plan: ComponentPlan, variable: str) -> float:
    """Return by what factor a value lies outside of its usual range, at least 1; 0 of what is no value, or a rating.

    A unit that is asked for more than its rating is told with the same figures already."""
    known = plan.description.variables.get(variable)
    if known is None or variable == "S_n":
        return 0.0
    if known.usual is None:
        return 1.0
    value = abs(plan.number(variable))
    above = value / known.usual.high if known.usual.high > 0 else 1.0
    below = known.usual.low / value if value > 0 else 1.0
    return max(1.0, above, below)


def start_error(prepared: PreparedScenario, error: ComponentError) -> StartError | None:
    """The error of a component that refused to initialise; None for any other call, and where its process died."""
    if not refuses_to_start(error) or error.component not in prepared.places:
        return None
    name, plan = error.component, prepared.system.components[error.component]
    computed = prepared.power_flow is not None and name in prepared.power_flow.powers
    cause = _cause(prepared, error, name)
    if computed and {"P_0", "Q_0", "S_n"} <= {*plan.description.variables}:
        asked = abs(complex(plan.number("P_0"), plan.number("Q_0")))
        if _share(plan) > 1 or asked > _FULL:
            cause += (
                ". Give others more of the power (P_0 of units; a screening of outages shares it by itself), lower the "
                "loads or the reactive power around it, or correct a limit that is wrong in its data"
            )
        if _share(plan) <= 1:  # a load below zero leaves a unit less active power, never more
            grid = prepared.system.components.get(prepared.grid)
            fed = feeding_loads(prepared.network, grid, plan.number("S_n"))
            cause += f"; {fed}" if fed else ""
    limits = _wider_limits(name, plan)
    cause += _typed(limits)
    # The same values are refused again by a model of ours; an FMU of others may lack a licence today.
    kind = ErrorKind.START if is_ours(plan.description.path) else ErrorKind.FMU
    problem = Problem.of_scenario(prepared.places[name], prepared.name, cause, kind)
    return StartError(prepared.case.source, problem, name, wider=limits)


def _wider_limits(name: str, plan: ComponentPlan) -> dict[str, float]:
    """Return the limits of its exciter and governor with which a machine of ours starts, where they are the cause."""
    if plan.kind != "machine" or not is_ours(plan.description.path):
        return {}
    return {limit.name: limit.taken for limit in limits_of_machine(name, plan)}


def _typed(limits: Mapping[str, float]) -> str:
    """Return the limits with which a machine starts, as they are typed."""
    typed = Text("; it starts with" if limits else "")
    for name, value in limits.items():
        typed += " " + Option.SET + f" {name}={value:g}"
    return typed


def _share(plan: ComponentPlan) -> float:
    """Active power at the start, of what the unit's limits allow."""
    if not {"P_0", "Q_0"} <= {*plan.description.variables}:
        return 0.0
    most = power_limits(plan, plan.number("Q_0"))[1]
    return plan.number("P_0") / most if most > 0 else 0.0


def _cause(prepared: PreparedScenario, error: ComponentError, name: str) -> str:
    """Return the reason that a component gives why it cannot start, with its operating point."""
    plan = prepared.system.components[name]
    said = error.log.removeprefix(f"{name}: ")
    said = said.removeprefix(_PREFACE) if is_ours(plan.description.path) else said
    said = said or "the FMU says no more than that its initialisation failed"
    share, there = _share(plan), {*plan.description.variables}
    need = f"would need {whole_percent(share)} of what its limits allow, and " if share > 1 else ""
    cause = f"{name} {need}cannot start: {said}"
    if {"P_0", "Q_0", "S_n"} <= there:
        computed = prepared.power_flow is not None and name in prepared.power_flow.powers
        by = "the power flow asks it for" if computed else "it is to start at"
        voltage = f" at v = {plan.number('v_0'):.4g} pu" if "v_0" in there else ""
        powers = f"P_0 = {plan.number('P_0'):.4g} and Q_0 = {plan.number('Q_0'):.4g} pu"
        cause += f"; {by} {powers} of S_n = {plan.number('S_n'):g} MVA{voltage}"
    return cause

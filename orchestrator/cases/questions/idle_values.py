"""Values that cannot act: of a part that is switched off, or of a component that is connected with no other."""

import fnmatch
from collections.abc import Collection, Mapping, Sequence
from itertools import groupby
from types import MappingProxyType

from orchestrator.core.errors import Problem, QuestionTopic, few
from orchestrator.systems.coupling.events import Event
from orchestrator.systems.coupling.system import System

_SHOWN = 3

DAMPING_CONTROLLERS = {"pod_p": "POD-P", "pod_q": "POD-Q"}
"""Parts of converters that act by a gain ``K`` and have no effect at rest, by the names that planners give them."""

Idle = Mapping[str, Problem | None]
"""By ``component.variable``, all values that somebody gave; with a question where one cannot act."""


def why_idle(system: System, name: str, variable: str, moved: Collection[str] = ()) -> str:
    """Why a parameter has no effect; empty where it may have one, as where its switch is among those that are moved."""
    plan = system.components[name]
    if len(system.components) > 1 and all(
        name not in (c.source.component, c.target.component) for c in system.connections
    ):
        return f"{name} is connected with no other component"
    for key in switches_of(plan.description.variables, variable):
        if f"{name}.{key}" not in moved and plan.number(key) == 0:
            return f"{name}.{key} is {str(plan.value(key)).lower()}"
    return ""


def switches_of(variables: Collection[str], variable: str) -> list[str]:
    """The switches and gains of the parts that a variable belongs to: with one of them at 0 it cannot act."""
    parts, found = variable.split("."), []
    for depth in range(1, len(parts)):
        part = ".".join(parts[:depth])
        found.append(f"{part}.enabled")
        if part in DAMPING_CONTROLLERS:
            found.append(f"{part}.K")
    return [key for key in found if key in variables and key != variable]


def idle_values(
    system: System,
    keys: frozenset[str],
    places: Mapping[str, str],
    events: Sequence[Event],
    absent: Mapping[str, str] = MappingProxyType({}),
) -> Idle:
    """Find what keys with patterns set and where that cannot act; a switch that is given too, or moves later, is meant.

    ``absent``: places of values that components of other scenarios were given."""
    given = [
        (name, variable)
        for pattern, _, variable in (key.partition(".") for key in keys)
        for name in fnmatch.filter(system.components, pattern)
        if variable in system.components[name].description.variables
    ]
    moved = {
        f"{who}.{key}" for event in events for who, new in event.changes().items() for key in new
    }
    moved |= {f"{name}.{variable}" for name, variable in given}
    found: dict[str, Problem | None] = {}
    for name, of_one in groupby(sorted(absent.keys() & keys), lambda key: key.partition(".")[0]):
        missing = list(of_one)
        text = f"{few(missing, _SHOWN)} cannot act: the scenario has no {name}"
        topic = QuestionTopic("values of a component that the scenario lacks", name)
        found |= dict.fromkeys(missing, Problem(absent[missing[0]], text, topic=topic))
    for name, variable in given:
        key, why = f"{name}.{variable}", why_idle(system, name, variable, moved)
        topic = QuestionTopic(f"{variable} cannot act", name)
        asked = Problem(places.get(key, ""), f"{key} cannot act: {why}", topic=topic)
        found[key] = asked if why else None
    return found


def is_idle(idle: Idle, pattern: str) -> bool:
    """Tell whether a value cannot act in a scenario, at any of the components that a pattern with it names."""
    asked = [why for name, why in idle.items() if fnmatch.fnmatchcase(name, pattern)]
    return bool(asked) and all(why is not None for why in asked)


def others_on(system: System, pattern: str, variable: str, said: Sequence[str]) -> list[str]:
    """Switches of damping controllers beside one, ``pattern.variable``, that are on though no key says so."""
    switches = {f"{controller}.enabled" for controller in DAMPING_CONTROLLERS}
    on = [
        f"{name}.{switch}"
        for name, plan in system.components.items()
        if variable in switches and fnmatch.fnmatchcase(name, pattern)
        for switch in sorted((switches - {variable}) & plan.description.variables.keys())
        if plan.value(switch)
    ]
    return [other for other in on if not any(fnmatch.fnmatchcase(other, key) for key in said)]


def idle_everywhere(scenarios: Sequence[Idle]) -> list[Problem]:
    """The questions about values that act in none of some scenarios."""
    acting = {name for idle in scenarios for name, question in idle.items() if question is None}
    asked = (
        question
        for idle in scenarios
        for name, question in idle.items()
        if question and name not in acting
    )
    return list(dict.fromkeys(asked))

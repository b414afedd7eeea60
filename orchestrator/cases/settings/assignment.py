"""Assignment of values from the file, the scenario and the command line to the components.

``[conventions]`` gives what stability programs assume about machines, as parameters of ours. The same RAW and DYR files
give other dampings elsewhere, as most programs leave the speed out of the stator's voltage, and some take the
governor's power for torque. What a program does was read in its source, or in that of a library that its authors
compared with it."""

import fnmatch
from dataclasses import dataclass
from typing import Any

from orchestrator.cases.draft import Draft
from orchestrator.cases.form.control_limits import is_limit, is_wider
from orchestrator.cases.form.names import SERVICE, STATES, close_names, hint_at, whose
from orchestrator.cases.form.schema import ConventionsTable, Value
from orchestrator.cases.form.values import (
    TWICE,
    as_written,
    check_system_base,
    convert,
    flatten,
    given_twice,
)
from orchestrator.cases.settings.imperfection_tables import sets_imperfection
from orchestrator.devices.fmi.description import VariableInfo

EMF = "machine.speed_in_emf"  # parameter: the emf grows with the speed
TORQUE = "governor.output_is_torque"  # parameter: the governor gives a torque, not a power


@dataclass(frozen=True)
class Convention:
    speed_in_emf: bool  # the emf is w times the subtransient flux
    # the governor's output is the torque; else the power, and the torque is output/w
    output_is_torque: bool
    torque_of_classical: bool  # the same of a classical machine


CLASSICAL = "classical"  # the machine of second order, by its part's name

LIKE = {
    "exact": Convention(True, False, False),
    "psse": Convention(False, False, True),
    "powerfactory": Convention(False, False, False),
    "andes": Convention(False, True, True),
}


def assign_conventions(draft: Draft) -> None:
    """Give machines the parameters of the case's conventions, which any value given by name overrides."""
    table = draft.given.case.conventions
    if table is None:
        return
    chosen = _chosen(table)
    for name, plan in draft.system.components.items():
        own = plan.description.parameters
        if EMF not in own and not chosen.speed_in_emf and plan.description.kind == "machine":
            draft.note(
                draft.given.place("conventions"),
                f"{name} ({plan.description.model_name}) has stator transients, or no choice: its emf has the speed in "
                'it; take `models = "phasor"` and the parts of a DYR file, or speed_in_emf = true',
            )
            return
        table_of = draft.tables.get(name)
        is_classical = table_of is not None and table_of.machine == CLASSICAL
        is_torque = chosen.torque_of_classical if is_classical else chosen.output_is_torque
        for variable, value in ((EMF, chosen.speed_in_emf), (TORQUE, is_torque)):
            if variable in own:
                plan.parameters[variable] = value
                draft.places[f"{name}.{variable}"] = draft.given.place("conventions")


def _chosen(table: ConventionsTable) -> Convention:
    usual = LIKE[table.like]
    gives = {"torque": True, "power": False}.get(table.governor_gives or "")
    in_emf = usual.speed_in_emf if table.speed_in_emf is None else table.speed_in_emf
    if gives is None:
        return Convention(in_emf, usual.output_is_torque, usual.torque_of_classical)
    return Convention(in_emf, gives, gives)


# between a value and another one of the same digits, in another unit
_THOUSANDS = (1e-6, 1e-3, 1e3, 1e6)


def assign_values(draft: Draft) -> None:
    _assign_frequency(draft)
    assign_conventions(draft)
    for name, table in draft.tables.items():
        for group in ("parameters", "inputs"):
            flat = flatten(getattr(table, group))
            for key in (
                given_twice(flat) if name not in draft.origins else ()
            ):  # a unit's row overrides what is common
                draft.note(draft.place_of_value(name, group, key.split(".")), f"{key}: {TWICE}")
            for path, value in flat:
                _assign(draft, name, ".".join(path), value, draft.place_of_value(name, group, path))
    _widen_limits(draft)
    for layer in draft.given.layers:
        # made when the components were added
        chosen = [(choice.pattern, choice.place) for choice in layer.natives]
        chosen += [(choice.pattern, choice.place) for choice in layer.parts]
        for pattern, place in chosen:
            _check_component(draft, pattern, place)
        for key, value in layer.values.items():
            _assign_key(draft, key, value, layer.place(key))


def _widen_limits(draft: Draft) -> None:
    """Widen limits of machines' controls as the case says; one that the files have wider stays as it is there.

    A part that another scenario chooses need not have the limit."""
    units = draft.given.case.units
    for path, value in flatten(units.widened_limits) if units else ():
        name, _, variable = ".".join(path).partition(".")
        where = draft.given.place("units", "widened_limits", *path)
        if not is_limit(variable):
            text = (
                f"{variable!r} is no limit of an exciter or a governor; write it like "
                "sg1.exciter.V_RMAX = 7.5, or remove it"
            )
            draft.note(where, text)
            continue
        _check_component(draft, name, where)
        if not _has(draft, name, variable):
            continue
        plan = draft.system.components[name]
        given = plan.number(variable)
        wanted = convert_value(draft, plan.description.variables[variable], value, where)
        if wanted is not None and is_wider(variable, float(wanted), given):
            _assign(draft, name, variable, value, where)
            draft.found.widened[f"{name}.{variable}"] = given, where


def convert_value(
    draft: Draft, info: VariableInfo, value: Value, where: str
) -> float | bool | None:
    """The value in the variable's unit and type; None, with a note of the problem, if it does not fit."""
    try:
        return convert(info, value)
    except ValueError as error:
        draft.note(where, str(error))
        return None


def _assign_frequency(draft: Draft) -> None:
    if draft.data is None or draft.data.frequency is None:
        return
    for name, plan in draft.system.components.items():
        if "f_n" in plan.description.parameters:
            plan.parameters["f_n"] = draft.data.frequency
            draft.places[f"{name}.f_n"] = draft.given.place("network", "frequency")


def _assign_key(draft: Draft, key: str, value: Value, where: str) -> None:
    """Assign to one component, or to all that have the variable and whose name fits a pattern such as ``gfor*``; the
    variable may be a pattern, too."""
    if sets_imperfection(key):
        return  # done when the connections are made
    other = _switch(draft, key, value)
    if other:
        draft.note(where, other)
        return
    pattern, _, variable = key.partition(".")
    meant = fnmatch.filter(draft.tables, pattern) if variable else []
    fitting = [name for name in meant if name not in draft.given.exchanged]
    if pattern in draft.known and pattern not in draft.tables:
        draft.found.absent[key] = where
    having = [name for name in fitting if _has(draft, name, variable)]
    if pattern not in draft.tables and all(name in draft.system.components for name in fitting):
        if fitting == meant and fitting and not having:
            settable = {v for name in fitting for v in _settable(draft, name)}
            hint = close_names(
                variable, settable, f"{', '.join(fitting[:5])} are what fits the pattern"
            )
            draft.note(
                where, f"no component that fits {pattern!r} has a variable {variable!r}; {hint}"
            )
        fitting = having
    if variable == "S_n" and key in draft.given.from_outside:
        draft.found.ratings |= {
            name: draft.system.components[name].number(variable) for name in having
        }
    for name in fitting:
        for each in _matches(draft, name, variable) or [variable]:
            _assign(draft, name, each, value, where)
    _check_component(draft, pattern, where)


def _switch(draft: Draft, key: str, value: Value) -> str:
    """How an element is switched that a key means by another word, or without its grid; "" for any other key."""
    owner, _, word = key.rpartition(".")
    item, grid = owner.rpartition(".")[2], draft.grid or ""
    homes = (
        key.partition(".")[::2],
        (item, "connected"),
        (grid, f"{item}.connected"),
        (grid, f"{item}.scale"),
    )
    fitting = {name: fnmatch.filter(draft.system.components, name) for name, _ in homes}
    found = [
        (name, what) for name, what in homes if any(_has(draft, one, what) for one in fitting[name])
    ]
    if word not in SERVICE or not found or found[0] == homes[0]:
        return ""
    (name, variable), state = found[0], STATES.get(str(value).lower())
    if state is None:
        return f"{word} = {as_written(value)}; it must be true or false; {item} is switched by {name}.{variable}"
    on = state != (word in ("out", "off"))
    text = str(int(on)) if variable.endswith("scale") else str(on).lower()
    return f"{item} is switched {'on' if on else 'off'} by {name}.{variable}={text}; write that"


def _has(draft: Draft, name: str, variable: str) -> bool:
    plan = draft.system.components.get(name)
    return plan is not None and (
        variable in plan.description.variables or bool(_matches(draft, name, variable))
    )


def _matches(draft: Draft, name: str, variable: str) -> list[str]:
    known = name in draft.system.components and "*" in variable
    return fnmatch.filter(_settable(draft, name), variable) if known else []


def _settable(draft: Draft, name: str) -> tuple[str, ...]:
    description = draft.system.components[name].description
    return (*description.parameters, *description.inputs)


def _check_component(draft: Draft, pattern: str, where: str) -> None:
    if draft.found.network_failed and draft.given.case.units is not None:
        return  # the units may be what is missing
    if not fnmatch.filter(draft.known, pattern):
        some = ", ".join([*draft.given.case.components, *draft.origins][:12])
        own = {name: plan.description.variables for name, plan in draft.system.components.items()}
        hint = (
            f"; the network's are {draft.grid}.…" if pattern == "network" else whose(pattern, own)
        )
        draft.note(where, f"there is no component {pattern!r}; the case has: {some}{hint}")


def _assign(draft: Draft, name: str, variable: str, value: Value, where: str) -> None:
    plan = draft.system.components.get(name)
    if plan is None:
        return  # the component's own problem is noted already
    info = plan.description.variables.get(variable)
    if info is None:
        if draft.is_repeated(name, variable):
            return
        hint = hint_at(
            plan.description,
            variable,
            _settable(draft, name),
            f"`gfor fmu info {plan.description.path}` lists them",
        )
        draft.note(where, f"component {name!r} has no variable {variable!r}; {hint}")
        return
    if info.causality not in ("parameter", "input"):
        draft.note(
            where,
            f"{variable} is of causality {info.causality}; only parameters and inputs can be set",
        )
        return
    converted = convert_value(draft, info, value, where)
    if converted is None:
        draft.found.refused_inputs.add(f"{name}.{variable}")
        return
    try:
        check_system_base(plan.description, variable, converted)
    except ValueError as error:
        draft.found.refused_inputs.add(f"{name}.{variable}")
        draft.note(where, f"component {name!r}: {error}")
    else:
        target: dict[str, Any] = plan.inputs if info.causality == "input" else plan.parameters
        before = (
            plan.number(variable)
            if isinstance(value, str) and isinstance(converted, float)
            else 0.0
        )
        if before and round(converted / before, 9) in _THOUSANDS:
            text = f"{value} is {converted / before:g} times what it is in the files; is the unit meant?"
            draft.found.thousandfold[f"{name}.{variable}"] = text
        target[variable] = converted
        draft.places[f"{name}.{variable}"] = where

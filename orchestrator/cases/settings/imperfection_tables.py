"""Imperfections of a case file's connections: which connections are meant, and what they do, in the signals' units."""

import fnmatch
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from pydantic import TypeAdapter, ValidationError

from orchestrator.cases.draft import Draft
from orchestrator.cases.form import schema
from orchestrator.cases.form.names import close_names
from orchestrator.cases.form.values import convert
from orchestrator.core.errors import InputError, Problem, QuestionTopic
from orchestrator.core.options import Option
from orchestrator.core.toml_files import fault_of
from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.systems.coupling.clock import Clock
from orchestrator.systems.coupling.connections import Connection
from orchestrator.systems.coupling.imperfections import (
    Bias,
    Delay,
    DropOut,
    Imperfection,
    Noise,
    Quantisation,
)
from orchestrator.systems.coupling.system import System
from orchestrator.systems.coupling.wire_bank import whole_steps

KEY = "imperfections"
"""Values of the command line and of a scenario reach an imperfection as ``imperfections.NAME.KEY``."""

_NUMBERS = {
    "delay": "s",
    "bandwidth": "Hz",
    "value": None,
    "deviation": None,
    "step": None,
    "substitute": None,
}
"""Keys that hold a number, with their unit; None for that of the signal."""


def sets_imperfection(key: str) -> bool:
    return key.partition(".")[0] == KEY


def disturb_connections(draft: Draft, clock: Clock, stop: float) -> dict[str, float | bool]:
    """Give the connections what the case and the scenario say of them; the numbers that were given, by key."""
    given: dict[str, float | bool] = {}
    tables = {
        name: (table, draft.given.place(KEY, name))
        for name, table in draft.given.case.imperfections.items()
    }
    for name, table in draft.given.scenario.imperfections.items():
        tables[name] = table, draft.given.place("scenarios", draft.given.name, KEY, name)
    for name, (table, where) in _overridden(draft, tables).items():
        if isinstance(table, schema.DelayTable):
            note_long_delay(draft, table.delay, stop, where)
        for connection in connections_meant(draft, table.connection, where):
            imperfection = imperfection_of(draft, table, connection, clock, where)
            if imperfection is None:
                continue
            given |= _numbers(name, imperfection)
            if is_none(imperfection):
                continue
            try:
                draft.system.disturb(connection, imperfection)
            except InputError as error:
                draft.note(where, str(error))
    return given


def note_long_delay(draft: Draft, delay: float, stop: float, where: str) -> None:
    """A delay after which nothing arrives before the run ends: a mistake, or worth a word if the run was cut short."""
    if delay < stop:
        return
    text = (
        f"delay = {delay:g} s, but the run ends at {stop:g} s: nothing that is sent in it arrives"
    )
    if stop == draft.given.case.solver.stop_time:
        draft.note(where, f"{text}; give a shorter delay, or the run a later solver.stop_time")
    else:
        topic = QuestionTopic("a delay after the stop")
        draft.found.questions.append(Problem(where, (f"{text} (" + Option.STOP + ")"), topic=topic))


def _overridden(
    draft: Draft, tables: Mapping[str, tuple[schema.ImperfectionTable, str]]
) -> dict[str, tuple[schema.ImperfectionTable, str]]:
    found = dict(tables)
    for layer in draft.given.layers:
        for key, value in layer.values.items():
            if not sets_imperfection(key):
                continue
            _, name, field = (*key.split(".", 2), "", "")[:3]
            if name not in found:
                hint = close_names(
                    name, found, f"there are: {', '.join(found)}" if found else "the case has none"
                )
                draft.note(layer.place(key), f"there is no imperfection {name!r}; {hint}")
                continue
            content = found[name][0].model_dump(exclude_unset=True) | {field: value}
            try:
                found[name] = _adapter().validate_python(content), layer.place(key)
            except ValidationError as error:
                draft.note(layer.place(key), f"{key} = {value!r}: {fault_of(error.errors()[0])}")
    return found


@cache
def _adapter() -> TypeAdapter[schema.ImperfectionTable]:
    """Return the validator of a table, which takes a millisecond to make."""
    return TypeAdapter(schema.ImperfectionTable)


def imperfection_of(
    draft: Draft, table: schema.ImperfectionTable, connection: Connection, clock: Clock, where: str
) -> Imperfection | None:
    """Return what a table says of one connection, in the unit of its signal; None where it is wrong, which is noted."""
    info = signal_info(draft.system, connection)
    try:
        found = _converted(table, info)
        if isinstance(found, Delay):
            whole_steps(found.seconds, clock.step_size, str(connection))
        if (
            isinstance(found, Noise)
            and found.bandwidth is not None
            and found.bandwidth >= 0.5 / clock.step_size
        ):
            raise ValueError(
                f"bandwidth = {found.bandwidth:g} Hz; it must be below {0.5 / clock.step_size:g} Hz, the most that a "
                f"communication step of {clock.step_size:g} s shows; leave it out for white noise"
            )
    except (ValueError, InputError) as error:
        draft.note(where, str(error))
        return None
    return found


def _converted(table: schema.ImperfectionTable, info: VariableInfo) -> Imperfection:
    match table:
        case schema.BiasTable():
            return Bias(_number(info, "value", table.value))
        case schema.NoiseTable():
            return Noise(
                _not_negative(info, "deviation", table.deviation), table.seed, table.bandwidth
            )
        case schema.FreezeTable():
            return DropOut()
        case schema.DropOutTable():
            if table.substitute == "hold":
                return DropOut()
            return DropOut(
                0.0 if table.substitute == "zero" else _number(info, "substitute", table.substitute)
            )
        case schema.DelayTable():
            return Delay(table.delay)
        case schema.QuantisationTable():
            return Quantisation(_not_negative(info, "step", table.step))
        case _:
            raise TypeError(f"{type(table).__name__} is no imperfection")


def _number(info: VariableInfo, key: str, value: schema.Value) -> float:
    return float(convert(replace(info, name=key), value))


def _not_negative(info: VariableInfo, key: str, value: schema.Value) -> float:
    return float(convert(replace(info, name=key, minimum=0.0), value))


def signal_info(system: System, connection: Connection) -> VariableInfo:
    source = connection.source
    info = system.components[source.component].description.variables[source.variable]
    return replace(info, minimum=None, maximum=None, start=None)


def is_none(imperfection: Imperfection) -> bool:
    """Return whether it changes nothing: a delay, bias, deviation or step of 0."""
    match imperfection:
        case (
            Bias(value=size) | Noise(deviation=size) | Quantisation(step=size) | Delay(seconds=size)
        ):
            return size == 0
        case _:
            return False


def connections_meant(draft: Draft, text: str, where: str) -> list[Connection]:
    """The connections that ``a.out -> b.in`` or a pattern names; those that a scenario removes are none."""
    ends = [part.strip() for part in text.split("->")]
    if len(ends) != 2 or not all("." in end for end in ends):
        draft.note(
            where, f"connection = {text!r}; write it as 'component.output -> component.input'"
        )
        return []
    found = list(matching(draft.system.connections, ends))
    absent = draft.known - set(draft.system.components)
    if not found and not any(fnmatch.filter(absent, end.partition(".")[0]) for end in ends):
        names = [str(c) for c in draft.system.connections]
        hint = close_names(
            text,
            names,
            f"there are {len(names)}, such as {names[0]}" if names else "there are none",
        )
        draft.note(where, f"there is no connection {text!r}; {hint}")
    return found


def matching(connections: Sequence[Connection], ends: Sequence[str]) -> Iterator[Connection]:
    source, target = ends
    for connection in connections:
        if _fits(str(connection.source), source) and _fits(str(connection.target), target):
            yield connection


def _fits(name: str, pattern: str) -> bool:
    return name == pattern or fnmatch.fnmatchcase(name, pattern)


def _numbers(name: str, imperfection: Imperfection) -> dict[str, float | bool]:
    values: dict[str, Any]
    match imperfection:
        case Bias():
            values = {"value": imperfection.value}
        case Noise():
            values = {"deviation": imperfection.deviation, "bandwidth": imperfection.bandwidth}
        case Quantisation():
            values = {"step": imperfection.step}
        case Delay():
            values = {"delay": imperfection.seconds}
        case DropOut():
            values = {"substitute": imperfection.substitute}
    return {
        f"{KEY}.{name}.{key}": float(value) for key, value in values.items() if value is not None
    }


def number_info(
    system: System, tables: Mapping[str, schema.ImperfectionTable], key: str
) -> VariableInfo:
    """The number that ``imperfections.NAME.KEY`` reaches, as a variable with its unit."""
    _, name, field = (*key.split(".", 2), "", "")[:3]
    if name not in tables:
        hint = close_names(
            name, tables, f"there are: {', '.join(tables)}" if tables else "the case has none"
        )
        raise InputError(f"{key}: there is no imperfection {name!r}; {hint}")
    table = tables[name]
    numbers = [n for n in _NUMBERS if n in type(table).model_fields]
    if field not in numbers:
        known = f"it has: {', '.join(numbers)}" if numbers else "it has no number"
        raise InputError(f"{key}: imperfection {name!r} has no number {field!r}; {known}")
    unit = _NUMBERS[field]
    ends = [part.strip() for part in table.connection.split("->")]
    if unit is None and len(ends) == 2:
        unit = next((signal_info(system, c).unit for c in matching(system.connections, ends)), "")
    least = None if field in ("value", "substitute") else 0.0
    text = f"{field} of the imperfection {name}"
    return VariableInfo(
        key,
        0,
        type="Real",
        causality="parameter",
        variability="tunable",
        unit=unit or "",
        start=None,
        minimum=least,
        maximum=None,
        description=text,
    )

"""What a sweep varies: ``grid.X_L=0.01:0.6:60`` as text, and as values in the variable's own unit."""

import fnmatch
import itertools
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.cases.build_choices import ALPHA
from orchestrator.cases.imperfection_tables import number_info, sets_imperfection
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.cases.values import convert
from orchestrator.errors import InputError
from orchestrator.fmi.description import VariableInfo
from orchestrator.units import read_value, to_unit

_FORMS = "START:STOP:COUNT, log:START:STOP:COUNT or a list such as 0.1,0.2,0.5"
_MOST = 100_000
_ALPHA_INFO = VariableInfo(ALPHA, 0, "Real", "parameter", "fixed", "", None, 0.0, 1.0, "Share of the converters")


@dataclass(frozen=True)
class Vary:
    """One ``--vary`` as it was written.

    Attributes
    ----------
    key
        ``component.parameter``; the component may be a pattern such as ``gfor*``.
    limits
        START and STOP; None for a list.
    logarithmic
        Whether these are equally spaced on a logarithmic scale.
    """

    key: str
    limits: tuple[Value, Value] | None
    count: int
    logarithmic: bool
    values: tuple[Value, ...]


@dataclass(frozen=True)
class Axis:
    """A parameter with the values that it takes.

    Attributes
    ----------
    values
        What is set, in ``unit``.
    multiple_of
        Values between two of them are rounded to multiples of this; None where any value will do.
    """

    key: str
    unit: str
    title: str
    values: tuple[float | bool, ...]
    logarithmic: bool = False
    multiple_of: float | None = None


def parse_vary(text: str) -> Vary:
    """Read ``component.parameter=START:STOP:COUNT``, ``=log:START:STOP:COUNT`` or ``=0.1,0.2,0.5``.

    Raises
    ------
    ValueError
        If the text has another form; the message says what is wrong and how to write it.
    """
    key, equals, given = (part.strip() for part in text.partition("="))
    if not equals or not re.fullmatch(r"[^.\s]+\.\S+", key) or not given:
        raise ValueError(f"{text!r} is not of the form component.parameter={_FORMS}")
    if ":" not in given:
        values = tuple(read_value(part.strip()) for part in given.split(","))
        if any(value == "" for value in values):
            raise ValueError(f"{text!r}: a value of the list is missing; write it like 0.1,0.2,0.5")
        return Vary(key, None, len(values), False, values)
    parts = [part.strip() for part in given.split(":")]
    logarithmic = parts[0].lower() == "log"
    parts = parts[1:] if logarithmic else parts
    if len(parts) != 3 or not all(parts):
        raise ValueError(f"{text!r}: {given!r} is not of the form {_FORMS}")
    if not re.fullmatch(r"\d+", parts[2]) or not 2 <= int(parts[2]) <= _MOST:
        raise ValueError(f"{text!r}: COUNT = {parts[2]!r}; it must be a whole number from 2 to {_MOST}")
    return Vary(key, (read_value(parts[0]), read_value(parts[1])), int(parts[2]), logarithmic, ())


def resolve(vary: Vary, scenarios: Sequence[PreparedScenario]) -> Axis:
    """Find the variable that is varied, and its values in the variable's unit.

    Raises
    ------
    InputError
        If there is no such variable, or if a value does not fit its type, unit or range.
    """
    if vary.key == ALPHA:
        return _axis(vary, _ALPHA_INFO)
    if sets_imperfection(vary.key):
        return _imperfection_axis(vary, scenarios)
    pattern, _, variable = vary.key.partition(".")
    plans = {n: p for s in scenarios for n, p in s.system.components.items() if fnmatch.fnmatchcase(n, pattern)}
    if not plans:
        names = dict.fromkeys(name for s in scenarios for name in s.system.components)
        raise InputError(
            f"--vary {vary.key}: no component of the chosen scenarios is called {pattern!r}; "
            f"they have: {', '.join([*names][:12])}"
        )
    infos = [p.description.variables[variable] for p in plans.values() if variable in p.description.variables]
    if len({info.unit for info in infos}) > 1:
        raise InputError(f"--vary {vary.key}: the variables that fit have different units; vary them one by one")
    if not infos:
        # The preparation of a point says it best, with the names that are close.
        return Axis(vary.key, "", vary.key, tuple(v for v in (vary.limits or vary.values) if not isinstance(v, str)))
    return _axis(vary, infos[0])


def refuse_doubles(axes: Sequence[Axis], scenarios: Sequence[PreparedScenario]) -> None:
    """Refuse two axes that vary one variable."""
    names = [*dict.fromkeys(name for s in scenarios for name in s.system.components)]
    for one, other in itertools.combinations(axes, 2):
        (pattern, _, variable), (second, _, same) = one.key.partition("."), other.key.partition(".")
        if variable != same:
            continue
        both = [name for name in names if all(fnmatch.fnmatch(name, p) for p in (pattern, second))]
        if both or fnmatch.fnmatch(pattern, second) or fnmatch.fnmatch(second, pattern):
            shared = f"{both[0] if both else pattern}.{variable}"
            raise InputError(
                f"--vary {one.key} and --vary {other.key}: both vary {shared}, which can have one value only; leave "
                "one of them out, or give all values in one list"
            )


def _imperfection_axis(vary: Vary, scenarios: Sequence[PreparedScenario]) -> Axis:
    tables = {name: table for s in scenarios for name, table in s.case.table.imperfections.items()}
    for scenario in scenarios:
        tables |= scenario.case.scenarios[scenario.name].imperfections
    try:
        info = number_info(scenarios[0].system, tables, vary.key)
    except InputError as error:
        raise InputError(f"--vary {error}") from error
    axis = _axis(vary, info)
    return replace(axis, multiple_of=scenarios[0].step_size) if vary.key.endswith(".delay") else axis


def _axis(vary: Vary, info: VariableInfo) -> Axis:
    try:
        if vary.limits is None:
            values = [convert(info, value) for value in vary.values]
        else:
            start, stop = (_number(info, limit) for limit in vary.limits)
            for limit in (start, stop):  # what was written is named, rather than a value between the two
                convert(replace(info, type="Real"), limit)
            values = [convert(info, value) for value in _spaced(start, stop, vary.count, vary.logarithmic)]
    except ValueError as error:
        raise InputError(f"--vary {vary.key}: {error}") from error
    if len(set(values)) < len(values):
        raise InputError(f"--vary {vary.key}: a value stands in the list twice; leave one out")
    step = 1.0 if info.type == "Integer" else None
    return Axis(
        vary.key, "" if info.unit == "1" else info.unit, info.description, tuple(values), vary.logarithmic, step
    )


def _number(info: VariableInfo, limit: Value) -> float:
    if info.type == "Boolean" or isinstance(limit, bool):
        raise ValueError(f"{info.name} = {limit!r} is no limit of a range; list the values, such as false,true")
    number = to_unit(limit, info.unit)
    if not math.isfinite(number):
        raise ValueError(f"{info.name} = {number}; a limit of a range must be a finite number")
    return number


def _spaced(start: float, stop: float, count: int, logarithmic: bool) -> list[float]:
    if start == stop:
        raise ValueError(f"the range begins and ends at {start:g}; give two different limits")
    if logarithmic and not start * stop > 0:
        raise ValueError(
            f"a logarithmic range from {start:g} to {stop:g} passes zero; give limits of one sign, or a linear range"
        )
    numbers = np.geomspace(start, stop, count) if logarithmic else np.linspace(start, stop, count)
    return [float(f"{number:.12g}") for number in numbers]  # 0.02 and not 0.020000000000000004


def grid_places(axes: Sequence[Axis]) -> Iterator[tuple[int, ...]]:
    """Places in the grid of all axes, the last one running fastest."""
    return itertools.product(*(range(len(axis.values)) for axis in axes))

"""The axes of a sweep: ``grid.X_L=0.01:0.6:60`` as text, and as values in the variable's own unit."""

import fnmatch
import itertools
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from shlex import quote

import numpy as np

from orchestrator.cases.form.build_choices import ALPHA
from orchestrator.cases.form.names import close_names, whose
from orchestrator.cases.form.schema import Value
from orchestrator.cases.form.values import convert
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.short_circuit import ShortCircuit
from orchestrator.cases.settings.imperfection_tables import number_info, sets_imperfection
from orchestrator.core.errors import InputError, few
from orchestrator.core.options import Option
from orchestrator.core.units import read_value, to_unit
from orchestrator.devices.fmi.description import VariableInfo

_FORMS = "START:STOP:COUNT, log:START:STOP:COUNT or a list such as 0.1,0.2,0.5"
# one ``component.parameter`` or several; each may be a pattern
_KEYS = r"[^.\s]+\.[^\s,]+(\s*,\s*[^.\s]+\.[^\s,]+)*"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_SPAN = re.compile(
    rf"({_NUMBER}(?:\s*[^\W\d]+?)?)\s*(?:-|–|\.\.+|to)\s*({_NUMBER}(?:\s*[^\W\d]+)?)", re.ASCII
)
"""A range as many write it: ``0.1-0.5``, ``0.1..0.5`` or ``0.1 to 0.5``, each number with or without a unit."""

_SPAN_COUNT = (
    11  # values of a range that a message shows how to write: both ends, and tenths between
)
_LENGTH = "length"  # of a line, as the last part of a key
_SCR = "scr"  # short-circuit ratio, as the last part of a key
_MOST = 100_000
_ALPHA_INFO = VariableInfo(
    ALPHA,
    0,
    type="Real",
    causality="parameter",
    variability="fixed",
    unit="",
    start=None,
    minimum=0.0,
    maximum=1.0,
    description="Share of the converters",
)


@dataclass(frozen=True)
class Vary:
    # ``component.parameter``, several with commas, patterns such as ``gfor*.P_0`` or ``grid.X_line_7_*``; or lines
    # whose length is multiplied, ``line_7_9, line_8_9: length``.
    key: str
    limits: tuple[Value, Value] | None  # START and STOP; None for a list
    count: int  # number of values; 0 where the text leaves it out, as a search for a limit lets it
    logarithmic: bool  # whether these are equally spaced on a logarithmic scale
    values: tuple[Value, ...]


@dataclass(frozen=True)
class Axis:
    key: str
    unit: str
    title: str
    values: tuple[float | bool, ...]  # what is set, in ``unit``
    logarithmic: bool = False
    # values between two of them are rounded to multiples of this; None where any value will do.
    multiple_of: float | None = None
    # what is set together, each with the factor on the value; the key alone where empty.
    members: tuple[tuple[str, float], ...] = ()
    # what a value comes to before that factor; itself where None
    scale: Callable[[float], float] | None = None

    def sets(self, value: Value) -> dict[str, Value]:
        if not self.members:
            return {self.key: value}
        scaled = value if self.scale is None else self.scale(float(value))
        return {
            key: scaled if factor == 1 else factor * float(scaled) for key, factor in self.members
        }


def parse_vary(text: str) -> Vary:
    """Read ``component.parameter=START:STOP:COUNT``, ``=log:START:STOP:COUNT`` or ``=0.1,0.2,0.5``; for a search
    ``=START:STOP`` is enough.

    Raises `ValueError` if the text has another form; the message says what is wrong and how to write it."""
    key, equals, given = (part.strip() for part in text.partition("="))
    named = re.fullmatch(_KEYS, key) or (
        ":" in key and all(part.strip() for part in key.split(":"))
    )
    if not equals or not named or not given:
        raise ValueError(f"{text!r} is not of the form component.parameter={_FORMS}")
    if ":" not in given:
        _refuse_span(key, given)
        values = tuple(read_value(part.strip()) for part in given.split(","))
        if any(value == "" for value in values):
            raise ValueError(f"{text!r}: a value of the list is missing; write it like 0.1,0.2,0.5")
        return Vary(key, None, len(values), False, values)
    parts = [part.strip() for part in given.split(":")]
    logarithmic = parts[0].lower() == "log"
    parts = parts[1:] if logarithmic else parts
    if len(parts) not in (2, 3) or not all(parts):
        raise ValueError(f"{text!r}: {given!r} is not of the form {_FORMS}")
    if len(parts) == 2:
        return Vary(key, (read_value(parts[0]), read_value(parts[1])), 0, logarithmic, ())
    if not re.fullmatch(r"\d+", parts[2]) or not 2 <= int(parts[2]) <= _MOST:
        raise ValueError(
            f"{text!r}: COUNT = {parts[2]!r}; it must be a whole number from 2 to {_MOST}"
        )
    return Vary(key, (read_value(parts[0]), read_value(parts[1])), int(parts[2]), logarithmic, ())


def _refuse_span(key: str, given: str) -> None:
    """Refuse a range in another form than ours, which would be read as a number with a strange unit."""
    span = _SPAN.fullmatch(given)
    if span:
        limits = f"{key}={span[1]}:{span[2]}"
        raise ValueError(
            f"{key}: {given!r} is neither a value nor a range; write {quote(f'{limits}:{_SPAN_COUNT}')} for "
            f"{_SPAN_COUNT} values, or {quote(limits)} in a search with " + Option.UNTIL
        )


def resolve(vary: Vary, scenarios: Sequence[PreparedScenario]) -> Axis:
    if vary.limits is not None and not vary.count:
        raise InputError(
            Option.VARY
            + f" {vary.key}: COUNT is missing; write {_FORMS}, or search for a limit with "
            + Option.UNTIL
        )
    if ":" in vary.key:
        return _length_axis(vary, scenarios)
    if vary.key == ALPHA:
        return _axis(vary, _ALPHA_INFO)
    if sets_imperfection(vary.key):
        return _imperfection_axis(vary, scenarios)
    if re.search(r",|\..*[*?\[]", vary.key):
        return _joint_axis(vary, scenarios)
    pattern, _, variable = vary.key.partition(".")
    plans = {
        n: p
        for s in scenarios
        for n, p in s.system.components.items()
        if fnmatch.fnmatchcase(n, pattern)
    }
    if not plans:
        names = dict.fromkeys(name for s in scenarios for name in s.system.components)
        raise InputError(
            (
                Option.VARY
                + f" {vary.key}: no component of the chosen scenarios is called {pattern!r}; "
                f"they have: {', '.join([*names][:12])}"
            )
            + whose(
                pattern,
                {
                    n: p.description.variables
                    for s in scenarios
                    for n, p in s.system.components.items()
                },
            )
        )
    infos = [
        p.description.variables[variable]
        for p in plans.values()
        if variable in p.description.variables
    ]
    if len({info.unit for info in infos}) > 1:
        raise InputError(
            Option.VARY
            + f" {vary.key}: the variables that fit have different units; vary them one by "
            "one"
        )
    if not infos:
        # The preparation of a point says it best, with the names that are close.
        return Axis(
            vary.key,
            "",
            vary.key,
            tuple(v for v in (vary.limits or vary.values) if not isinstance(v, str)),
        )
    return _axis(vary, infos[0])


def _joint_axis(vary: Vary, scenarios: Sequence[PreparedScenario]) -> Axis:
    keys: dict[str, None] = {}
    for part in (part.strip() for part in vary.key.split(",")):
        pattern, _, variable = part.partition(".")
        if not re.search(r"[*?\[]", variable):
            keys[part] = None
            continue
        found = {
            f"{name}.{v}": None
            for s in scenarios
            for name, plan in s.system.components.items()
            if fnmatch.fnmatchcase(name, pattern)
            for v in fnmatch.filter(plan.description.parameters, variable)
        }
        if not found:
            raise InputError(
                Option.VARY + f" {part}: no parameter of the chosen scenarios fits this pattern"
            )
        keys |= found
    each = [resolve(replace(vary, key=key), scenarios) for key in keys]
    if len({axis.unit for axis in each}) > 1:
        units = ", ".join(f"{axis.key} [{axis.unit or '1'}]" for axis in each)
        raise InputError(
            Option.VARY + f" {vary.key}: one value cannot be that of {units}; vary them one by one"
        )
    return replace(
        each[0], key=vary.key, title=vary.key, members=tuple((axis.key, 1.0) for axis in each)
    )


def _length_axis(vary: Vary, scenarios: Sequence[PreparedScenario]) -> Axis:
    """The length of lines, as a factor on what each has: R, X and charging grow together."""
    names, _, quantity = (part.strip() for part in vary.key.rpartition(":"))
    if quantity == _SCR:
        return _scr_axis(vary, names, scenarios)
    if quantity != _LENGTH:
        raise InputError(
            Option.VARY + f" {vary.key}: {quantity!r} is not known; of lines the {_LENGTH} can be "
            f"multiplied, at a bus the {_SCR} be set"
        )
    one = scenarios[0]
    lines = {x.name: x for x in one.network.lines if not x.has_ratio} if one.network else {}
    members: dict[str, float] = {}
    for part in (part.strip() for part in names.split(",")):
        found = fnmatch.filter(lines, part.rpartition(".")[2])
        if not found:
            hint = close_names(part, lines, f"there are: {few(lines, 8)}")
            raise InputError(Option.VARY + f" {vary.key}: the network has no line {part!r}; {hint}")
        for line in (lines[name] for name in found):
            for quantity in ("X", "R", "B") if line.B else ("X", "R"):
                members |= _of_line(vary, scenarios, line.variable(quantity))
    info = VariableInfo(
        _LENGTH,
        0,
        type="Real",
        causality="parameter",
        variability="fixed",
        unit="",
        start=None,
        minimum=1e-6,
        maximum=None,
        description=f"Length of {names}",
    )
    return replace(_axis(vary, info), members=tuple(members.items()))


def _scr_axis(vary: Vary, bus: str, scenarios: Sequence[PreparedScenario]) -> Axis:
    """The short-circuit ratio at a bus, or its short-circuit power: R, X and X_C of all branches that end there are
    multiplied."""
    one = scenarios[0]
    try:
        found = ShortCircuit.of(one)
        bus = found.known(bus)
        if one.network and any(bus in x.buses for x in one.network.transformers):
            raise InputError(
                f"{bus} has a transformer of three windings, which is not scaled; choose another bus"
            )
        in_mva = any(isinstance(value, str) for value in vary.limits or vary.values)
        ratings = [
            sum(S for at, S in ShortCircuit.of(s).converters.values() if at == bus)
            for s in scenarios
        ]
        if not in_mva and not max(ratings):
            raise InputError(
                f"no converter stands at {bus}, whose rating an SCR is of; give the short-circuit power, "
                f"such as '{bus}=3000 MVA:800 MVA:5'"
            )
        members: dict[str, float] = {}
        for line in one.network.lines if one.network else ():
            if bus not in (line.from_bus, line.to_bus):
                continue
            for quantity in ("X", "R", "X_C") if line.X_C else ("X", "R"):
                members |= _of_line(vary, scenarios, line.variable(quantity))
        info = VariableInfo(
            _SCR,
            0,
            type="Real",
            causality="parameter",
            variability="fixed",
            unit="MVA" if in_mva else "",
            start=None,
            minimum=1e-3,
            maximum=None,
            description=vary.key,
        )
        axis = _axis(vary, info)
        unit = 1.0 if in_mva else max(ratings)
        scale = partial(_factor, found, bus, unit)
        for value in axis.values:
            scale(float(value))  # one that cannot be had is refused before anything is computed
    except InputError as error:
        raise InputError(Option.VARY + f" {vary.key}: {error}") from error
    return replace(axis, members=tuple(members.items()), scale=scale)


def _factor(network: ShortCircuit, bus: str, unit: float, value: float) -> float:
    return network.factor_for(bus, value * unit)


def _of_line(vary: Vary, scenarios: Sequence[PreparedScenario], variable: str) -> dict[str, float]:
    grid = scenarios[0].grid
    values = {scenario.system.components[grid].number(variable) for scenario in scenarios}
    if len(values) > 1:
        raise InputError(
            Option.VARY
            + f" {vary.key}: {grid}.{variable} differs among the scenarios; choose one by "
            + Option.SCENARIO
        )
    return {f"{grid}.{variable}": values.pop()}


def refuse_doubles(axes: Sequence[Axis], scenarios: Sequence[PreparedScenario]) -> None:
    names = [*dict.fromkeys(name for s in scenarios for name in s.system.components)]
    single = [
        replace(axis, key=key) for axis in axes for key, _ in axis.members or ((axis.key, 1.0),)
    ]
    for one, other in itertools.combinations(single, 2):
        (pattern, _, variable), (second, _, same) = one.key.partition("."), other.key.partition(".")
        if variable != same:
            continue
        both = [name for name in names if all(fnmatch.fnmatch(name, p) for p in (pattern, second))]
        if both or fnmatch.fnmatch(pattern, second) or fnmatch.fnmatch(second, pattern):
            shared = f"{both[0] if both else pattern}.{variable}"
            raise InputError(
                Option.VARY
                + f" {one.key} and "
                + Option.VARY
                + f" {other.key}: both vary {shared}, which can have one value only; leave one "
                "of them out, or give all values in one list"
            )


def _imperfection_axis(vary: Vary, scenarios: Sequence[PreparedScenario]) -> Axis:
    tables = {name: table for s in scenarios for name, table in s.case.table.imperfections.items()}
    for scenario in scenarios:
        tables |= scenario.case.scenarios[scenario.name].imperfections
    try:
        info = number_info(scenarios[0].system, tables, vary.key)
    except InputError as error:
        raise InputError(Option.VARY + f" {error}") from error
    axis = _axis(vary, info)
    return (
        replace(axis, multiple_of=scenarios[0].step_size) if vary.key.endswith(".delay") else axis
    )


def _axis(vary: Vary, info: VariableInfo) -> Axis:
    try:
        if vary.limits is None:
            values = [convert(info, value) for value in vary.values]
        else:
            start, stop = (_number(info, limit) for limit in vary.limits)
            for limit in (
                start,
                stop,
            ):  # what was written is named, rather than a value between the two
                convert(replace(info, type="Real"), limit)
            values = [
                convert(info, value) for value in _spaced(start, stop, vary.count, vary.logarithmic)
            ]
    except ValueError as error:
        raise InputError(Option.VARY + f" {vary.key}: {error}") from error
    if len(set(values)) < len(values):
        raise InputError(
            Option.VARY + f" {vary.key}: a value stands in the list twice; leave one out"
        )
    step = 1.0 if info.type == "Integer" else None
    return Axis(
        vary.key,
        "" if info.unit == "1" else info.unit,
        info.description,
        tuple(values),
        vary.logarithmic,
        step,
    )


def _number(info: VariableInfo, limit: Value) -> float:
    if info.type == "Boolean" or isinstance(limit, bool):
        raise ValueError(
            f"{info.name} = {limit!r} is no limit of a range; list the values, such as false,true"
        )
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

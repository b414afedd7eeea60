"""All parameters of the certified FMU: the value of its file, the value used, and the origin of a change."""

from collections.abc import Iterator
from dataclasses import dataclass

from orchestrator.certification.point import CONVERTER
from orchestrator.certification.study import Certification
from orchestrator.fmi.description import FmuDescription, VariableInfo
from orchestrator.fmi.port import START, BoundDescription, without_binding
from orchestrator.fmi.values import Scalar

_FLOW = ("Q_0", "theta_0")
_STUDY = ("S_n", "P_0", "v_0")


@dataclass(frozen=True)
class ParameterRow:
    name: str
    unit: str
    start: Scalar | None
    used: Scalar | None
    changed_by: str
    description: str


def parameter_rows(c: Certification) -> list[ParameterRow]:
    """Parameters, and inputs that are held, in the order of the file."""
    values = {own: (value, by) for own, value, by in _values(c, c.description)}
    rows = []
    for info in without_binding(c.description).variables.values():
        if info.causality == "parameter" or info.name in values:
            start = _start(info)
            used, by = values.get(info.name, (start, ""))
            rows.append(ParameterRow(info.name, info.unit, start, used, by, info.description))
    return rows


def _start(info: VariableInfo) -> Scalar | None:
    """As reports have it: all numbers as floats, items of an enumeration as text."""
    if info.start is None or isinstance(info.start, bool | str):
        return info.start
    return str(info.start) if info.type == "Enumeration" else float(info.start)


def _values(c: Certification, description: FmuDescription) -> Iterator[tuple[str, Scalar, str]]:
    """The FMU's own name, the value and its origin, for every variable that is not left at its start value."""
    bound = description if isinstance(description, BoundDescription) else None
    given = {name.partition(".")[2]: v for name, v in c.values.items() if name.startswith(f"{CONVERTER}.")}
    if bound:
        for own, value in bound.port.settings.items():
            yield own, value, "the binding"
        rating = float(given.get("S_n", bound.port.rating)) / bound.port.rating
        for name, maps in bound.port.start.items():
            value = float(given.get(name, bound.variables[name].start_number))
            for m in maps:
                scale = rating if m.per_rating else 1.0
                yield m.variable, scale * m.factor * value + m.offset, f"{_by(c, name)}, {name} of the binding"
    for name, passed in given.items():
        target = bound.inner_names.get(name) if bound else name
        if target is not None and not (bound and name in START):
            yield target, passed, _by(c, name)


def _by(c: Certification, name: str) -> str:
    if name in c.request.values:
        return "--set"
    if name in c.controllers.settings:
        return "--pod"
    if name in _FLOW:
        return f"the power flow at X_L = {c.request.reactances[0]:g} pu"
    return "the study" if name in _STUDY else "the step size of the study"

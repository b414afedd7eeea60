"""Checks of what an FMU declares: the standard, units, start values, dependencies."""

from math import isfinite
from pathlib import Path
from xml.etree import ElementTree

from orchestrator.core.errors import few
from orchestrator.core.units import base_exponents
from orchestrator.devices.acceptance.checks.base import (
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.subject import Subject
from orchestrator.devices.fmi.archive import MODEL_DESCRIPTION
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo
from orchestrator.devices.fmi.port_mapping import without_binding
from orchestrator.devices.fmi.validation import validation_problems

_SOME = 3
_PORT_UNITS = {
    "v_re": ("pu", "V", "kV"),
    "v_im": ("pu", "V", "kV"),
    "i_re": ("pu", "A", "kA"),
    "i_im": ("pu", "A", "kA"),
}
_PLAIN = ("", "1", "-", "%", "pu", "p.u.", "p.u", "per unit", "per_unit")
_BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@check("fmi_validity", "Does the file keep to FMI 2.0?")
def fmi_validity(subject: Subject) -> CheckResult:
    grave, harmless = validation_problems(subject.directory)
    identifier = without_binding(subject.description).model_identifier
    if not identifier.isidentifier():
        harmless.append(f"modelIdentifier {identifier!r} is not a C identifier")
    if grave:
        return failed(
            "fmi_validity", "invalid FMI", few(grave, _SOME, "; "), problems=grave + harmless
        )
    if harmless:
        remedy = "breaks the standard without changing an answer here; tell the author"
        return remarked("fmi_validity", few(harmless, _SOME, "; "), remedy, problems=harmless)
    return passed("fmi_validity", "FMPy's validator finds no problem")


@check("units", "Are units declared, known, and what their definitions say?")
def units(subject: Subject) -> CheckResult:
    described = without_binding(subject.description)
    bound = described is not subject.description
    wrong = _wrong_definitions(subject.directory) + _wrong_port_units(described, bound=bound)
    if wrong:
        return failed("units", "wrong units", few(wrong, _SOME, "; "))
    open_ends = [
        v.name
        for v in described.variables.values()
        if v.causality in ("input", "output") and v.type == "Real" and not v.unit
    ]
    if open_ends:
        return remarked(
            "units",
            f"no unit is declared for {few(open_ends, _SOME, '; ')}",
            "say the unit in the binding",
        )
    return passed("units", "every Real input and output has a unit that fits its definition")


def _wrong_definitions(directory: Path) -> list[str]:
    """Units whose name says one thing and whose BaseUnit another."""
    wrong = []
    for unit in (
        ElementTree.parse(directory / MODEL_DESCRIPTION).getroot().iterfind("UnitDefinitions/Unit")
    ):
        name, base = unit.get("name", ""), unit.find("BaseUnit")
        known = None if base is None or name in _PLAIN else base_exponents(name)
        if known is None or base is None:
            continue
        factor, exponents = known
        declared = {key: int(base.get(key, "0")) for key in _BASE_UNITS}
        # An angle may be counted as a number, so rad decides nothing.
        differs = [k for k in _BASE_UNITS if k != "rad" and declared[k] != exponents.get(k, 0)]
        said = float(base.get("factor", "1"))
        if differs:
            wrong.append(
                f"unit {name!r} is defined with {differs[0]}^{declared[differs[0]]}, which it does not have"
                if declared[differs[0]]
                else f"unit {name!r} is defined without its {differs[0]}"
            )
        elif abs(said - factor) > 1e-6 * factor and not float(base.get("offset", "0")):
            wrong.append(f"unit {name!r} is defined as {said:g} SI units; it is {factor:g}")
    return wrong


def _wrong_port_units(described: FmuDescription, *, bound: bool) -> list[str]:
    """Where an FMU has our port's names, its units must be able to mean the port; a binding may convert them."""
    variables = described.variables
    if not set(_PORT_UNITS) <= set(variables):
        return []
    foreign, to_bind = [], []
    for name, allowed in _PORT_UNITS.items():
        unit = variables[name].unit
        quantity = "voltage" if name[0] == "v" else "current"
        if unit not in (*_PLAIN, *allowed):
            foreign.append(f"{name} is declared in {unit!r}, no unit of a {quantity}")
        if unit in allowed[1:] and not bound:
            to_bind.append(f"{name} is declared in {unit!r}; without a binding it must be pu")
    return foreign + to_bind


@check("declared_starts", "Does every input and parameter start, within its own bounds?")
def declared_starts(subject: Subject) -> CheckResult:
    missing, wrong = [], []
    for info in without_binding(subject.description).variables.values():
        if (
            info.causality not in ("input", "parameter") or info.type == "Clock"
        ):  # a clock ticks, and starts at nothing
            continue
        if info.start is None:
            missing.append(info.name)
        elif info.type == "Real" and (text := _out_of_bounds(info)):
            wrong.append(text)
    if missing or wrong:
        texts = wrong + ([f"no start value: {few(missing, _SOME, '; ')}"] if missing else [])
        return failed("declared_starts", "bad start values", few(texts, _SOME, "; "))
    return passed("declared_starts", "all have a start value within their bounds")


def _out_of_bounds(info: VariableInfo) -> str | None:
    value = info.start_number
    if not isfinite(value):
        return f"{info.name} starts at {value}"
    low = -float("inf") if info.minimum is None else info.minimum
    high = float("inf") if info.maximum is None else info.maximum
    return (
        None
        if low <= value <= high
        else f"{info.name} starts at {value:g}, outside of {low:g} to {high:g}"
    )


@check("declared_dependencies", "Does the file say what its outputs depend on?")
def declared_dependencies(subject: Subject) -> CheckResult:
    described = without_binding(subject.description)
    if not described.outputs:
        return not_applicable("declared_dependencies", "because the FMU has no outputs")
    silent = [name for name in described.outputs if described.output_dependencies.get(name) is None]
    if silent and described.inputs:
        says = f"nothing is said of {few(silent, _SOME, '; ')}, so all inputs are assumed to act at once"
        return remarked(
            "declared_dependencies",
            says,
            "ask for the dependencies, so that a master can order its calls",
        )
    return passed(
        "declared_dependencies", f"all {len(described.outputs)} outputs say what they depend on"
    )

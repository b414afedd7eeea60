"""The part of modelDescription.xml that FMI 2.0 and FMI 3.0 share, from a model's declarations.

`description` and `native_fmu` write the rest: the names that a version gives its elements, and their order."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

from fmus.toolchain.dependencies import Unknown, structure, unlisted
from fmus.toolchain.model import Model
from fmus.toolchain.variables import (
    UNITS,
    CalculatedParameter,
    Input,
    Output,
    Parameter,
    State,
    Variable,
)

TOOL = "gfor-cosim"
COMPONENT = f"{TOOL}.Component"  # names of our annotations

_IN_ATTRIBUTES = str.maketrans(
    {
        "&": "&amp;",
        "<": "&lt;",
        ">": "&gt;",
        '"': "&quot;",
        "\r": "&#13;",
        "\n": "&#10;",
        "\t": "&#09;",
    }
)
"""Characters that an attribute of XML has in another form."""

_IN_TEXT = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})
"""The same in an element's text. It is what xml.sax.saxutils does, which imports clients of HTTP and of TLS."""

_CALCULATED = {"causality": "local", "variability": "continuous", "initial": "calculated"}


@dataclass(frozen=True)
class DescribedVariable:
    """A variable as both versions declare it."""

    # value reference; FMI 2.0's index is greater by one, as the file lists variables in this order
    reference: int
    attributes: Mapping[str, str]  # name, value reference, text, causality, variability and initial
    kind: str  # name of the type in FMI 2.0
    own: Mapping[str, str]  # attributes of the type: start, bounds and unit
    # value reference of the state whose time derivative it is; None for all others
    derivative_of: int | None = None


def root_element(model: Model, version: str, identity: Mapping[str, str], tool: str) -> Element:
    """The file's outermost element.

    ``identity``: The attribute that tells one FMU from another.
    ``tool``: Name and version for ``generationTool``. No date is written: equal contents give equal files."""
    attributes = {
        "fmiVersion": version,
        "modelName": model.name,
        **identity,
        "description": model.title,
        "generationTool": tool,
        "variableNamingConvention": "structured",
    }
    return Element("fmiModelDescription", attributes)


def write_definitions(root: Element, model: Model, prefix: str) -> None:
    """Declare units, categories of messages (``prefix`` is ``fmi2`` or ``fmi3``) and the default experiment."""
    _write_units(root, model)
    write_log_categories(root, prefix)
    SubElement(root, "DefaultExperiment", startTime="0", stopTime="20", stepSize="1e-4")


def described_variables(model: Model) -> Iterator[DescribedVariable]:
    """All variables in the order of their value references; the states' time derivatives come last."""
    for reference, variable in enumerate(model.variables):
        attributes, kind, own = _attributes_of(variable)
        yield DescribedVariable(
            reference,
            _naming_attributes(variable.name, reference, variable.text) | attributes,
            kind,
            own,
        )
    for state in model.states:
        name = f"der({state.name})"
        reference = model.value_references[name]
        yield DescribedVariable(
            reference,
            _naming_attributes(name, reference, f"Time derivative of {state.name}") | _CALCULATED,
            "Real",
            {"unit": _derivative_unit(state)},
            model.value_references[state.name],
        )


def unknowns(model: Model, *, listed: bool = True) -> dict[str, tuple[Unknown, ...]]:
    """Outputs, derivatives and initial unknowns with what each depends on, by the names of FMI 3.0."""
    known = structure(model) if listed else unlisted(model)
    return {
        "Output": known.outputs,
        "ContinuousStateDerivative": known.derivatives,
        "InitialUnknown": known.initial,
    }


def component_element(model: Model) -> Element:
    """Our annotation: the component's kind, and the usual ranges of its parameters."""
    element = Element("Component", {"kind": model.kind} if model.kind else {})
    for parameter in model.parameters:
        usual = parameter.usual
        if usual is not None:
            bounds = {
                "name": parameter.name,
                "low": repr(float(usual.low)),
                "high": repr(float(usual.high)),
            }
            SubElement(
                element,
                "Usual",
                bounds | ({"orZero": "true"} if usual.or_zero else {}) | {"why": usual.why},
            )
    return element


def text_of(root: Element) -> bytes:
    """A description as Python's `ElementTree` writes it, in a fifth of the time: large networks have many elements."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>']
    _write(root, "", lines)
    return "\n".join([*lines, ""]).encode()


def _write(element: Element, margin: str, lines: list[str]) -> None:
    """Add the lines of an element, which has either elements, or one line of text, or neither."""
    attributes = "".join(
        [f' {name}="{value.translate(_IN_ATTRIBUTES)}"' for name, value in element.items()]
    )
    if not len(element):
        end = f">{element.text.translate(_IN_TEXT)}</{element.tag}>" if element.text else " />"
        lines.append(f"{margin}<{element.tag}{attributes}{end}")
        return
    lines.append(f"{margin}<{element.tag}{attributes}>")
    for one in element:
        _write(one, margin + "  ", lines)
    lines.append(f"{margin}</{element.tag}>")


def _derivative_unit(state: State) -> str:
    return f"{state.unit}/s"


def _naming_attributes(name: str, reference: int, text: str) -> dict[str, str]:
    return {"name": name, "valueReference": str(reference), "description": text}


def write_log_categories(root: Element, prefix: str) -> None:
    """Declare the categories of messages; ``prefix`` is ``fmi2`` or ``fmi3``."""
    categories = SubElement(root, "LogCategories")
    for status in ("Warning", "Discard", "Error", "Fatal"):
        description = f"Messages with {prefix}{status} status"
        SubElement(categories, "Category", name=f"logStatus{status}", description=description)
    SubElement(categories, "Category", name="logAll", description="All messages")


def _write_units(root: Element, model: Model) -> None:
    """Every unit in use; only real variables have one."""
    without = {parameter.name for parameter in model.parameters if parameter.type != "Real"}
    used = {v.unit for v in model.variables if v.name not in without} | {
        _derivative_unit(s) for s in model.states
    }
    definitions = SubElement(root, "UnitDefinitions")
    for unit in sorted(used):
        element = SubElement(definitions, "Unit", name=unit)
        exponents = {key: f"{value:g}" for key, value in UNITS[unit].items()}
        if exponents:
            SubElement(element, "BaseUnit", exponents)


def _attributes_of(variable: Variable) -> tuple[dict[str, str], str, dict[str, str]]:
    """Causality, variability and initial; the type's name in FMI 2.0; and the attributes that the type has."""
    match variable:
        case Parameter(type=kind):
            attributes = {
                "causality": "parameter",
                "variability": "tunable" if variable.tunable else "fixed",
                "initial": "exact",
            }
            return attributes, kind, _parameter_type(variable)
        case CalculatedParameter():
            attributes = {
                "causality": "calculatedParameter",
                "variability": "fixed",
                "initial": "calculated",
            }
            return attributes, "Real", {"unit": variable.unit}
        case Input():
            attributes = {"causality": "input", "variability": "continuous"}
            return attributes, "Real", {"unit": variable.unit, "start": repr(float(variable.start))}
        case Output():
            attributes = {
                "causality": "output",
                "variability": "continuous",
                "initial": "calculated",
            }
            return attributes, "Real", {"unit": variable.unit}
        case _:
            return _CALCULATED, "Real", {"unit": variable.unit}


def _parameter_type(parameter: Parameter) -> dict[str, str]:
    if parameter.type == "Boolean":
        return {"start": "true" if parameter.start else "false"}
    convert = int if parameter.type == "Integer" else float
    bounds = {"min": parameter.minimum, "max": parameter.maximum, "start": parameter.start}
    attributes = {key: repr(convert(value)) for key, value in bounds.items() if value is not None}
    return attributes if parameter.type == "Integer" else {"unit": parameter.unit, **attributes}

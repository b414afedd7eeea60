"""Parameter values (.ssv) and parameter mappings (.ssm)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

from orchestrator.core.errors import InputError
from orchestrator.systems.coupling.system import ComponentPlan
from orchestrator.systems.ssp.names import SSP_VERSION, children, tag
from orchestrator.systems.ssp.units import units_in

# one name for the sets of all components: some tools ask by name which to apply
SET_NAME = "initialValues"


@dataclass(frozen=True, slots=True)
class SspValue:
    """A value of a parameter set; ``unit`` is empty if the set gives no unit.

    ``base``: attributes of ``BaseUnit`` that define the unit; None if the file has no definition of it."""

    value: float | bool | str
    unit: str = ""
    base: Mapping[str, str] | None = None


def write_parameter_set(name: str, plan: ComponentPlan, tool: str) -> Element:
    """All values that a component is given before initialisation, each in its variable's own unit."""
    variables = plan.description.variables
    root = Element(tag("ssv:ParameterSet"), version=SSP_VERSION, name=SET_NAME, generationTool=tool)
    parameters = SubElement(root, tag("ssv:Parameters"))
    values = plan.parameters | plan.inputs
    for variable, value in values.items():
        info = variables[variable]
        entry = SubElement(parameters, tag("ssv:Parameter"), name=variable)
        match info.type:
            case "Boolean":
                SubElement(entry, tag("ssv:Boolean"), value="true" if value else "false")
            case "Integer":
                SubElement(entry, tag("ssv:Integer"), value=str(int(value)))
            case "Real":
                unit = {"unit": info.unit} if info.unit else {}
                SubElement(entry, tag("ssv:Real"), {"value": repr(float(value)), **unit})
            case _:
                raise InputError(
                    f"component {name!r}: {variable} is of type {info.type}, whose values cannot be written to an SSP"
                )
    used = dict.fromkeys(
        variables[v].unit for v in values if variables[v].type == "Real" and variables[v].unit
    )
    write_units(root, tag("ssv:Units"), used, plan.description.units)
    return root


def write_units(
    parent: Element, name: str, used: Iterable[str], known: Mapping[str, Mapping[str, str]]
) -> None:
    """Define the units that a file uses; a file without units gets no definitions.

    ``parent``: takes the group of units as its last element.
    ``name``: name of the group of units, with its namespace.
    ``known``: attributes of ``BaseUnit`` by unit; a unit that is missing here gets no attributes."""
    units = [(unit, known.get(unit, {})) for unit in used]
    if units:
        group = SubElement(parent, name)
        for unit, base in units:
            SubElement(
                SubElement(group, tag("ssc:Unit"), name=unit), tag("ssc:BaseUnit"), dict(base)
            )


def read_parameter_set(
    root: Element, around: Mapping[str, Mapping[str, str]] | None = None
) -> dict[str, SspValue]:
    """The values by name; ``around`` has the units of the file that the set stands in, which its own come before."""
    if root.tag != tag("ssv:ParameterSet"):
        raise InputError(f"{root.tag!r} is not a parameter set of SSP 1.0")
    values, units = {}, {**(around or {}), **units_in(root, "ssv:Units")}
    for parameter in children(root, "ssv:Parameters/ssv:Parameter"):
        name = parameter.get("name", "")
        element = next((e for e in parameter if e.tag != tag("ssv:Annotations")), None)
        if element is None:
            raise InputError(f"parameter {name!r} has no value")
        unit = element.get("unit", "")
        values[name] = SspValue(_value(name, element), unit, units.get(unit))
    return values


def _value(name: str, element: Element) -> float | bool | str:
    kind, text = element.tag.rpartition("}")[2], (element.get("value") or "").strip()
    try:
        match kind:
            case "Real":
                return float(text)
            case "Integer" if len(text) <= 20:
                return int(text)
            case "Boolean" if text in ("true", "false", "1", "0"):
                return text in ("true", "1")
            case "String" | "Enumeration":
                return text
    except ValueError:
        pass
    raise InputError(f"parameter {name!r}: {text!r} is not a value of type {kind} that can be read")


def read_parameter_mapping(root: Element) -> dict[str, str]:
    if root.tag != tag("ssm:ParameterMapping"):
        raise InputError(f"{root.tag!r} is not a parameter mapping of SSP 1.0")
    mapping = {}
    for entry in children(root, "ssm:MappingEntry"):
        source, target = entry.get("source", ""), entry.get("target", "")
        change = next(
            (e.tag.rpartition("}")[2] for e in entry if e.tag.endswith("Transformation")), None
        )
        if change:
            raise InputError(
                f"the mapping of {source!r} to {target!r} has a {change}, which is not supported; give the value as "
                "the component takes it"
            )
        mapping[target] = source
    return mapping

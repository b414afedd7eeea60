"""modelDescription.xml of FMI 2.0 for co-simulation, from a model's declarations.

Beyond what the standard demands it declares every continuous state with its derivative, and what
each output and derivative depends on, so that a master can order its calls and linearise.
"""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fmus.toolchain.dependencies import structure
from fmus.toolchain.model import Model
from fmus.toolchain.variables import UNITS, CalculatedParameter, Input, Output, Parameter, State, Variable

TOOL = "gfor-cosim"


def model_description(model: Model, guid: str, identifier: str, tool: str, *, native: bool = False) -> bytes:
    """Return the file's text.

    Parameters
    ----------
    model
        What the FMU computes.
    guid, identifier
        As in the standard; the identifier also names the binaries.
    tool
        Name and version for ``generationTool``. No date is written: equal contents give equal files.
    native
        Whether the FMU runs without Python; a native one gives directional derivatives too.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model.name,
        guid=guid,
        description=model.title,
        generationTool=tool,
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier,
        needsExecutionTool="false" if native else "true",
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
        providesDirectionalDerivative="true" if native else "false",
    )
    write_units(root, model)
    write_log_categories(root, "fmi2")
    SubElement(root, "DefaultExperiment", startTime="0", stopTime="20", stepSize="1e-4")
    annotation = SubElement(SubElement(root, "VendorAnnotations"), "Tool", name=TOOL)
    SubElement(annotation, "ContinuousStates", settable="true")
    _variables(root, model)
    _structure(root, model)
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def derivative_unit(state: State) -> str:
    """Unit of a state's time derivative."""
    return f"{state.unit}/s"


def write_log_categories(root: Element, prefix: str) -> None:
    """Declare the categories of messages; the same in both versions of FMI."""
    categories = SubElement(root, "LogCategories")
    for status in ("Warning", "Discard", "Error", "Fatal"):
        description = f"Messages with {prefix}{status} status"
        SubElement(categories, "Category", name=f"logStatus{status}", description=description)
    SubElement(categories, "Category", name="logAll", description="All messages")


def write_units(root: Element, model: Model) -> None:
    """Declare every unit in use; the same in both versions of FMI."""
    used = {v.unit for v in model.variables} | {derivative_unit(s) for s in model.states}
    definitions = SubElement(root, "UnitDefinitions")
    for unit in sorted(used):
        element = SubElement(definitions, "Unit", name=unit)
        exponents = {key: f"{value:g}" for key, value in UNITS[unit].items()}
        if exponents:
            SubElement(element, "BaseUnit", exponents)


def _variables(root: Element, model: Model) -> None:
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(model.variables):
        attributes, kind, own = attributes_of(variable)
        element = SubElement(
            variables,
            "ScalarVariable",
            {
                "name": variable.name,
                "valueReference": str(reference),
                "description": variable.text,
                **attributes,
            },
        )
        SubElement(element, kind, own)
    first_state = len(model.parameters) + len(model.calculated) + len(model.inputs)
    for position, state in enumerate(model.states):
        name = f"der({state.name})"
        element = SubElement(
            variables,
            "ScalarVariable",
            name=name,
            valueReference=str(model.value_references[name]),
            description=f"Time derivative of {state.name}",
            causality="local",
            variability="continuous",
            initial="calculated",
        )
        SubElement(element, "Real", unit=derivative_unit(state), derivative=str(first_state + position + 1))


def attributes_of(variable: Variable) -> tuple[dict[str, str], str, dict[str, str]]:
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
            attributes = {"causality": "calculatedParameter", "variability": "fixed", "initial": "calculated"}
            return attributes, "Real", {"unit": variable.unit}
        case Input():
            attributes = {"causality": "input", "variability": "continuous"}
            return attributes, "Real", {"unit": variable.unit, "start": repr(float(variable.start))}
        case Output():
            attributes = {"causality": "output", "variability": "continuous", "initial": "calculated"}
            return attributes, "Real", {"unit": variable.unit}
        case _:
            attributes = {"causality": "local", "variability": "continuous", "initial": "calculated"}
            return attributes, "Real", {"unit": variable.unit}


def _parameter_type(parameter: Parameter) -> dict[str, str]:
    if parameter.type == "Boolean":
        return {"start": "true" if parameter.start else "false"}
    convert = int if parameter.type == "Integer" else float
    bounds = {"min": parameter.minimum, "max": parameter.maximum, "start": parameter.start}
    attributes = {key: repr(convert(value)) for key, value in bounds.items() if value is not None}
    return attributes if parameter.type == "Integer" else {"unit": parameter.unit, **attributes}


def _structure(root: Element, model: Model) -> None:
    """Outputs and derivatives with what they depend on; initial unknowns with theirs."""
    known = structure(model)
    groups = {"Outputs": known.outputs, "Derivatives": known.derivatives, "InitialUnknowns": known.initial}
    element = SubElement(root, "ModelStructure")
    for name, unknowns in groups.items():
        if unknowns or name == "InitialUnknowns":
            parent = SubElement(element, name)
            for unknown in unknowns:
                dependencies = " ".join(str(reference + 1) for reference in unknown.known)
                SubElement(parent, "Unknown", index=str(unknown.reference + 1), dependencies=dependencies)

"""modelDescription.xml of FMI 3.0 for co-simulation, from a model's declarations."""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fmus.toolchain.dependencies import Unknown, structure
from fmus.toolchain.description import TOOL, attributes_of, derivative_unit, write_log_categories, write_units
from fmus.toolchain.model import Model

_TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean"}


def model_description_3(model: Model, token: str, identifier: str, tool: str) -> bytes:
    """Return the file's text.

    Parameters
    ----------
    model
        What the FMU computes.
    token, identifier
        As in the standard; the identifier also names the binaries.
    tool
        Name and version for ``generationTool``.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=model.name,
        instantiationToken=token,
        description=model.title,
        generationTool=tool,
        variableNamingConvention="structured",
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier,
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        providesDirectionalDerivatives="true",
        providesAdjointDerivatives="true",
    )
    write_units(root, model)
    write_log_categories(root, "fmi3")
    SubElement(root, "DefaultExperiment", startTime="0", stopTime="20", stepSize="1e-4")
    _variables(root, model)
    _structure(root, model)
    annotations = SubElement(root, "Annotations")
    SubElement(annotations, "Annotation", type=f"{TOOL}.ContinuousStates").text = "settable"
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _variables(root: Element, model: Model) -> None:
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(model.variables):
        attributes, kind, own = attributes_of(variable)
        common = {"name": variable.name, "valueReference": str(reference), "description": variable.text}
        SubElement(variables, _TYPES[kind], {**common, **attributes, **own})
    for state in model.states:
        name = f"der({state.name})"
        SubElement(
            variables,
            "Float64",
            name=name,
            valueReference=str(model.value_references[name]),
            description=f"Time derivative of {state.name}",
            causality="local",
            variability="continuous",
            initial="calculated",
            unit=derivative_unit(state),
            derivative=str(model.value_references[state.name]),
        )
    SubElement(
        variables,
        "Float64",
        name="time",
        valueReference=str(len(model.value_references)),
        description="Time",
        causality="independent",
        variability="continuous",
        unit="s",
    )


def _structure(root: Element, model: Model) -> None:
    known = structure(model)
    element = SubElement(root, "ModelStructure")

    def write(name: str, unknowns: tuple[Unknown, ...]) -> None:
        for unknown in unknowns:
            SubElement(
                element,
                name,
                valueReference=str(unknown.reference),
                dependencies=" ".join(map(str, unknown.known)),
            )

    write("Output", known.outputs)
    write("ContinuousStateDerivative", known.derivatives)
    write("InitialUnknown", known.initial)

"""modelDescription.xml of FMI 3.0 for co-simulation, from a model's declarations."""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fmus.toolchain import description_common as common
from fmus.toolchain.model import Model

_TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean"}  # FMI 2.0's name of a type → FMI 3.0's


def model_description_3(model: Model, token: str, identifier: str, tool: str) -> bytes:
    """Return the file's text.

    ``token``, ``identifier``: As in the standard; the identifier also names the binaries.
    ``tool``: Name and version for ``generationTool``."""
    root = common.root_element(model, "3.0", {"instantiationToken": token}, tool)
    SubElement(
        root, "CoSimulation", modelIdentifier=identifier, canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUState="true", canSerializeFMUState="true", providesDirectionalDerivatives="true",
        providesAdjointDerivatives="true",
    )  # fmt: skip
    common.write_definitions(root, model, "fmi3")
    _variables(root, model)
    _structure(root, model)
    annotations = SubElement(root, "Annotations")
    SubElement(annotations, "Annotation", type=f"{common.TOOL}.ContinuousStates").text = "settable"
    SubElement(annotations, "Annotation", type=common.COMPONENT).append(common.component_element(model))
    return common.text_of(root)


def build_description(identifier: str, source_file: str) -> bytes:
    """The text of sources/buildDescription.xml: how a tool compiles the FMU."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    SubElement(SubElement(configuration, "SourceFileSet", language="C11"), "SourceFile", name=source_file)
    return common.text_of(root)


def _variables(root: Element, model: Model) -> None:
    variables = SubElement(root, "ModelVariables")
    for variable in common.described_variables(model):
        state = variable.derivative_of
        more = {} if state is None else {"derivative": str(state)}
        SubElement(variables, _TYPES[variable.kind], {**variable.attributes, **variable.own, **more})
    SubElement(
        variables, "Float64", name="time", valueReference=str(len(model.value_references)), description="Time",
        causality="independent", variability="continuous", unit="s",
    )  # fmt: skip


def _structure(root: Element, model: Model) -> None:
    element = SubElement(root, "ModelStructure")
    for kind, group in common.unknowns(model).items():
        for unknown in group:
            given = {} if unknown.known is None else {"dependencies": " ".join(map(str, unknown.known))}
            SubElement(element, kind, {"valueReference": str(unknown.reference), **given})


KIND = "org.gfor-cosim.electrical.network-frame"
"""Voltage and injected current as complex phasors in the frame turning at rated frequency, in pu."""

_MEMBERS = {"v_re": "signal", "v_im": "signal", "i_re": "outflow", "i_im": "outflow"}


def has_port(model: Model) -> bool:
    """Whether a model meets the grid through a bus voltage and an injected current."""
    return set(_MEMBERS) <= {v.name for v in (*model.inputs, *model.outputs)}


def terminals_and_icons(model: Model) -> bytes:
    """Return the file's text, for a model that has a port."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    terminal = SubElement(
        SubElement(root, "Terminals"), "Terminal", name="bus", matchingRule="bus", terminalKind=KIND,
        description=f"Electrical port of {model.name} in the network frame: bus voltage and injected current",
    )  # fmt: skip
    for name, kind in _MEMBERS.items():
        SubElement(terminal, "TerminalMemberVariable", variableName=name, memberName=name, variableKind=kind)
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()

"""modelDescription.xml of FMI 2.0 for co-simulation, from a model's declarations.

Beyond what the standard demands it declares every continuous state with its derivative, and what
each output and derivative depends on, so that a master can order its calls and linearise."""

from xml.etree.ElementTree import Element, SubElement

from fmus.toolchain import description_common as common
from fmus.toolchain.model import Model

_GROUPS = {
    "Output": "Outputs",
    "ContinuousStateDerivative": "Derivatives",
    "InitialUnknown": "InitialUnknowns",
}
"""FMI 2.0's name of the list of each kind of unknown."""


def model_description(
    model: Model,
    guid: str,
    identifier: str,
    tool: str,
    *,
    native: bool = False,
    listed: bool = True,
    source_file: str = "",
) -> bytes:
    """Return the file's text.

    ``guid``, ``identifier``: As in the standard; the identifier also names the binaries.
    ``tool``: Name and version for ``generationTool``.
    ``native``: Whether the FMU runs without Python; a native one gives directional derivatives too.
    ``listed``: Whether dependencies are listed; without them the text is there at once.
    ``source_file``: Name of the C file in the folder ``sources``; empty without one."""
    root = common.root_element(model, "2.0", {"guid": guid}, tool)
    root.set("numberOfEventIndicators", "0")
    kind = SubElement(
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
    if source_file:
        SubElement(SubElement(kind, "SourceFiles"), "File", name=source_file)
    common.write_definitions(root, model, "fmi2")
    annotations = SubElement(root, "VendorAnnotations")
    SubElement(
        SubElement(annotations, "Tool", name=common.TOOL), "ContinuousStates", settable="true"
    )
    # a Tool has one element
    SubElement(annotations, "Tool", name=common.COMPONENT).append(common.component_element(model))
    _variables(root, model)
    _structure(root, model, listed=listed)
    return common.text_of(root)


def with_guid(text: str, guid: str, attribute: str = "guid") -> bytes:
    """The text of a description that was made with an empty guid, with this one."""
    return text.replace(f' {attribute}=""', f' {attribute}="{guid}"', 1).encode()


def _index(reference: int) -> str:
    """Place of a variable in the file, counted from one: FMI 2.0 refers to variables by it."""
    return str(reference + 1)


def _variables(root: Element, model: Model) -> None:
    variables = SubElement(root, "ModelVariables")
    for variable in common.described_variables(model):
        state = variable.derivative_of
        more = {} if state is None else {"derivative": _index(state)}
        element = SubElement(variables, "ScalarVariable", dict(variable.attributes))
        SubElement(element, variable.kind, {**variable.own, **more})


def _structure(root: Element, model: Model, *, listed: bool) -> None:
    """Write outputs, derivatives and initial unknowns, each with the variables that it depends on."""
    element = SubElement(root, "ModelStructure")
    for kind, group in common.unknowns(model, listed=listed).items():
        if group or kind == "InitialUnknown":
            parent = SubElement(element, _GROUPS[kind])
            for unknown in group:
                given = (
                    {}
                    if unknown.known is None
                    else {"dependencies": " ".join(map(_index, unknown.known))}
                )
                SubElement(parent, "Unknown", {"index": _index(unknown.reference), **given})

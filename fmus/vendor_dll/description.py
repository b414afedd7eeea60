"""modelDescription.xml of the FMU around a DLL."""

from xml.etree.ElementTree import Element, SubElement

from fmus.toolchain.dependencies import structure
from fmus.toolchain.description_common import TOOL, text_of, write_log_categories
from fmus.toolchain.model import Model
from fmus.toolchain.variables import UNITS, Input, Output
from fmus.vendor_dll import source
from fmus.vendor_dll.interface import DATA_TYPES, DllInterface, DllParameter
from fmus.vendor_dll.state_trial import Trial

_LONGEST_WHY = 500


def dll_description(
    interface: DllInterface,
    trial: Trial,
    variables: tuple[source.HostVariable, ...],
    guid: str,
    identifier: str,
    tool: str,
    circuit: Model | None = None,
) -> bytes:
    """The file's text.

    States are declared as our extension of FMI, which has no discrete states in co-simulation: ``DiscreteStates`` names
    the variables that the next sample depends on and that a master may set."""
    attributes = {
        "fmiVersion": "2.0",
        "modelName": interface.texts["ModelName"] or identifier,
        "guid": guid,
        "description": interface.texts["ModelDescription"],
        "author": interface.texts["ModelCreator"],
        "version": interface.texts["ModelVersion"],
        "generationTool": tool,
        "numberOfEventIndicators": "0",
    }
    root = Element(
        "fmiModelDescription", {name: value for name, value in attributes.items() if value}
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier,
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true" if trial.state in ("arrays", "library") else "false",
        canSerializeFMUstate="true" if trial.state == "arrays" else "false",
    )
    units = sorted({v.unit for v in variables if v.unit and v.kind == "Real"})
    if units:
        definitions = SubElement(root, "UnitDefinitions")
        for unit in units:
            element = SubElement(definitions, "Unit", name=unit)
            exponents = {key: f"{value:g}" for key, value in UNITS.get(unit, {}).items()}
            if exponents:
                SubElement(element, "BaseUnit", exponents)
    write_log_categories(root, "fmi2")
    experiment = SubElement(root, "DefaultExperiment", startTime="0")
    if interface.sample_time > 0:
        experiment.set("stepSize", repr(interface.sample_time))
    states = " ".join(str(place) for place, v in enumerate(variables) if v.is_state)
    annotation = SubElement(SubElement(root, "VendorAnnotations"), "Tool", name=TOOL)
    sampled = {"sampleTime": repr(interface.sample_time)} if interface.sample_time > 0 else {}
    if circuit is not None:  # its phase quantities repeat with the network's period
        sampled["frequency"] = "f_n"
    told = {"settable": "true", "valueReferences": states, "keptIn": trial.state} | (
        {"why": _plain(trial.why)} if trial.why else {}
    )
    SubElement(annotation, "DiscreteStates", told | sampled)
    listed = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        _write(listed, reference, variable)
    structure_element = SubElement(root, "ModelStructure")
    known = _dependencies(variables, circuit)
    if known:
        parent = SubElement(structure_element, "Outputs")
        for index, follows in known.items():
            SubElement(
                parent, "Unknown", index=str(index), dependencies=" ".join(map(str, follows))
            )
        initial = SubElement(structure_element, "InitialUnknowns")
        for index in known:
            SubElement(initial, "Unknown", index=str(index))
    return text_of(root)


def _plain(words: str) -> str:
    """A DLL's own words without characters that XML cannot hold."""
    return "".join(c if c.isprintable() else " " for c in words)[:_LONGEST_WHY]


def _dependencies(
    variables: tuple[source.HostVariable, ...], circuit: Model | None
) -> dict[int, list[int]]:
    """Index of each output → indices of the inputs it follows at once; the DLL's are held since the last sample."""
    known: dict[int, list[int]] = {
        place: []
        for place, v in enumerate(variables, start=1)
        if v.role == source.OUTPUT and not v.local
    }
    if circuit is None:
        return known
    index = {v.name: place for place, v in enumerate(variables, start=1)}
    names = [v.name for v in circuit.variables]
    for unknown in structure(circuit).outputs:
        if variables[index[names[unknown.reference]] - 1].local:
            continue
        follows = [names[k] for k in unknown.known or () if isinstance(circuit.variables[k], Input)]
        known[index[names[unknown.reference]]] = [
            index[name]
            for name in follows
            if variables[index[name] - 1].role == source.CIRCUIT_INPUT
        ]
    return known


def _write(listed: Element, reference: int, variable: source.HostVariable) -> None:
    real = variable.kind == "Real"
    own = {"unit": variable.unit} if variable.unit and real else {}
    start = repr(variable.start) if real else str(int(variable.start))
    if variable.kind == "Boolean":
        start = "true" if variable.start else "false"
    match variable.role:
        case r if r in (source.PARAMETER, source.CIRCUIT_PARAMETER):
            assert variable.parameter is not None
            of = {"causality": "parameter", "variability": "fixed" if variable.fixed else "tunable"}
            whole = DATA_TYPES[variable.data_type].kind == "Integer" and isinstance(
                variable.parameter, DllParameter
            )
            for name, bound in (
                ("min", variable.parameter.minimum),
                ("max", variable.parameter.maximum),
            ):
                if bound is not None:
                    own[name] = str(int(bound)) if whole else repr(float(bound))
            own["start"] = start
        case r if r == source.INITIAL:
            of = {"causality": "parameter", "variability": "fixed"}
            own["start"] = start
        case r if r == source.CONSTANT_INPUT:
            of = {"causality": "parameter", "variability": "tunable"}
            own["start"] = start
        case r if r in (source.INPUT, source.CIRCUIT_INPUT):
            of = {"causality": "input", "variability": "continuous" if real else "discrete"}
            own["start"] = start
        case r if not variable.local and (
            r == source.OUTPUT or isinstance(variable.declared, Output)
        ):
            of = {"causality": "output", "variability": "continuous" if real else "discrete"}
        case _:
            of = {"causality": "local", "variability": "discrete"}
    attributes = {"name": variable.name, "valueReference": str(reference)}
    if variable.text:
        attributes["description"] = variable.text
    SubElement(SubElement(listed, "ScalarVariable", attributes | of), variable.kind, own)

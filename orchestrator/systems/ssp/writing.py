"""A coupled system as an SSP archive."""

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from urllib.parse import quote
from xml.etree.ElementTree import Element, SubElement

from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.converted_component import native
from orchestrator.systems.coupling.connections import Connection
from orchestrator.systems.coupling.imperfections import described
from orchestrator.systems.coupling.system import ComponentPlan, System
from orchestrator.systems.ssp.names import (
    FMU_TYPE,
    PARAMETER_SET_TYPE,
    SSP_VERSION,
    SYSTEM_FILE,
    plain_name,
    tag,
    xml_text,
)
from orchestrator.systems.ssp.parameter_sets import write_parameter_set, write_units
from orchestrator.systems.ssp.study import SspStudy, write_osp_step, write_study


def ssp_members(
    name: str, title: str, system: System, stop_time: float, study: SspStudy
) -> dict[str, bytes]:
    """Members of the archive by path: the structure, the components' values and their FMUs."""
    disturbed = described(system.wires)
    if disturbed:
        raise InputError(
            f"an SSP cannot hold what a connection does to its value ({disturbed[0]}); remove the imperfections from "
            "the case to export it"
        )
    tool = f"gfor-cosim {version('gfor-cosim')}"
    fmus = _file_names(system)
    sets, files = {}, dict[str, str]()
    for component, plan in system.components.items():
        if plan.parameters or plan.inputs:
            stems = [Path(file).stem for file in files.values()]
            files[component] = f"resources/{plain_name(component, stems)}.ssv"
            sets[files[component]] = write_parameter_set(component, plan, tool)
    contents = {
        SYSTEM_FILE: xml_text(
            _description(
                name,
                title,
                system=system,
                fmus=fmus,
                files=files,
                stop_time=stop_time,
                study=study,
                tool=tool,
            )
        )
    }
    contents |= {member: xml_text(root) for member, root in sets.items()}
    return contents | {member: path.read_bytes() for path, member in fmus.items()}


def _file_names(system: System) -> dict[Path, str]:
    """Name of the member for each FMU; each FMU is packed once."""
    members: dict[Path, str] = {}
    for plan in system.components.values():
        path = plan.description.path
        if path not in members:
            taken = [Path(member).stem for member in members.values()]
            members[path] = f"resources/{plain_name(path.stem, taken)}.fmu"
    return members


def _description(
    name: str,
    title: str,
    system: System,
    fmus: Mapping[Path, str],
    files: Mapping[str, str],
    stop_time: float,
    study: SspStudy,
    tool: str,
) -> Element:
    root = Element(
        tag("ssd:SystemStructureDescription"), version=SSP_VERSION, name=name, generationTool=tool
    )
    if title:
        root.set("description", title)
    top = SubElement(root, tag("ssd:System"), name=plain_name(name))
    elements = SubElement(top, tag("ssd:Elements"))
    for component, plan in system.components.items():
        source = fmus[plan.description.path]
        _component(elements, component, plan, quote(source), files.get(component), system)
    if system.connections:
        connections = SubElement(top, tag("ssd:Connections"))
        for c in system.connections:
            ends = {"startElement": c.source.component, "startConnector": c.source.variable}
            ends |= {"endElement": c.target.component, "endConnector": c.target.variable}
            if _differ(system, c):
                ends["suppressUnitConversion"] = "true"
            SubElement(connections, tag("ssd:Connection"), ends)
    units: dict[str, Mapping[str, str]] = {}
    for plan in system.components.values():
        units |= {unit: base for unit, base in plan.description.units.items() if unit not in units}
    used = {e.get("unit", "") for e in top.iter(tag("ssc:Real"))} - {""}
    write_units(root, tag("ssd:Units"), sorted(used), units)
    experiment = SubElement(
        root, tag("ssd:DefaultExperiment"), startTime="0.0", stopTime=repr(float(stop_time))
    )
    write_osp_step(SubElement(experiment, tag("ssd:Annotations")), study.step_size)
    write_study(SubElement(root, tag("ssd:Annotations")), study)
    return root


def _differ(system: System, connection: Connection) -> bool:
    """Return whether its ends are in two units, so that the value is taken as it is."""
    ends = (connection.source, connection.target)
    units = {system.components[e.component].description.variables[e.variable].unit for e in ends}
    return len(units - {""}) > 1


def _component(
    elements: Element,
    name: str,
    plan: ComponentPlan,
    source: str,
    values: str | None,
    system: System,
) -> None:
    """A component with connectors for its outputs and the inputs that something feeds.

    An input that is constant has its value from the parameter set and no connector: some tools take every input
    connector for a connected one."""
    component = SubElement(
        elements,
        tag("ssd:Component"),
        name=name,
        type=FMU_TYPE,
        source=source,
        implementation="CoSimulation",
    )
    fed = [c.target.variable for c in system.connections if c.target.component == name]
    kinds = [(v, "input") for v in fed] + [(v, "output") for v in plan.description.outputs]
    kinds = [(v, kind) for v, kind in kinds if plan.description.variables[v].type == "Real"]
    declared = native(plan.description).variables
    if kinds:
        connectors = SubElement(component, tag("ssd:Connectors"))
        for variable, kind in kinds:
            unit, form = plan.description.variables[variable].unit, declared[variable].type
            connector = SubElement(connectors, tag("ssd:Connector"), name=variable, kind=kind)
            if form != "Enumeration":  # whose name SSP would ask for
                stated = {"unit": unit} if unit and form == "Real" else {}
                SubElement(connector, tag(f"ssc:{form}"), stated)
    if values is not None:
        bindings = SubElement(component, tag("ssd:ParameterBindings"))
        SubElement(
            bindings, tag("ssd:ParameterBinding"), type=PARAMETER_SET_TYPE, source=quote(values)
        )

"""An SSP archive as the tables of a case file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from orchestrator.core.errors import CaseError, InputError, Problem, QuestionTopic
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo, read_description
from orchestrator.devices.fmi.values import Scalar
from orchestrator.systems.ssp.archive import SspArchive
from orchestrator.systems.ssp.names import STUDY_TYPE, SYSTEM_FILE, children, plain_name, tag
from orchestrator.systems.ssp.parameter_sets import SspValue
from orchestrator.systems.ssp.structure import Node, Owner, Structure, read_structure
from orchestrator.systems.ssp.study import SspStudy, foreign_step, read_study
from orchestrator.systems.ssp.units import between, contradiction, conversion, defined


@dataclass(frozen=True)
class SspCase:
    tables: dict[str, Any]  # contents of a case file, without keys that would need another program
    folder: Path  # folder into which the FMUs are unpacked; paths in the tables are relative to it
    digest: str  # SHA-256 of the archive
    questions: tuple[Problem, ...] = ()  # what is unusual in it, for the user to answer


def read_ssp(path: Path, cache: Path) -> SspCase:
    """Read an SSP and unpack its FMUs; nested systems are laid flat."""
    archive = SspArchive(path)
    description = archive.xml(SYSTEM_FILE)
    version = description.get("version", "unknown")
    if description.tag != tag("ssd:SystemStructureDescription") or not version.startswith("1."):
        raise InputError(
            f"{path}: {SYSTEM_FILE} is of version {version}; SSP 1.0 can be read, ask for that export"
        )
    problems: list[Problem] = []
    structure = read_structure(
        archive, description, lambda place, text: problems.append(Problem(place, text))
    )
    name = description.get("name", "")
    tables: dict[str, Any] = {
        "name": plain_name(name),
        "title": description.get("description", name),
    }
    study = None
    step = None
    try:
        tables["solver"] = _times(description)
        study, step = read_study(description), foreign_step(description)
    except InputError as error:
        problems.append(Problem(SYSTEM_FILE, str(error)))
    if problems:
        raise CaseError(str(path), problems)
    names = _component_names(structure)
    folder = cache / archive.digest[:32]
    fmus = {owner: archive.unpack(member, folder) for owner, member in structure.sources.items()}
    descriptions = {owner: _description(fmu) for owner, fmu in fmus.items()}
    tables["connections"] = []
    for source, sink in structure.connections:
        try:
            converted = _conversion(structure, (source, sink), descriptions)
        except InputError as error:
            place = f"connection {_text(source)} - {_text(sink)}"
            problems.append(Problem(place, str(error)))
            continue
        ends = {"from": f"{names[source[0]]}.{source[1]}", "to": f"{names[sink[0]]}.{sink[1]}"}
        tables["connections"].append({**ends, "converted": converted})
    given, questions = {}, list[Problem]()
    for owner in structure.sources:
        given[owner] = _values(structure, owner, descriptions[owner], problems, questions)
    if problems:
        raise CaseError(str(path), problems)
    tables["components"] = {
        names[owner]: {"fmu": member, "parameters": given[owner]}
        for owner, member in structure.sources.items()
    }
    if study is not None:
        _add_study(tables, study, path)
    else:
        suggested = [
            d.default_step_size
            for d in descriptions.values()
            if d is not None and d.default_step_size
        ]
        tables["solver"] |= {"step_size": step or min(suggested)} if step or suggested else {}
        tables["solver"]["schedule"] = "jacobi"  # does not depend on the order of the elements
    return SspCase(tables, folder, archive.digest, tuple(questions))


def _times(description: Element) -> dict[str, float]:
    times = {}
    for experiment in children(description, "ssd:DefaultExperiment"):
        for name, text in experiment.attrib.items():
            try:
                times[name] = float(text)
            except ValueError as error:
                raise InputError(
                    f"DefaultExperiment: {name} is {text!r}, which is no number"
                ) from error
    if times.get("startTime", 0.0) != 0:
        raise InputError(
            f"DefaultExperiment: the start time is {times['startTime']:g} s; runs start at 0 s here"
        )
    return {"stop_time": times["stopTime"]} if "stopTime" in times else {}


def _component_names(structure: Structure) -> dict[Owner, str]:
    """A name for every component that is valid in a case file; the name of a nested component begins with its system's
    name."""
    names: dict[Owner, str] = {}
    for owner in structure.sources:
        names[owner] = plain_name("_".join(owner), names.values())
    return names


def _description(fmu: Path) -> FmuDescription | None:
    """The FMU's description; None if it cannot be used. The preparation of the case then reports the reason with all
    other problems."""
    try:
        return read_description(fmu)
    except InputError:
        return None


def _conversion(
    structure: Structure, ends: tuple[Node, Node], fmus: Mapping[Owner, FmuDescription | None]
) -> tuple[float, float]:
    """Factor and offset of a value on its way from an FMU's output to another's input.

    Each connector that states a unit has the value in that unit. Without a statement at either side of a stretch, and
    over a connection that suppresses the conversion, the value stays as it is. A connection's own transformation comes
    behind the conversion, at an FMU's connector behind that into the FMU's unit."""
    way, unit = (1.0, 0.0), _unit_inside(structure, ends[0], fmus)
    for step in structure.ways[ends]:
        name = structure.units.get(step.connector, "")
        stated = name, structure.definitions.get(name)
        if not name and step.connector == ends[1]:
            stated = _unit_inside(structure, ends[1], fmus)
        if step.as_it_is:
            # whatever arrives counts in the next unit that somebody states
            unit = stated
        elif stated[0]:
            way, unit = _then(way, unit, stated), stated
        if step.transformed is not None:
            _check_transformed(ends, fmus)
            factor, offset = step.transformed
            way = factor * way[0], factor * way[1] + offset
    return _then(way, unit, _unit_inside(structure, ends[1], fmus))


def _check_transformed(
    ends: tuple[Node, Node], fmus: Mapping[Owner, FmuDescription | None]
) -> None:
    """Refuse a factor and an offset between variables of which one is no Real."""
    for owner, variable in ends:
        fmu = fmus[owner]
        info = None if fmu is None else fmu.variables.get(variable)
        if info is not None and info.type != "Real":
            raise InputError(
                f"it has a LinearTransformation, which is of Real values, and {_text((owner, variable))} is "
                f"{info.type}; remove it, or let a component convert"
            )


_Unit = tuple[str, Mapping[str, str] | None]  # name and definition; no name where none is stated


def _then(way: tuple[float, float], unit: _Unit, needed: _Unit) -> tuple[float, float]:
    """A conversion, followed by that into the next unit where both are stated."""
    if not unit[0] or not needed[0]:
        return way
    try:
        factor, offset = conversion(unit, needed)
    except InputError as error:
        raise InputError(
            f"{error}; correct the unit of one end, or state suppressUnitConversion if the value is meant as it is"
        ) from error
    return factor * way[0], factor * way[1] + offset


def _unit_inside(
    structure: Structure, node: Node, fmus: Mapping[Owner, FmuDescription | None]
) -> _Unit:
    """The unit that an FMU has a variable in."""
    fmu = fmus[node[0]]
    info = None if fmu is None else fmu.variables.get(node[1])
    return ("", None) if fmu is None or info is None else (info.unit, fmu.units.get(info.unit))


def _text(node: Node) -> str:
    return ".".join((*node[0], node[1]))


def _values(
    structure: Structure,
    owner: Owner,
    fmu: FmuDescription | None,
    problems: list[Problem],
    questions: list[Problem],
) -> dict[str, Any]:
    """Values of a component by the rules of SSP.

    Names that the FMU does not have are ignored. An input without connection keeps its start value. The start value of
    a connected input is left out."""
    if fmu is None:
        return {}
    fed = {variable for _, (sink, variable) in structure.connections if sink == owner}
    values: dict[str, Any] = {
        v: start for v in fmu.inputs if (start := _start(fmu.variables[v])) is not None
    }
    for variable, value in structure.values[owner].items():
        if variable not in fmu.variables:
            continue
        place = f"value of {'.'.join((*owner, variable))}"
        try:
            values[variable] = _converted(value, fmu.variables[variable].unit, fmu)
            says = contradiction(value.unit, value.base) if value.unit else ""
            if says:
                topic = QuestionTopic("a unit and its base", ".".join((*owner, variable)))
                questions.append(Problem(place, says, topic=topic))
        except InputError as error:
            problems.append(Problem(place, str(error)))
    return {v: value for v, value in values.items() if v not in fed}


def _start(info: VariableInfo) -> Scalar | None:
    """The start value of an input; None of text, which stays what it is without being given."""
    if info.type not in ("Real", "Integer", "Enumeration", "Boolean"):
        return None
    if info.start is not None:
        return info.start
    return False if info.type == "Boolean" else max(0, info.minimum or 0)


def _converted(value: SspValue, unit: str, fmu: FmuDescription) -> float | bool | str:
    """A number in the variable's own unit as it is; one in another unit converted, or with that unit's name."""
    number = value.value
    if not value.unit or isinstance(number, bool | str):
        return number
    own, needed = defined(value.unit, value.base), defined(unit, fmu.units.get(unit))
    return between(number, (value.unit, own), (unit, needed))


def _add_study(tables: dict[str, Any], study: SspStudy, path: Path) -> None:
    for name, content in study.tables.items():
        if not isinstance(content, type(tables.get(name, content))):
            raise InputError(
                f"{path}: the annotation {STUDY_TYPE} gives {name} as {content!r}; export the SSP again"
            )
        tables[name] = tables.get(name, {}) | content if isinstance(content, dict) else content
    tables["solver"] |= {
        "step_size": study.step_size,
        "schedule": study.schedule,
        "groups": [list(group) for group in study.groups],
    }
    tables["events"] = [
        {
            "type": "parameter_change",
            "time": time,
            "component": component,
            "parameter": variable,
            "value": value,
        }
        for time, component, variable, value in study.settings
    ]
    tables["scenarios"] = {plain_name(study.scenario): {"title": study.title}}

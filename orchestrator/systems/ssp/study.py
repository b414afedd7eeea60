"""The parts of a scenario that SSP itself cannot hold: step, schedule, events, analysis and plots.

It travels as an annotation, which other tools ignore. The step is written in libcosim's form as well."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import tomli_w

from orchestrator.core.errors import InputError
from orchestrator.core.toml_files import parsed
from orchestrator.systems.coupling.events import Event, faults_among
from orchestrator.systems.coupling.schedule import Schedule
from orchestrator.systems.ssp.names import OSP_TYPE, STUDY_TYPE, children, tag

_OMS_TYPE = "org.openmodelica"


@dataclass(frozen=True)
class SspStudy:
    """A scenario without its system."""

    scenario: str
    title: str
    step_size: float  # communication step [s]
    schedule: str
    # groups of components of the schedule, in the order of stepping
    groups: tuple[tuple[str, ...], ...]
    # the changes by events, in order: time [s], component, variable, value
    settings: tuple[tuple[float, str, str, float | bool], ...]
    # tables of the case file that only this project knows, such as ``analysis`` and ``plots``
    tables: Mapping[str, Any] = field(default_factory=dict)


def study_of(
    scenario: str,
    title: str,
    step_size: float,
    schedule: Schedule,
    events: Sequence[Event],
    tables: Mapping[str, Any],
) -> SspStudy:
    """The study of a scenario. Each event is written as the variables that it sets."""
    faults = faults_among(events)
    if faults:
        raise InputError(
            f"an SSP cannot hold faults ({faults[0]}); remove them from the scenario to export it"
        )
    settings = tuple(
        (event.time, component, variable, value)
        for event in events
        for component, new in event.changes().items()
        for variable, value in new.items()
    )
    return SspStudy(
        scenario,
        title,
        step_size=step_size,
        schedule=schedule.name,
        groups=schedule.groups,
        settings=settings,
        tables=tables,
    )


def write_study(annotations: Element, study: SspStudy) -> None:
    annotation = SubElement(annotations, tag("ssc:Annotation"), type=STUDY_TYPE)
    root = SubElement(annotation, tag("gfor:Study"), scenario=study.scenario, title=study.title)
    SubElement(root, tag("gfor:CommunicationStep"), seconds=repr(study.step_size))
    schedule = SubElement(root, tag("gfor:Schedule"), name=study.schedule)
    for group in study.groups:
        element = SubElement(schedule, tag("gfor:Group"))
        for name in group:
            SubElement(element, tag("gfor:Component"), name=name)
    events = SubElement(root, tag("gfor:Events"))
    for time, component, variable, value in study.settings:
        text = str(value).lower() if isinstance(value, bool) else repr(float(value))
        SubElement(
            events,
            tag("gfor:Set"),
            time=repr(float(time)),
            component=component,
            variable=variable,
            value=text,
        )
    SubElement(root, tag("gfor:CaseTables")).text = tomli_w.dumps(study.tables)


def write_osp_step(annotations: Element, step_size: float) -> None:
    """The communication step as libcosim and its relatives read it."""
    annotation = SubElement(annotations, tag("ssc:Annotation"), type=OSP_TYPE)
    algorithm = SubElement(annotation, tag("osp:Algorithm"))
    SubElement(algorithm, tag("osp:FixedStepAlgorithm"), baseStepSize=repr(step_size))


def read_study(description: Element) -> SspStudy | None:
    """Read our annotation from a system structure description; None if it has no such annotation.

    Raises an `InputError` if the annotation has another form than `write_study` gives it."""
    for annotation in children(description, "ssd:Annotations/ssc:Annotation"):
        if annotation.get("type") == STUDY_TYPE:
            try:
                return _read(annotation)
            except (AttributeError, KeyError, ValueError, RecursionError) as error:
                raise InputError(
                    f"the annotation {STUDY_TYPE} cannot be read ({error}); export the SSP again"
                ) from error
    return None


def _read(annotation: Element) -> SspStudy:
    (root,) = children(annotation, "gfor:Study")
    (step,), (schedule,) = children(root, "gfor:CommunicationStep"), children(root, "gfor:Schedule")
    groups = tuple(
        tuple(c.attrib["name"] for c in children(group, "gfor:Component"))
        for group in children(schedule, "gfor:Group")
    )
    settings = tuple(
        (
            float(e.attrib["time"]),
            e.attrib["component"],
            e.attrib["variable"],
            _value(e.attrib["value"]),
        )
        for e in children(root, "gfor:Events/gfor:Set")
    )
    return SspStudy(
        root.attrib["scenario"],
        root.get("title", ""),
        step_size=float(step.attrib["seconds"]),
        schedule=schedule.attrib["name"],
        groups=groups,
        settings=settings,
        tables=parsed("".join(e.text or "" for e in children(root, "gfor:CaseTables"))),
    )


def _value(text: str) -> float | bool:
    return text == "true" if text in ("true", "false") else float(text)


def foreign_step(description: Element) -> float | None:
    """The communication step [s] from the annotation of libcosim or OMSimulator; None without such an annotation."""
    for annotation in description.iter(tag("ssc:Annotation")):
        if annotation.get("type") in (OSP_TYPE, _OMS_TYPE):
            for element in annotation.iter():
                text = element.get("baseStepSize") or element.get("stepSize")
                if text is not None:
                    try:
                        return float(text)
                    except ValueError as error:
                        raise InputError(
                            f"the annotation {annotation.get('type')} gives the step size {text!r}, which is no number"
                        ) from error
    return None

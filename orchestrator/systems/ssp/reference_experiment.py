"""An FMU's own test inside the FMU: a smoke test with parameters, stimuli, reference results and the first state.

The files stand in the folder of FMI's layered standard LS-REF (Modelica Association, fmi-ls-ref), which says what each
is for. The experiment has the form of ma-hs-experiments, the parameters that of SSP. Both are drafts."""

import csv
import hashlib
import io
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from platform import machine as machine_of
from xml.etree.ElementTree import Element, SubElement, register_namespace

from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.description import FmuDescription, read_description
from orchestrator.devices.fmi.instance import open_component
from orchestrator.systems.coupling.run_state import state_as_bytes
from orchestrator.systems.ssp.names import PARAMETER_SET_TYPE, SSP_VERSION, tag, xml_text

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"  # where LS-REF has its files
VERSION = "1.0.0-beta.1"  # of LS-REF
# relative to the largest value of an output: what another compiler's mathematics may change
TOLERANCE = 1e-9
_LS = "http://fmi-standard.org/fmi-ls-manifest"
_STEP = 1e-4  # communication step [s]
_STEPS = 200
_JUMP_AT = 50  # step at which the input jumps
_JUMP = 0.01  # size of the jump, in the input's unit

register_namespace("fmi-ls", _LS)


def reference_members(path: Path) -> dict[str, bytes]:
    """Run a smoke test of an FMU for this machine, and return its files by their path in the archive.

    ``path``: the FMU, which starts from its own start values. 5 ms later its first continuous input is 1 % (of 1 at
    least) higher."""
    description = read_description(path)
    stimuli, references, state = _run(description)
    platform = platform_of(description.fmi_version)
    files = {
        "parameters.ssv": parameter_set(
            "smoke test",
            {
                n: v.start
                for n, v in description.variables.items()
                if v.causality == "parameter" and v.start is not None
            },
            description,
        ),
        "stimuli.csv": stimuli,
        "references.csv": references,
        "smoke-test.exp": _smoke_test(),
    } | ({f"steady-state.{platform}.bin": state} if state else {})
    members = {
        "fmi-ls-manifest.xml": manifest(
            {name: (*_purpose(name), text) for name, text in files.items()}
        )
    } | files
    return {f"{FOLDER}/{name}": content for name, content in members.items()}


_MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
_SYSTEMS = {"win32": "windows"}
_PLATFORMS_2 = {"linux": "linux64", "win32": "win64", "darwin": "darwin64"}


def platform_of(fmi_version: str) -> str:
    if fmi_version == "2.0":
        return _PLATFORMS_2.get(sys.platform, sys.platform)
    machine = machine_of().lower()
    return f"{_MACHINES.get(machine, machine)}-{_SYSTEMS.get(sys.platform, sys.platform)}"


def _run(description: FmuDescription) -> tuple[bytes, bytes, bytes]:
    variables = description.variables.values()
    inputs = {
        v.name: float(v.start or 0)
        for v in variables
        if v.causality == "input" and v.type == "Real"
    }
    outputs = [v.name for v in variables if v.causality == "output" and v.type == "Real"]
    given, seen = [["time", *inputs]], [["time", *outputs]]
    with open_component("smoke_test", description) as component:
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.set(dict(inputs))
        component.exit_initialization_mode()
        state = state_as_bytes(component) if description.can_serialize_state else b""
        seen.append(_row(0.0, component, outputs))
        for k in range(_STEPS):
            time = k * _STEP
            if k == _JUMP_AT and inputs:
                first = next(iter(inputs))
                inputs[first] += _JUMP * max(1.0, abs(inputs[first]))
            given.append([repr(time), *map(repr, inputs.values())])
            component.set(dict(inputs))
            component.step(time, _STEP)
            seen.append(_row((k + 1) * _STEP, component, outputs))
    return as_csv(given), as_csv(seen), state


def _row(time: float, component: Component, names: list[str]) -> list[str]:
    values = component.values(names)
    return [repr(time), *(repr(float(values[name])) for name in names)]


def as_csv(rows: Iterable[Sequence[str]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def parameter_set(
    name: str, values: Mapping[str, float | bool | str], description: FmuDescription
) -> bytes:
    root = Element(tag("ssv:ParameterSet"), version=SSP_VERSION, name=name)
    listed = SubElement(root, tag("ssv:Parameters"))
    for variable, value in values.items():
        entry = SubElement(listed, tag("ssv:Parameter"), name=variable)
        type_ = description.variables[variable].type
        match type_:
            case "Boolean":
                text = str(value).lower()
            case "Integer":
                text = str(int(value))
            case _:
                text = repr(value)
        SubElement(entry, tag(f"ssv:{type_}"), value=text)
    return xml_text(root)


def _smoke_test() -> bytes:
    text = (
        "From the start values; the first input rises. References are outputs read after each step, before the next "
        "inputs are set. The tolerance is relative to an output's largest value."
    )
    sources = {
        "Parameters": "parameters.ssv",
        "Stimuli": "stimuli.csv",
        "References": "references.csv",
    }
    return experiment("smoke test", text, _STEPS * _STEP, _STEP, sources)


def experiment(name: str, text: str, stop: float, step: float, sources: Mapping[str, str]) -> bytes:
    """A transient simulation; ``sources``: files by what they are, times in s."""
    root = Element("Experiments", name=name[:1].upper() + name[1:])
    found = SubElement(root, "Experiment", name=name, description=text, tolerance=repr(TOLERANCE))
    SubElement(
        found,
        "TransientSimulation",
        {"startTime": "0.0", "stopTime": repr(stop), "stepSize": repr(step)},
    )
    for kind, source in sources.items():
        SubElement(found, kind, source=source)
    return xml_text(root)


def manifest(files: Mapping[str, tuple[str, str, str, bytes]]) -> bytes:
    """The manifest of LS-REF; ``files``: type, role, description and content by path from the manifest's folder."""
    root = Element(
        "fmiReferences",
        {
            f"{{{_LS}}}fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            f"{{{_LS}}}fmi-ls-version": VERSION,
            f"{{{_LS}}}fmi-ls-description": "Layered Standard providing information on related files included in an "
            "FMU.",
        },
    )
    for name, (type_, role, text, content) in files.items():
        digest = hashlib.sha3_256(content).hexdigest()
        attributes = {
            "type": type_,
            "source": name,
            "role": role,
            "description": text,
            "checksum": digest,
        }
        SubElement(root, "Related", attributes)
    return xml_text(root)


def _purpose(name: str) -> tuple[str, str, str]:
    match name.rpartition(".")[2]:
        case "ssv":
            return PARAMETER_SET_TYPE, "parameter", "Parameters of the smoke test"
        case "exp":
            return (
                "application/x-ma-hs-experiments",
                "experiment/smoke-test",
                "Short run that shows whether a tool works",
            )
        case "bin":
            platform = name.split(".")[1]
            return (
                "application/octet-stream",
                f"serialized-state/{platform}",
                "State after initialisation",
            )
        case _:
            if name.startswith("stimuli"):
                return "text/csv", "other", "Inputs of the smoke test at each step"
            return "text/csv", "result", "Reference results of the smoke test"

"""From C and a few words on its variables to an FMU file."""

import re
import uuid
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import fmpy

from fmus.toolchain.compiler import ENDINGS, compile_library, host_platform

HERE = Path(__file__).parent
BASE_UNITS = {
    "pu": {},
    "1": {},
    "rad": {"rad": "1"},
    "s": {"s": "1"},
    "Hz": {"s": "-1"},
    "kV": {"kg": "1", "m": "2", "s": "-3", "A": "-1", "factor": "1000"},
    "V": {"kg": "1", "m": "2", "s": "-3", "A": "-1"},
    "kA": {"A": "1", "factor": "1000"},
    "A": {"A": "1"},
    "MVA": {"kg": "1", "m": "2", "s": "-3", "factor": "1000000"},
    "MW": {"kg": "1", "m": "2", "s": "-3", "factor": "1000000"},
    "Mvar": {"kg": "1", "m": "2", "s": "-3", "factor": "1000000"},
}


@dataclass(frozen=True)
class Variable:
    name: str
    reference: int
    causality: str
    start: float | None = None
    unit: str = "pu"
    depends: Sequence[str] | None = ()
    variability: str = "continuous"
    type: str = "Real"
    rate_of: str = ""


@dataclass(frozen=True)
class Source:
    """What an FMU is made from: a C file, macros, variables, and what its description says.

    Attributes
    ----------
    settable
        Whether it declares that its states can be set.
    change
        What is done to its description in the end.
    """

    name: str
    file: str
    defines: Mapping[str, object]
    variables: Sequence[Variable]
    step_size: str | None = "1e-4"
    stop_time: str = "1"
    state: bool = True
    settable: bool = False
    change: Callable[[bytes], bytes] | None = None
    units: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)


def identity(source: Source) -> str:
    text = repr((source.name, source.file, sorted(source.defines.items()), source.variables))
    return "{" + str(uuid.uuid5(uuid.NAMESPACE_URL, text)) + "}"


def description(source: Source) -> bytes:
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=source.name,
        guid=identity(source),
        generationTool="gallery of gfor-cosim",
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    state = "true" if source.state else "false"
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=source.name,
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUstate=state,
        canSerializeFMUstate=state,
    )
    units = SubElement(root, "UnitDefinitions")
    for unit in sorted({v.unit for v in source.variables if v.unit}):
        element = SubElement(units, "Unit", name=unit)
        base = source.units.get(unit, BASE_UNITS.get(unit, {}))
        if base:
            SubElement(element, "BaseUnit", dict(base))
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logAll")
    experiment = SubElement(root, "DefaultExperiment", startTime="0", stopTime=source.stop_time)
    if source.step_size:
        experiment.set("stepSize", source.step_size)
    if source.settable:
        tool = SubElement(SubElement(root, "VendorAnnotations"), "Tool", name="gfor-cosim")
        SubElement(tool, "ContinuousStates", settable="true")
    _variables(root, source)
    _structure(root, source)
    indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="utf-8")


def _variables(root, source):
    variables = SubElement(root, "ModelVariables")
    for v in source.variables:
        attributes = {"name": v.name, "valueReference": str(v.reference), "causality": v.causality}
        attributes["variability"] = v.variability
        if v.causality in ("output", "local"):
            attributes["initial"] = "calculated"
        elif v.causality == "parameter":
            attributes["initial"] = "exact"
        element = SubElement(variables, "ScalarVariable", attributes)
        if v.type == "Boolean":
            SubElement(element, "Boolean", start="true" if v.start else "false")
            continue
        real = SubElement(element, "Real")
        if v.unit:
            real.set("unit", v.unit)
        if v.start is not None and v.causality != "output":
            real.set("start", repr(float(v.start)))
        if v.rate_of:
            real.set("derivative", _index(source)[v.rate_of])


def _structure(root, source):
    structure = SubElement(root, "ModelStructure")
    index = _index(source)
    outputs = [v for v in source.variables if v.causality == "output"]
    rates = [v for v in source.variables if v.rate_of]
    locals_ = [v for v in source.variables if v.causality == "local"]
    for tag, listed in (
        ("Outputs", outputs),
        ("Derivatives", rates),
        ("InitialUnknowns", [*outputs, *locals_]),
    ):
        if not listed:
            continue
        parent = SubElement(structure, tag)
        for v in listed:
            unknown = SubElement(parent, "Unknown", index=index[v.name])
            if v.depends is not None and tag == "Outputs":
                unknown.set("dependencies", " ".join(index[n] for n in v.depends))


def _index(source):
    """Place of each variable in the file, as it refers to them."""
    return {v.name: str(number) for number, v in enumerate(source.variables, start=1)}


@cache
def _code(file: str) -> str:
    return (HERE / file).read_text(encoding="utf-8")


def check_macros(source: Source) -> None:
    """A macro that no C file reads switches nothing on: the FMU would be a good one under a fault's name."""
    code = "".join(_code(file) for file in (source.file, "fmi2.c", "tampering.h"))
    code = re.sub(r"/\*.*?\*/", "", code, flags=re.DOTALL)
    code += "".join(map(str, source.defines.values()))
    unread = [name for name in source.defines if not re.search(rf"\b{name}\b", code)]
    if unread:
        named = ", ".join(unread)
        raise ValueError(
            f"{source.name}: neither {source.file} nor fmi2.c reads the macro {named}; plant it"
        )


def library(source: Source) -> Path:
    check_macros(source)
    macros = {**source.defines, "GUID": f'"{identity(source)}"'}
    text = "".join(f"#define {name} {value}\n" for name, value in macros.items())
    # The model comes first for its SIZE, the interface after it.
    headers = "#include <math.h>\n#include <stdlib.h>\n#include <string.h>\n"
    interface = _code("fmi2.c").replace('#include "tampering.h"', _code("tampering.h"))
    return compile_library(text + headers + _code(source.file) + interface, host_platform())


def build(source: Source, folder: Path) -> Path:
    """Write the FMU."""
    path = folder / f"{source.name}.fmu"
    binary = f"binaries/{fmpy.platform}/{source.name}{ENDINGS[host_platform()]}"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        text = description(source)
        archive.writestr("modelDescription.xml", source.change(text) if source.change else text)
        archive.write(library(source), binary)
        for name, content in source.files.items():
            archive.writestr(name, content)
    return path

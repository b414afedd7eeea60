"""The recipe for a native FMU, for co-simulation by FMI 2.0 or 3.0: compiled code, no Python anywhere.

It is made of the same kernel or tape as the Python-backed FMU and gives the same answers. Beyond that it has exact
directional derivatives and may be stepped from many threads, one per instance at a time.

Compiled, its source is one translation unit per version of FMI, with nothing in it but the C library. A tape lies in
``resources/model.bin``, and one library of each version of FMI reads it for all models."""

import struct
import zlib
from array import array
from importlib.metadata import version as version_of
from math import inf
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fmus.toolchain import description_common as common
from fmus.toolchain.archive import digest_of, guid_of
from fmus.toolchain.c_text import c_number, c_string, identity_source
from fmus.toolchain.compiler import (
    ENDINGS,
    TARGETS,
    compile_library,
    joined_source,
    library_of,
    recipe,
)
from fmus.toolchain.component import MANIFEST, PLATFORM, component_of, manifest
from fmus.toolchain.description import model_description, with_guid
from fmus.toolchain.exporter import this_machine
from fmus.toolchain.extras import installed_version
from fmus.toolchain.kernel import c_source, derivative_functions, lanes_source
from fmus.toolchain.model import FmiVersion, Model
from fmus.toolchain.tape import VERSION, tape_of

# FMI 2.0's name of a type → FMI 3.0's
_TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean"}


def model_description_3(model: Model, token: str, identifier: str, tool: str) -> bytes:
    """Return the file's text.

    ``token``, ``identifier``: As in the standard; the identifier also names the binaries.
    ``tool``: Name and version for ``generationTool``."""
    root = common.root_element(model, "3.0", {"instantiationToken": token}, tool)
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
    common.write_definitions(root, model, "fmi3")
    _variables(root, model)
    _structure(root, model)
    annotations = SubElement(root, "Annotations")
    SubElement(annotations, "Annotation", type=f"{common.TOOL}.ContinuousStates").text = "settable"
    SubElement(annotations, "Annotation", type=common.COMPONENT).append(
        common.component_element(model)
    )
    return common.text_of(root)


def build_description(identifier: str, source_file: str) -> bytes:
    """The text of sources/buildDescription.xml: how a tool compiles the FMU."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    SubElement(
        SubElement(configuration, "SourceFileSet", language="C11"), "SourceFile", name=source_file
    )
    return common.text_of(root)


def _variables(root: Element, model: Model) -> None:
    variables = SubElement(root, "ModelVariables")
    for variable in common.described_variables(model):
        state = variable.derivative_of
        more = {} if state is None else {"derivative": str(state)}
        SubElement(
            variables, _TYPES[variable.kind], {**variable.attributes, **variable.own, **more}
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
    element = SubElement(root, "ModelStructure")
    for kind, group in common.unknowns(model).items():
        for unknown in group:
            given = (
                {} if unknown.known is None else {"dependencies": " ".join(map(str, unknown.known))}
            )
            SubElement(element, kind, {"valueReference": str(unknown.reference), **given})


KIND = "org.gfor-cosim.electrical.network-frame"
"""Voltage and injected current as complex phasors in the frame turning at rated frequency, in pu."""

_MEMBERS = {"v_re": "signal", "v_im": "signal", "i_re": "outflow", "i_im": "outflow"}


def has_port(model: Model) -> bool:
    """Return whether a model meets the grid through a bus voltage and an injected current."""
    return set(_MEMBERS) <= {v.name for v in (*model.inputs, *model.outputs)}


def terminals_and_icons(model: Model) -> bytes:
    """Return the file's text, for a model that has a port."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    terminal = SubElement(
        SubElement(root, "Terminals"),
        "Terminal",
        name="bus",
        matchingRule="bus",
        terminalKind=KIND,
        description=f"Electrical port of {model.name} in the network frame: bus voltage and injected current",
    )
    for name, kind in _MEMBERS.items():
        SubElement(
            terminal,
            "TerminalMemberVariable",
            variableName=name,
            memberName=name,
            variableKind=kind,
        )
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


_C = Path(__file__).with_name("c")
_SHORTEST_TEXT = 640  # room for a message [bytes] beside the longest rule or name it may quote


def native_source(model: Model, version: FmiVersion) -> str:
    """Source of the FMU's binary without its identity, which is a hash of this text."""
    parts = [
        "#define KERNEL static",
        c_source(model, derivative_functions(model)),
        _data(model),
        (_C / "instance.c").read_text(encoding="utf-8"),
        (_C / f"fmi{version[0]}.c").read_text(encoding="utf-8"),
    ]
    if version == "2.0" and model.integrator == "runge_kutta":
        parts += [lanes_source(model), (_C / "stack.c").read_text(encoding="utf-8")]
    return "\n".join(parts)


PLATFORMS = (*TARGETS, PLATFORM)
"""What an FMU can have a binary for. A component for WebAssembly is of FMI 3.0, and only made where it is asked for."""

LIBRARIES = {version: (_C / "native.c", _C / f"fmi{version[0]}.c") for version in ("2.0", "3.0")}


def model_data(model: Model, tape: bytes, digest: str) -> bytes:
    """A model as ``c/model.c`` reads it; ``digest``: [hex] of all that its FMU is made from."""
    texts = [
        text.encode()
        for text in (guid_of(digest), *model.value_references, *model.requirement_texts)
    ]
    text = b"\0".join([*texts, b""])
    text += bytes(-len(text) % 8)
    start, parameters = _start(model), model.parameters
    counts = (
        len(model.value_references),
        len(model.requirement_texts),
        len(start),
        len(parameters),
        len(text),
    )
    parts = [
        struct.pack("<7I", *counts, max(map(len, texts)), model.value_references["internal_step"])
    ]
    parts += [bytes.fromhex(digest)[:16], array("d", start).tobytes()]
    for p in parameters:
        bounds = -inf if p.minimum is None else p.minimum, inf if p.maximum is None else p.maximum
        parts.append(struct.pack("<2d2i", *bounds, [*_TYPES].index(p.type), p.tunable))
    content = b"".join([*parts, text, tape])
    return (
        struct.pack("<8s3I", b"gformodl", VERSION, 20 + len(content), zlib.crc32(content)) + content
    )


def _model_source(data: bytes) -> str:
    """A model's data as text of C, for a source that has it within."""
    numbers = ", ".join(map(hex, array("I", data)))
    return (
        f"#include <stdint.h>\nstatic const uint32_t MODEL[] = {{{numbers}}};\n#define MODEL MODEL"
    )


def _start(model: Model) -> list[float]:
    return [p.start for p in model.parameters] + [u.start for u in model.inputs]


def _data(model: Model) -> str:
    parameters, rules = model.parameters, model.requirement_texts
    texts = [*rules, *model.value_references]
    rows = [
        f"{{{p.type.upper()}, {c_number(p.minimum, '-INFINITY')}, {c_number(p.maximum, 'INFINITY')}, {int(p.tunable)}}}"
        for p in parameters
    ]
    lines = [
        f"enum {{ NR = {len(rules)}, TEXT = {_SHORTEST_TEXT + max(len(t.encode()) for t in texts)}, "
        f"INTERNAL_STEP = {model.value_references['internal_step']} }};",
        "enum kind { REAL, INTEGER, BOOLEAN };",
        'static const char *const KIND[] = {"Real", "Integer", "Boolean"};',
        "struct parameter { int kind; double minimum, maximum; int tunable; };",
        f"static const char *const NAME[] = {{{', '.join(map(c_string, model.value_references))}}};",
        f"static const double START[] = {{{', '.join(map(c_number, _start(model)))}}};",
        f"static const struct parameter PARAMETER[] = {{{', '.join(rows)}}};",
        f"static const char *const RULE[] = {{{', '.join(map(c_string, rules)) or '0'}}};",
    ]
    return "\n".join(lines)


_FOLDERS_3 = {
    # zig target -> platform tuple of FMI 3.0; a Mac's library is for both kinds
    "x86_64-linux-gnu.2.17": "x86_64-linux",
    "x86_64-windows-gnu": "x86_64-windows",
    "x86_64-macos": "x86_64-darwin",
    "aarch64-macos": "aarch64-darwin",
}


class NativeFmu:
    cache_prefix = "native_"

    def __init__(self, model: Model, version: FmiVersion = "2.0", *, sources: bool = False) -> None:
        self.model, self._version = model, version
        self._source_file = f"{model.name}.c" if sources else ""
        compiled = model.kind != "network" and installed_version("ziglang")
        self._tape = b"" if compiled else tape_of(model)
        self._code = (
            native_source(model, version) if compiled else joined_source(*LIBRARIES[version])
        )
        self._icons = terminals_and_icons(model) if version == "3.0" and has_port(model) else None
        icons = [self._icons.decode()] if self._icons else []
        self._text = self._description("").decode()
        data = model_data(model, self._tape, "00").hex() if self._tape else ""
        self.digest = digest_of(self._code, data, self._text, *recipe(), *icons)

    def _description(self, guid: str) -> bytes:
        tool = f"gfor-cosim {version_of('gfor-cosim')}"
        if self._version == "3.0":
            return model_description_3(self.model, guid, self.model.name, tool)
        return model_description(
            self.model, guid, self.model.name, tool, native=True, source_file=self._source_file
        )

    def description(self) -> bytes:
        """The text of modelDescription.xml, for which nothing is compiled."""
        return with_guid(
            self._text,
            guid_of(self.digest),
            "guid" if self._version == "2.0" else "instantiationToken",
        )

    def default_platforms(self) -> tuple[str, ...]:
        return tuple(TARGETS)

    def host_platforms(self) -> tuple[str, ...]:
        """That of this machine; without compiled code there is no native FMU."""
        host = this_machine()
        if host:
            return host
        raise RuntimeError(
            "native FMUs cannot be compiled for this machine; use the Python-backed ones"
        )

    def contents(self, platforms: tuple[str, ...]) -> dict[str, bytes]:
        """The archive's members, with a binary for each platform [FMI 2.0 names], or a component of FMI 3.0's draft
        for WebAssembly."""
        native = tuple(platform for platform in platforms if platform != PLATFORM)
        members = self._native_contents(native)
        if native != platforms:
            members[f"binaries/{PLATFORM}/{self.model.name}.wasm"] = component_of(self._own_code())
            members[MANIFEST] = manifest()
        return members

    def _own_code(self) -> str:
        """The source with the model in it, for a binary that reads no file."""
        identity = identity_source(guid_of(self.digest), self.digest)
        if not self._tape:
            return identity + self._code
        return f"{_model_source(model_data(self.model, self._tape, self.digest))}\n{self._code}"

    def _native_contents(self, platforms: tuple[str, ...]) -> dict[str, bytes]:
        members = {"modelDescription.xml": self.description()}
        code = self._own_code() if self._source_file or not self._tape else ""
        if not code:
            members["resources/model.bin"] = model_data(self.model, self._tape, self.digest)
        if self._icons:
            members["terminalsAndIcons/terminalsAndIcons.xml"] = self._icons
        if self._source_file:
            members[f"sources/{self._source_file}"] = code.encode()
            if self._version == "3.0":
                members["sources/buildDescription.xml"] = build_description(
                    self.model.name, self._source_file
                )
        for platform in platforms:
            library = (
                compile_library(code, platform)
                if code
                else library_of(platform, *LIBRARIES[self._version])
            )
            targets = TARGETS[platform] if self._version == "3.0" else ()
            for folder in [_FOLDERS_3[target] for target in targets] or [platform]:
                members[f"binaries/{folder}/{self.model.name}{ENDINGS[platform]}"] = (
                    library.read_bytes()
                )
        return members

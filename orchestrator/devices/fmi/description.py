"""An FMU's declarations, read and checked before anything is loaded."""

import re
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
from fmpy.model_description import ModelDescription

from fmus.toolchain.port_variables import RATED
from fmus.toolchain.variables import Usual
from orchestrator.core.errors import FmuFileError, UnsupportedFmuError
from orchestrator.core.foreign_files import one_line
from orchestrator.core.uncollected import uncollected
from orchestrator.devices.fmi.archive import (
    BACKSLASHES,
    KEPT_XML_BYTES,
    MODEL_DESCRIPTION,
    PACK_AGAIN,
    error_text,
    names_and_description,
)
from orchestrator.devices.fmi.clocks import FmiClock, clocks_of, special_variables
from orchestrator.devices.fmi.values import Scalar, typed
from orchestrator.devices.fmi.vendor_files import as_fmu
from orchestrator.devices.sandbox import wine

TOOL = "gfor-cosim"
REVERSE_DOMAIN = "org.gfor-cosim"  # begins the names of what is ours inside other people's formats
VERSIONS = ("2.0", "3.0")  # of FMI that can be run

_TYPES_OF_3 = {"Float64": "Real", "Float32": "Real"} | {
    f"{sign}Int{bits}": "Integer" for sign in ("", "U") for bits in (8, 16, 32, 64)
}


_SAMPLED = ("input", "output", "local")
_CAUSALITIES = {
    "constant": ("output", "local"),
    "fixed": ("parameter", "calculatedParameter", "local"),
    "tunable": ("parameter", "calculatedParameter", "local"),
    "discrete": _SAMPLED,
    "continuous": (*_SAMPLED, "independent"),
}
"""That FMI 2.0 allows with each variability."""

_WEB = "wasm32-wasip2"  # of FMI's draft for WebAssembly, which fmpy does not know

_OURS = f"VendorAnnotations/Tool[@name='{TOOL}']"
_RATED = {variable.name: variable for variable in RATED}
_LONGEST_WHY = 200  # characters of a range's reason that are taken from a file
_SCALARS = "ModelVariables/ScalarVariable"  # where FMI 2.0 has its variables
_OTHER_KINDS = {
    "ModelExchange": "for Model Exchange",
    "ScheduledExecution": "for Scheduled Execution",
}


@dataclass(frozen=True, slots=True)
class VariableInfo:
    name: str
    reference: int
    # by FMI 2.0, such as ``Real``; what that has no name for is ``Array``, ``Binary`` or ``Clock``
    type: str
    causality: str
    variability: str
    unit: str
    # by the type: a number of a Real, Integer or Enumeration, a bool of a Boolean, else text; None without one
    start: Scalar | None
    minimum: float | None
    maximum: float | None
    description: str
    declared_type: str = ""  # as the file has it, such as ``Float64``
    usual: Usual | None = None  # its usual range, where the model declares one

    @property
    def start_number(self) -> float:
        """The start value as a number: 1 or 0 of a Boolean, 0 where there is no start value or it is text."""
        return 0.0 if self.start is None or isinstance(self.start, str) else float(self.start)


@dataclass(frozen=True)
class FmuDescription:
    """A co-simulation FMU on disk. An FMU of FMI 3.0 is described in the words of FMI 2.0.

    ``can_save_state``, ``can_serialize_state``: ``canGetAndSetFMUstate``, ``canSerializeFMUstate``."""

    path: Path
    guid: str
    model_name: str
    title: str
    model_identifier: str
    generation_tool: str
    variables: dict[str, VariableInfo]
    # names of the continuous states, in the order of ``ModelStructure/Derivatives``, then of the discrete states that a
    # sampled controller declares under ``VendorAnnotations``.
    states: tuple[str, ...]
    # whether the FMU declares that a master may set its states at communication points. That is an extension of FMI;
    # our FMUs declare it under ``VendorAnnotations``.
    states_are_settable: bool
    can_save_state: bool
    gives_directional_derivatives: bool  # ``providesDirectionalDerivative``
    output_dependencies: dict[str, tuple[str, ...] | None]
    platforms: tuple[str, ...]
    # exponents of SI base units, factor and offset of every unit that the FMU defines, as text.
    units: dict[str, dict[str, str]]
    default_step_size: float | None  # communication step that the FMU suggests [s]
    can_serialize_state: bool = False
    # one_instance, needs_tool: ``canBeInstantiatedOnlyOncePerProcess``, ``needsExecutionTool``.
    one_instance: bool = False
    needs_tool: bool = False
    stop_time: float | None = None  # of ``DefaultExperiment`` [s]; None where it does not say
    fmi_version: str = "2.0"  # ``2.0`` or ``3.0``
    rates: tuple[str, ...] = ()  # names of the continuous states' derivatives, in the same order
    # has_event_mode, returns_early: of FMI 3.0: whether its events can be handled from outside, and whether it may
    # return early from a step.
    has_event_mode: bool = False
    returns_early: bool = False
    clocks: tuple[FmiClock, ...] = ()  # of FMI 3.0, where it has an event mode
    # of FMI 3.0 with an event mode: reference of every variable that belongs to clocks, and its clocks' references; of
    # every other variable whose change is an event, and nothing.
    specials: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    # of a sampled controller that declares it under ``VendorAnnotations`` [s]; None where none does.
    sample_time: float | None = None
    # parameter with the frequency at which its phase quantities repeat [Hz]; empty where it has none.
    frequency: str = ""
    # where a DLL keeps its state: ``arrays``, ``library``, ``hidden`` or ``not tried``; empty where it is no DLL.
    kept_in: str = ""
    kept_why: str = ""  # why that was not tried, or is hidden, in words
    # whether its archive has backslashes between folders, which no tool needs to unpack
    has_backslashes: bool = False
    # what it is in a power system, as in `fmus.toolchain.variables.Kind`; empty where it does not
    # say
    kind: str = ""

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        return self._names("input")

    @cached_property
    def _inputs(self) -> frozenset[str]:
        return frozenset(self.inputs)

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        return self._names("output")

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        return self._names("parameter")

    def _names(self, causality: str) -> tuple[str, ...]:
        return tuple(v.name for v in self.variables.values() if v.causality == causality)

    def feedthrough(self, output: str) -> tuple[str, ...]:
        """Inputs that an output depends on directly; all inputs where the FMU declares nothing."""
        known = self.output_dependencies.get(output)
        return self.inputs if known is None else tuple(n for n in known if n in self._inputs)


def read_description(path: Path | str) -> FmuDescription:
    """Read and check an FMU, or that of a vendor's DLL or device's file, which is built first."""
    described = read_declared(path)
    hindrance = hindrance_here(described)
    if hindrance:
        fault = "backslashes" if described.has_backslashes else "another platform"
        raise UnsupportedFmuError(f"{described.path}: {hindrance[0]}", fault, hindrance[1])
    return described


def hindrance_here(described: FmuDescription) -> tuple[str, str] | None:
    """The reason why an FMU cannot run on this platform, and the remedy; None where it can."""
    if described.has_backslashes:
        return BACKSLASHES, PACK_AGAIN
    if fmpy.platform in described.platforms or runs_under_wine(described):
        return None
    has = ", ".join(described.platforms) or "none"
    return (
        f"it has no binary for this platform ({fmpy.platform}), only for: {has}",
        f"ask its author for a {fmpy.platform} build{_or_wine(described)}",
    )


def _or_wine(described: FmuDescription) -> str:
    """Another remedy, as the end of a sentence."""
    if wine.PLATFORM not in described.platforms or not described.fmi_version.startswith("2"):
        return ""
    try:
        wine.find_wine()
    except wine.NoWineError as error:
        return f", or run that for Windows: {error}"
    return ""


def runs_under_wine(described: FmuDescription) -> bool:
    """Return whether an FMU has a binary for Windows alone, and Wine runs it here."""
    return wine.runs_here(described.platforms, fmpy.platform, described.fmi_version)


def read_declared(path: Path | str) -> FmuDescription:
    """The same as `read_description`, also where the FMU has no binary for this platform and cannot run here."""
    path = as_fmu(Path(path))
    names, text = names_and_description(path)
    parse = _parsed_before if len(text) <= KEPT_XML_BYTES else parse_description
    return parse(path, text, names)


def platforms_of(archive: Path | BytesIO) -> tuple[str, ...]:
    """The platforms for which an FMU has a binary; sources are none."""
    found = tuple(name for name in fmpy.supported_platforms(archive) if name != "c-code")
    with zipfile.ZipFile(archive) as members:
        in_web = any(name.startswith(f"binaries/{_WEB}/") for name in members.namelist())
    return (*found, _WEB) if in_web else found


@uncollected()
def parse_description(path: Path, text: bytes, names: Sequence[str] = ()) -> FmuDescription:
    root = _root(path, text)
    version = root.get("fmiVersion", "unknown")
    version = "3.0" if re.fullmatch(r"3\.0(\.\d+)?", version) else version
    if version not in VERSIONS:
        raise UnsupportedFmuError(
            f"{path}: it is an FMU of FMI {version[:20]}",
            "another version of FMI",
            "this master runs co-simulation of FMI 2.0 and 3.0, ask for one of these",
        )
    try:
        content = _only(_with_initial(text, root))
        for part in root.findall("ModelVariables") if version == "2.0" else ():
            # which FMPy reads on its own: twice they would take most of a large network's memory
            part.clear()
        description = fmpy.read_model_description(content, validate=False)
        exchange_only = description.coSimulation is None
        platforms = platforms_of(_only(text, [name.replace("\\", "/") for name in names]))
        described = (
            None if exchange_only else _describe(path, description, root, platforms, version)
        )
    except FmuFileError:
        raise
    except Exception as error:  # fmpy raises whatever its parsers raise
        raise FmuFileError(
            f"{path}: modelDescription.xml cannot be read: {error_text(error)}; run `fmpy validate` on the file"
        ) from error
    if described is None:
        kinds = [words for name, words in _OTHER_KINDS.items() if root.find(name) is not None]
        raise UnsupportedFmuError(
            f"{path}: it is not an FMU for co-simulation ({' and '.join(kinds) or 'of no kind'} only), which this "
            "master needs",
            "no co-simulation",
            "ask for that export",
        )
    return replace(described, has_backslashes=any("\\" in name for name in names))


@lru_cache(maxsize=32)
def _parsed_before(path: Path, text: bytes, names: Sequence[str]) -> FmuDescription:
    """The same of a file that may have been read before, there or as a copy elsewhere."""
    try:
        found = _of_content(text, names)
    except FmuFileError:
        return parse_description(path, text, names)  # whose error names the file
    return replace(found, path=path)


@lru_cache(maxsize=32)
def _of_content(text: bytes, names: Sequence[str]) -> FmuDescription:
    """The newest descriptions by what they are made of: a study reads its device's file for every point."""
    return parse_description(Path(), text, names)


def _only(text: bytes, names: Sequence[str] = ()) -> BytesIO:
    """An archive for fmpy that holds the checked model description, and empty files of the other names."""
    content = BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr(MODEL_DESCRIPTION, text)
        for name in names:
            if name != MODEL_DESCRIPTION:
                archive.writestr(name, b"")
    return content


def _with_initial(text: bytes, root: ElementTree.Element) -> bytes:
    """Give ``initial`` to variables for which FMI 2.0 has no default, as some tools write them: FMPy refuses them."""
    without = [
        place for place, variable in enumerate(root.iterfind(_SCALARS)) if _lacks_initial(variable)
    ]
    if not without:
        return text
    changed = ElementTree.fromstring(text)  # the file's own description stays as it is
    variables = changed.findall(_SCALARS)
    for place in without:
        variables[place].set("initial", "exact")
    return ElementTree.tostring(changed)


def _lacks_initial(variable: ElementTree.Element) -> bool:
    causality, variability = (
        variable.get("causality", "local"),
        variable.get("variability", "continuous"),
    )
    return "initial" not in variable.attrib and causality not in _CAUSALITIES.get(
        variability, (causality,)
    )


def _root(path: Path, text: bytes) -> ElementTree.Element:
    """The file parsed, once: in a large network that takes longer than all else."""
    try:
        return ElementTree.fromstring(text)
    except (
        ElementTree.ParseError,
        LookupError,
        ValueError,
    ) as error:  # the last two of its encoding
        raise FmuFileError(
            f"{path}: modelDescription.xml is not XML: {error}; export it again"
        ) from error


def _describe(
    path: Path,
    md: ModelDescription,
    root: ElementTree.Element,
    platforms: tuple[str, ...],
    version: str,
) -> FmuDescription:
    kind, usual = _component(root, version)
    for v in md.modelVariables:
        v.name = one_line(v.name or "")
    _check_names(path, md)
    variables = {v.name: _variable(path, v, usual) for v in md.modelVariables}
    dependencies: dict[str, tuple[str, ...] | None] = {}
    for unknown in md.outputs:
        known = unknown.dependencies
        names = None if known is None else tuple(d.name for d in known)
        dependencies[unknown.variable.name] = names
    discrete = _discrete_states(path, root, md)
    states = (*_states(path, md), *discrete)
    step_size = stop_time = None
    if md.defaultExperiment:
        step_size = _positive(md.defaultExperiment.stepSize)
        stop_time = _positive(md.defaultExperiment.stopTime)
    return FmuDescription(
        path=path,
        guid=md.guid,
        model_name=one_line(md.modelName or ""),
        title=one_line(md.description or ""),
        model_identifier=md.coSimulation.modelIdentifier,
        generation_tool=one_line(md.generationTool or ""),
        variables=variables,
        states=states,
        states_are_settable=_settable(root, version) or bool(discrete),
        can_save_state=bool(md.coSimulation.canGetAndSetFMUstate),
        gives_directional_derivatives=_gives_directional_derivatives(root),
        output_dependencies=dependencies,
        platforms=platforms,
        can_serialize_state=bool(md.coSimulation.canSerializeFMUstate),
        needs_tool=bool(md.coSimulation.needsExecutionTool),
        one_instance=bool(md.coSimulation.canBeInstantiatedOnlyOncePerProcess),
        default_step_size=step_size,
        units=_units(root),
        stop_time=stop_time,
        fmi_version=version,
        rates=tuple(unknown.variable.name for unknown in md.derivatives),
        kind=kind,
        **_sampling(path, root, variables),
        **_events(root, version),
    )


def _sampling(
    path: Path, root: ElementTree.Element, variables: Mapping[str, VariableInfo]
) -> dict[str, Any]:
    listed = root.find(f"{_OURS}/DiscreteStates")
    if listed is None:
        return {}
    frequency, error_text = listed.get("frequency", ""), listed.get("sampleTime")
    try:
        sample_time = _positive(error_text)
    except ValueError:
        sample_time = None
    if (error_text and sample_time is None) or (frequency and frequency not in variables):
        raise FmuFileError(
            f"{path}: DiscreteStates under VendorAnnotations has sampleTime {(error_text or '')[:20]!r} and frequency "
            f"{frequency[:40]!r}; a time above 0 and a variable's name are needed: export it again"
        )
    kept = {"kept_in": listed.get("keptIn", "")[:20], "kept_why": listed.get("why", "")[:500]}
    return {"sample_time": sample_time, "frequency": frequency, **kept}


def _states(path: Path, md: ModelDescription) -> list[str]:
    for unknown in md.derivatives:
        if unknown.variable.derivative is None:
            raise FmuFileError(
                f"{path}: ModelStructure/Derivatives lists {unknown.variable.name[:80]!r}, whose variable does not say "
                "which state it is the derivative of; export it again"
            )
    return [unknown.variable.derivative.name for unknown in md.derivatives]


def _events(root: ElementTree.Element, version: str) -> dict[str, Any]:
    interface = root.find("CoSimulation")
    if version != "3.0" or interface is None:
        return {}
    says = {
        name: interface.get(name) in ("true", "1")
        for name in ("hasEventMode", "canReturnEarlyAfterIntermediateUpdate")
    }
    found: dict[str, Any] = {
        "has_event_mode": says["hasEventMode"],
        "returns_early": any(says.values()),
    }
    if says["hasEventMode"]:
        found |= {"clocks": clocks_of(root), "specials": special_variables(root)}
    return found


def _gives_directional_derivatives(root: ElementTree.Element) -> bool:
    interface = root.find("CoSimulation")
    names = ("providesDirectionalDerivative", "providesDirectionalDerivatives")  # FMI 2.0, FMI 3.0
    return interface is not None and any(interface.get(name) in ("true", "1") for name in names)


def _discrete_states(
    path: Path, root: ElementTree.Element, md: ModelDescription
) -> tuple[str, ...]:
    """Names of the states of a sampled controller, which FMI for co-simulation has no list for: our annotation."""
    listed = root.find(f"{_OURS}/DiscreteStates")
    if listed is None or listed.get("settable") != "true":
        return ()
    names = {str(v.valueReference): v.name for v in reversed(md.modelVariables) if v.type == "Real"}
    references = (listed.get("valueReferences") or "").split()
    unknown = [r for r in references if r not in names]
    if unknown:
        raise FmuFileError(
            f"{path}: DiscreteStates under VendorAnnotations names value reference {unknown[0][:20]!r}, which no Real "
            "variable has; export it again"
        )
    return tuple(names[r] for r in references)


def _settable(root: ElementTree.Element, version: str) -> bool:
    if version == "3.0":
        annotation = root.find(f"Annotations/Annotation[@type='{TOOL}.ContinuousStates']")
        return annotation is not None and (annotation.text or "").strip() == "settable"
    tool = root.find(f"{_OURS}/ContinuousStates")
    return tool is not None and tool.get("settable") == "true"


def _check_names(path: Path, md: ModelDescription) -> None:
    """The identifier becomes part of a path, and value references go into 32 bits: neither is taken on trust."""
    identifier = md.coSimulation.modelIdentifier or ""
    if not re.fullmatch(r"\w[\w.-]{0,199}", identifier, re.ASCII):
        raise FmuFileError(
            f"{path}: modelIdentifier is {identifier[:80]!r}; it must be a C identifier, since it names the binary "
            "(dots, hyphens and a leading digit are taken as well)"
        )
    if not md.guid:
        raise FmuFileError(
            f"{path}: modelDescription.xml has no guid, which the binary is error_text; export it again"
        )
    first: dict[str, Any] = {}
    for v in md.modelVariables:
        if first.setdefault(v.name, v) is not v:
            raise FmuFileError(
                f"{path}: two variables are named {v.name[:80]!r} (valueReference {first[v.name].valueReference} and "
                f"{v.valueReference}), so that nobody knows which is meant; FMI wants unique names: export it again"
            )
        if not v.name:
            raise FmuFileError(
                f"{path}: modelDescription.xml has a variable without a name; export it again"
            )
        if not 0 <= int(v.valueReference) < 2**32:
            raise FmuFileError(
                f"{path}: {v.name[:80]!r} has valueReference {str(v.valueReference)[:20]}; 0 to 2³²−1 is allowed"
            )


def _positive(text: str | None) -> float | None:
    value = float(text) if text is not None else 0.0
    return value if 0 < value < float("inf") else None


def _units(root: ElementTree.Element) -> dict[str, dict[str, str]]:
    bases = ((unit, unit.find("BaseUnit")) for unit in root.findall("UnitDefinitions/Unit"))
    return {
        one_line(unit.get("name", "")): {} if base is None else dict(base.attrib)
        for unit, base in bases
    }


def _component(root: ElementTree.Element, version: str) -> tuple[str, dict[str, Usual]]:
    """Our annotation: what the component is, and usual ranges of parameters by name. What is no number is left out."""
    where = "Annotations/Annotation[@type" if version == "3.0" else "VendorAnnotations/Tool[@name"
    found = root.find(f"{where}='{TOOL}.Component']/Component")
    if found is None:
        return "", {}
    usual = {}
    for one in found.findall("Usual"):
        with suppress(ValueError):
            low, high = (float(one.get(side, "")) for side in ("low", "high"))
            usual[one.get("name", "")] = Usual(
                low, high, one.get("why", "")[:_LONGEST_WHY], one.get("orZero") == "true"
            )
    return found.get("kind", ""), usual


def _number_or_none(value: Any) -> float | None:
    return None if value is None else float(value)


def _variable(path: Path, v: Any, usual: Mapping[str, Usual]) -> VariableInfo:
    unit = v.unit or (v.declaredType.unit if v.declaredType is not None else None) or ""
    fmi_type = "Array" if v.dimensions else _TYPES_OF_3.get(v.type, v.type)
    rated = _RATED.get(v.name)
    return VariableInfo(
        name=v.name,
        reference=v.valueReference,
        type=fmi_type,
        causality=v.causality or "local",
        variability=v.variability or "continuous",
        unit=one_line(unit),
        start=None if v.start is None else _start(path, v, fmi_type),
        minimum=_number_or_none(v.min),
        maximum=_number_or_none(v.max),
        description=one_line(v.description or ""),
        declared_type=v.type,
        usual=usual.get(v.name) or (rated.usual if rated and rated.unit == unit else None),
    )


def _start(path: Path, v: Any, fmi_type: str) -> Scalar:
    try:
        return typed(v.start, fmi_type)
    except ValueError as error:
        raise FmuFileError(
            f"{path}: {v.name[:80]!r} has the start value {v.start[:80]!r}; {error}: correct modelDescription.xml, or "
            "export the FMU again"
        ) from error

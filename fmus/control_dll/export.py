"""Writing a converter's control as IEEE/CIGRE DLL, with the data sheet of the circuit around it."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from math import pi, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

from fmus.control_dll.source import c_name, dll_source
from fmus.converter_parts.control_part import GROUP, ControlPart
from fmus.toolchain.compiler import compile_for
from fmus.toolchain.variables import Parameter, Variable

_RULES = {
    "inductance": "{} · V_n² / S_n / (2π·f_n)",
    "resistance": "{} · V_n² / S_n",
    "capacitance": "{} · S_n / V_n² / (2π·f_n)",
    "damping": "V_n² / S_n / (30 · {})",
}


def data_sheet(part: ControlPart, sample_time: float) -> str:
    model = part.model
    values = {p.name: p.start for p in model.parameters}
    page = Path(__file__).with_name("sheet.txt").read_text(encoding="utf-8")
    return page.format(
        name=model.name,
        title=model.title,
        circuit=_circuit(part, values),
        bases=_bases(values),
        sample_time=sample_time,
        lead=part.lead,
        lead_time=values[part.lead],
        inputs=_signals(model.inputs),
        outputs=_signals(model.outputs),
        parameters=_parameters(part),
    )


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _circuit(part: ControlPart, values: dict[str, float]) -> str:
    rows = []
    for element in part.circuit:
        value, unit = element.value(values)
        rule = _RULES[element.kind].format(c_name(element.parameter))
        rows.append([element.symbol, element.place, f"{value:.10g} {unit}", f"{rule}"])
    return _table(("Element", "Where", "Value", "Rule"), rows)


def _bases(values: dict[str, float]) -> str:
    V_n, S_n, f_n = values["V_n"], values["S_n"], values["f_n"]
    rows = [
        ["power", f"{S_n:.10g} MVA", "S_n"],
        ["voltage, line to line, rms", f"{V_n:.10g} kV", "V_n"],
        ["voltage, phase to neutral, peak", f"{V_n * sqrt(2 / 3):.10g} kV", "V_n·√(2/3)"],
        ["current, peak", f"{S_n / V_n * sqrt(2 / 3):.10g} kA", "S_n/V_n·√(2/3)"],
        ["impedance", f"{V_n**2 / S_n:.10g} ohm", "V_n²/S_n"],
        ["angular frequency", f"{2 * pi * f_n:.10g} rad/s", "2π·f_n"],
    ]
    return _table(("Of", "Value", "Rule"), rows)


def _signals(group: Sequence[Variable]) -> str:
    rows = [[f"`{c_name(v.name)}`", v.unit, v.text] for v in group]
    return _table(("Name", "Unit", "Meaning"), rows)


def _parameters(part: ControlPart) -> str:
    def bound(value: float | None) -> str:
        return "" if value is None else f"{value:g}"

    rows = [
        [
            f"`{c_name(p.name)}`",
            f"{p.start:.10g}",
            p.unit,
            bound(p.minimum),
            bound(p.maximum),
            "any time" if p.tunable else "before the start",
            p.text,
        ]
        for p in part.model.parameters
    ]
    return _table(("Name", "Default", "Unit", "Least", "Most", "May change", "Meaning"), rows)


DLL_TARGETS = {
    # platform -> zig target, ending
    "linux64": ("x86_64-linux-gnu.2.17", ".so"),
    "win32": ("x86-windows-gnu", ".dll"),
    "win64": ("x86_64-windows-gnu", ".dll"),
}
"""Platforms that a DLL is written for. EMT programs run on Windows; some load DLLs of 32 bits alone."""

SAMPLE_TIME = 2e-5  # default of ``FixedStepBaseSampleTime`` [s]
# bounds of that sample time [s], around the steps that EMT programs take
_SHORTEST = 1e-6
_LONGEST = 2e-4


class ControlDllError(ValueError):
    """A control part cannot be written as a DLL."""


@dataclass(frozen=True)
class WrittenDll:
    libraries: dict[str, Path]
    sheet: Path


def control_part_of(name: str) -> ControlPart:
    for entry in entry_points(group=GROUP):
        if entry.name == name:
            part = entry.load()()
            assert isinstance(part, ControlPart)
            return part
    known = ", ".join(sorted({entry.name for entry in entry_points(group=GROUP)}))
    raise ControlDllError(f"{name!r} has no control part to write as a DLL; choose from: {known}")


def with_values(part: ControlPart, values: Mapping[str, float], sample_time: float) -> ControlPart:
    """The same part with other defaults; the lead is half a sample time where it is not given.

    ``values``: By parameter; Booleans as 0 or 1.
    ``sample_time``: Between two calls of the control [s].

    Raises `ControlDllError` if there is no such parameter, a value is out of its bounds, or breaks a rule of the model.
    """
    model = part.model
    known = {p.name: p for p in model.parameters}
    unknown = [name for name in values if name not in known]
    if unknown:
        raise ControlDllError(
            f"there is no parameter {unknown[0]!r}; there are: {', '.join(known)}"
        )
    given = {part.lead: sample_time / 2} | dict(values)
    for name, value in given.items():
        _check(known[name], value)
    starts = tuple(replace(p, start=float(given.get(p.name, p.start))) for p in model.parameters)
    made = replace(model, parameters=starts)
    start = [p.start for p in starts]
    (margins,) = made.requirements(start, made.initialise(start)[0])
    for margin, rule in zip(margins, made.requirement_texts, strict=True):
        if not margin > 0:
            raise ControlDllError(f"these values cannot be used: {rule}")
    return replace(part, model=made)


def _check(p: Parameter, value: float) -> None:
    lowest = 0.0 if p.type == "Boolean" else p.minimum
    highest = 1.0 if p.type == "Boolean" else p.maximum
    whole = p.type == "Real" or float(value).is_integer()
    inside = (lowest is None or value >= lowest) and (highest is None or value <= highest)
    if not (math.isfinite(value) and whole and inside):
        least, most = ("any" if bound is None else f"{bound:g}" for bound in (lowest, highest))
        kind = "a number" if p.type == "Real" else "a whole number"
        raise ControlDllError(f"{p.name} = {value:g}; it must be {kind} from {least} to {most}")


def write_dll(
    part: ControlPart,
    folder: Path,
    platforms: tuple[str, ...] = tuple(DLL_TARGETS),
    sample_time: float = SAMPLE_TIME,
    values: Mapping[str, float] | None = None,
    report: Callable[[str], None] = lambda text: None,
) -> WrittenDll:
    """Write the libraries, each into the folder of its platform, and the data sheet beside these folders.

    ``part``: As `control_part_of` gives it.
    ``folder``: It is created where missing.
    ``platforms``: Of `DLL_TARGETS`.
    ``sample_time``: Between two calls of the control [s].
    ``values``: Other defaults of the DLL's parameters, by name.
    ``report``: Called with a sentence before each part of the work."""
    unknown = [name for name in platforms if name not in DLL_TARGETS]
    if unknown:
        raise ControlDllError(
            f"there is no platform {unknown[0]!r}; choose from: {', '.join(DLL_TARGETS)}"
        )
    if not _SHORTEST <= sample_time <= _LONGEST:
        raise ControlDllError(
            f"a sample time of {sample_time:g} s; it must be from {_SHORTEST:g} to {_LONGEST:g} s, within which the "
            "control's fast loops are stable"
        )
    chosen = with_values(part, values or {}, sample_time)
    name, built = chosen.model.name, {}
    report(f"{name}: writing the C code of its control part")
    code = dll_source(chosen.model, sample_time)
    for number, platform in enumerate(platforms, 1):
        report(
            f"{name}: compiling for {platform} ({number} of {len(platforms)}); longer where it was never compiled"
        )
        target, ending = DLL_TARGETS[platform]
        built[platform] = (f"{name}{ending}", compile_for(code, target, ending).read_bytes())
    libraries = {platform: folder / platform / file for platform, (file, _) in built.items()}
    sheet = folder / f"{name}.md"
    _write_all(
        folder,
        {path: built[platform][1] for platform, path in libraries.items()}
        | {sheet: data_sheet(chosen, sample_time).encode()},
    )
    return WrittenDll(libraries, sheet)


def _write_all(folder: Path, contents: Mapping[Path, bytes]) -> None:
    """Write the files beside their places, and move them there once all are whole."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".part-", dir=folder) as beside:
        parts = {path: Path(beside) / str(number) for number, path in enumerate(contents)}
        for path, part in parts.items():
            part.write_bytes(contents[path])
        for path, part in parts.items():
            path.parent.mkdir(exist_ok=True)
            part.replace(path)

"""The data sheet beside a DLL: what the host must build around the control, and every signal and parameter."""

from collections.abc import Sequence
from math import pi, sqrt
from pathlib import Path

from fmus.control_dll.source import c_name
from fmus.converter_parts.control_part import ControlPart
from fmus.toolchain.variables import Variable

_RULES = {
    "inductance": "{} · V_n² / S_n / (2π·f_n)",
    "resistance": "{} · V_n² / S_n",
    "capacitance": "{} · S_n / V_n² / (2π·f_n)",
    "damping": "V_n² / S_n / (30 · {})",
}


def data_sheet(part: ControlPart, sample_time: float) -> str:
    model = part.model
    values = {p.name: p.start for p in model.parameters}
    page = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
    return page.format(
        name=model.name, title=model.title, circuit=_circuit(part, values), bases=_bases(values),
        sample_time=sample_time, lead=part.lead, lead_time=values[part.lead], inputs=_signals(model.inputs),
        outputs=_signals(model.outputs), parameters=_parameters(part),
    )  # fmt: skip


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
            f"`{c_name(p.name)}`", f"{p.start:.10g}", p.unit, bound(p.minimum), bound(p.maximum),
            "any time" if p.tunable else "before the start", p.text,
        ]
        for p in part.model.parameters
    ]  # fmt: skip
    return _table(("Name", "Default", "Unit", "Least", "Most", "May change", "Meaning"), rows)

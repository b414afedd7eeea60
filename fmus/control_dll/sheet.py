"""The data sheet beside a DLL: what the host must build around the control, and every signal and parameter."""

from collections.abc import Sequence
from math import pi, sqrt

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
    sections = [
        f"# {model.name}\n\n{model.title}. An IEEE/CIGRE DLL (CIGRE TB 958) for EMT programs, written by gfor-cosim.",
        _circuit(part, values),
        _bases(values),
        _timing(part, values, sample_time),
        "## Inputs\n\n" + _signals(model.inputs),
        "## Outputs\n\n" + _signals(model.outputs),
        "## Parameters\n\n" + _parameters(part),
    ]
    return "\n\n".join(sections) + "\n"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _circuit(part: ControlPart, values: dict[str, float]) -> str:
    rows = []
    for element in part.circuit:
        value, unit = element.value(values)
        rule = _RULES[element.kind].format(c_name(element.parameter))
        rows.append([element.symbol, element.place, f"{value:.10g} {unit}", f"{rule}"])
    picture = (
        "```\n"
        "bridge (v) --- R_c --- L_c ---+--- R_t --- L_t --- bus\n"
        "                    i_s ->    |        i_g ->\n"
        "                            R_cap      u: from this node to neutral\n"
        "                              |\n"
        "                             C_c\n"
        "                              |\n"
        "                           neutral\n"
        "```"
    )
    text = (
        "The host builds this circuit in each of three phases. The bridge is three controlled voltage sources to "
        "neutral that apply the outputs `v_a`, `v_b`, `v_c`. An averaged bridge on a DC voltage V_dc takes "
        "v / (V_dc / 2) as its modulation index. The DC side is stiff: nothing in the control sees it."
    )
    change = (
        "These are the values for the parameters below. Where a parameter is changed, change the element by its rule: "
        "the control's gains follow from the parameters, and circuit and control must agree."
    )
    return f"## Circuit\n\n{text}\n\n{picture}\n\n{_table(('Element', 'Where', 'Value', 'Rule'), rows)}\n\n{change}"


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
    return f"## Rating and bases\n\n{_table(('Of', 'Value', 'Rule'), rows)}"


def _timing(part: ControlPart, values: dict[str, float], sample_time: float) -> str:
    lead = f"`{part.lead}` = {values[part.lead]:g} s"
    points = (
        f"The host calls `Model_Outputs` every {sample_time:g} s, with the measured values of that instant, and holds "
        "the outputs until the next call.",
        f"The bridge voltage is turned ahead by {lead}: the time from the sample to the middle of its use. Half a "
        "sample time is right for a host that applies the outputs at once; add the delay of a host that is later.",
        "States move by classical Runge-Kutta steps with the inputs held, the same that the FMU takes.",
        "It starts in the steady state of `v_0`, `theta_0`, `P_0`, `Q_0` at the bus. At time t the voltage of phase a "
        "at the bus is v_0·cos(2π·f_n·t + angle_0 + theta_0), in units of the peak base. The circuit must start there "
        "too, or the DLL be held by repeated `Model_Initialize` until it does.",
    )
    return "## Time\n\n" + "\n".join(f"- {point}" for point in points)


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

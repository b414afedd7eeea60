"""The first draft of a binding, from the variables that an FMU declares. Guesses and missing values are marked."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.devices.binding import hints
from orchestrator.devices.binding.tables import REQUIRED
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo
from orchestrator.devices.fmi.port_mapping import START

_VOLTAGE = re.compile(
    r"^(v|u|volt|voltage|vbus|vt|vpcc|vg|ug|upcc)(?![a-z])|volt|spannung", re.IGNORECASE
)
_CURRENT = re.compile(r"^(i|cur|current|iinj|ig|it|ipcc|inj)(?![a-z])|current|strom", re.IGNORECASE)
_POWER = re.compile(r"^(p|q)(?![a-z])|power|leistung", re.IGNORECASE)

_PARTS = {
    "rectangular": (r"re|real|r|x", r"im|imag|imaginary|i|y"),
    "dq": (r"d", r"q"),
    "polar": (
        r"mag|magnitude|abs|amp|amplitude|m|rms|mod|modulus",
        r"ang|angle|arg|phase|phi|theta|deg|a",
    ),
    "abc": (r"a|1|u|l1|r", r"b|2|v|l2|s", r"c|3|w|l3|t"),
    "power": (r"p|active", r"q|reactive"),
}
"""Endings by which the names of a pair or of three phases differ."""

_START_NAMES = {
    "S_n": r"^s_?(n|nom|r|rated|base|b)\b|rat(ed|ing)|^mva(base)?\b|mbase",
    "P_0": r"^p_?(0|init|ini|ref0|start|set|ref|gen)\b|(init|start)\w*_?(active|p)\b|active.*(init|start)",
    "Q_0": r"^q_?(0|init|ini|ref0|start|set|ref|gen)\b|(init|start)\w*_?(reactive|q)\b|reactive.*(init|start)",
    "v_0": r"^[vu]_?(0|init|ini|start|t0|pcc0)\b|volt\w*_?(0|init|ini|start)\b",
    "theta_0": r"^(theta|phi|delta|ang|angle|phase|arg)_?(0|init|ini|start|v0)\b|ang\w*_?(0|init|start)\b",
}


_NO_UNIT = ("", "-", "1", "pu", "p.u.")  # units that leave open what is meant
_RATED_VOLTAGE = re.compile(r"^[vu]_?(n|nom|rated|base)$|rated_?volt|nominal_?volt", re.IGNORECASE)


# angle of a frame of its own, which models of ours move at the end of a communication step
_FRAME = "frame.angle"


@dataclass(frozen=True)
class Guess:
    """The form and the variables of a port, and how certain the guess is."""

    form: str
    variables: tuple[VariableInfo, ...]


def draft_binding(fmu: FmuDescription, beside: Path | None = None) -> str:
    """Write the text of a binding file.

    ``beside``: Folder of the binding file. The FMU's path is written relative to it; None writes the file's name alone.

    Returns TOML. Lines with ``GUESS`` are to be confirmed; values that begin with ``REQUIRED`` are to be filled in, and
    `bind` accepts none of them."""
    voltage = _find(fmu, "input", _VOLTAGE, hints.VOLTS, ("rectangular", "dq", "polar", "abc"))
    current = _find(fmu, "output", _CURRENT, hints.AMPERES, ("rectangular", "dq", "polar", "abc"))
    current = current or _find(fmu, "output", _POWER, hints.WATTS, ("power",))
    starts = {name: _start(fmu, name, taken=()) for name in START}
    taken = {v.name for guess in (voltage, current) if guess for v in guess.variables}
    file = fmu.path.name if beside is None else _relative(fmu.path, beside)
    lines = [
        f"# Binding of {fmu.model_name}, drafted from its model description by `gfor fmu bind`.",
        "# GUESS marks what the names suggest: confirm it. REQUIRED marks what the FMU does not say: fill it in.",
        "# What is in V, kV, A or kA needs the key 'value' besides its unit: rms or peak, phase or line to line.",
        "# Then: gfor fmu check FILE.fmu --binding THIS_FILE finds wrong signs and bases by their power balance.",
        "",
        "[fmu]",
        f"file = {_quoted(file)}",
        f"guid = {_quoted(fmu.guid)}",
        "",
        *_rating(starts["S_n"], fmu, voltage, current),
        "",
        *_phasor("voltage", voltage, fmu.inputs),
        *_moment(voltage, fmu),
        "",
        *_phasor("current", current, fmu.outputs),
        "",
        *_starts(
            {name: info for name, info in starts.items() if info is None or info.name not in taken}
        ),
        *_signals(fmu, taken),
    ]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'


def _comment(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)


def _relative(path: Path, beside: Path) -> str:
    try:
        return path.resolve().relative_to(beside.resolve()).as_posix()
    except ValueError:
        return path.resolve().as_posix()


def _find(
    fmu: FmuDescription,
    causality: str,
    names: re.Pattern[str],
    units: Sequence[str],
    forms: Sequence[str],
) -> Guess | None:
    """Two or three variables whose names differ only in their last part."""
    candidates = [
        v
        for v in fmu.variables.values()
        if v.causality == causality
        and v.type == "Real"
        and (
            names.search(_last(v.name))
            or names.search(v.description)
            or hints.likely_unit(v) in units
        )
    ]
    best: tuple[int, Guess] | None = None
    for form in forms:
        for found in _matches(candidates, _PARTS[form], loose=form == "power"):
            score = sum(
                1 + 2 * bool(names.search(_last(v.name))) + (hints.likely_unit(v) in units)
                for v in found
            )
            if best is None or score > best[0]:
                best = score, Guess(form, found)
    return None if best is None else best[1]


def _matches(
    candidates: Sequence[VariableInfo], parts: Sequence[str], *, loose: bool
) -> Iterable[tuple[VariableInfo, ...]]:
    for first in candidates:
        stem = _stem(first.name, parts[0])
        if stem is None:
            continue
        others = [
            next((v for v in candidates if v is not first and _stem(v.name, part) == stem), None)
            for part in parts[1:]
        ]
        if all(others) and (stem or loose):
            yield (first, *[v for v in others if v is not None])


def _stem(name: str, part: str) -> str | None:
    match = re.fullmatch(rf"(?P<stem>.*?)[._\[(]?(?:{part})[\])]?", name, re.IGNORECASE)
    return match["stem"].lower() if match else None


def _last(name: str) -> str:
    return name.rpartition(".")[2]


def _start(fmu: FmuDescription, name: str, taken: Sequence[str]) -> VariableInfo | None:
    pattern = re.compile(_START_NAMES[name], re.IGNORECASE)
    known = [v for v in fmu.variables.values() if v.type == "Real" and v.name not in taken]
    if name == "S_n":
        known = [v for v in known if v.unit in _NO_UNIT or v.unit.endswith(("VA", "W"))]
    for causality in ("parameter", "input"):
        exact = [v for v in known if v.causality == causality and v.name == name]
        close = [v for v in known if v.causality == causality and pattern.search(_last(v.name))]
        if exact or close:
            return (exact or close)[0]
    text = hints.START_TEXTS.get(name)
    told = [
        v
        for v in known
        if v.causality == "parameter" and text is not None and text.search(v.description)
    ]
    return told[0] if told else None


def _rating(S_n: VariableInfo | None, fmu: FmuDescription, *ports: Guess | None) -> list[str]:
    lines = ["[rating]"]
    if S_n is not None and S_n.start is not None:
        unit = S_n.unit if S_n.unit in ("MVA", "kVA", "VA", "GVA") else "MVA"
        lines.append(f'S_n = "{S_n.start_number:g} {unit}"  # GUESS: start value of {S_n.name}')
    else:
        lines.append(
            f'S_n = "{REQUIRED}: rated apparent power of the FMU as delivered, such as 3.5 MVA"'
        )
    lines.append(_rated_voltage(fmu, ports))
    f_n = fmu.variables.get("f_n")
    lines.append(
        f'f_n = "{50 if f_n is None or f_n.start is None else f_n.start_number:g} Hz"  # GUESS'
    )
    return lines


def _rated_voltage(fmu: FmuDescription, ports: Iterable[Guess | None]) -> str:
    """V_n from a parameter of that name. Without such a parameter the user must fill it in if the port is in volts or
    amperes."""
    known = [
        v
        for v in fmu.variables.values()
        if v.causality == "parameter" and v.type == "Real" and v.start
    ]
    named = next(
        (v for v in known if v.unit in hints.VOLTS and _RATED_VOLTAGE.search(_last(v.name))), None
    )
    if named:
        return f'V_n = "{named.start_number:g} {named.unit}"  # GUESS: start value of {_comment(named.name)}'
    units = {hints.likely_unit(v) for guess in ports if guess is not None for v in guess.variables}
    if units & {*hints.VOLTS, *hints.AMPERES}:
        return f'V_n = "{REQUIRED}: rated line-to-line voltage at the port, such as 690 V"'
    return '# V_n = "690 V"  # rated line-to-line voltage at the port; needed where anything is in V or A'


def _phasor(table: str, guess: Guess | None, names: Sequence[str]) -> list[str]:
    lines = [f"[{table}]"]
    listed = ", ".join(names[:20]) + (", …" if len(names) > 20 else "")
    if guess is None:
        forms = "rectangular, dq, qd, polar or abc" + (", or power" if table == "current" else "")
        lines += [
            f'form = "{REQUIRED}: {forms}"',
            f'variables = ["{REQUIRED}: one or more of: {_comment(listed)}"]',
        ]
    else:
        lines.append(
            f'form = "{guess.form}"  # GUESS; qd is f = f_q − j·f_d, dq is f = f_d + j·f_q'
        )
        lines.append(
            f"variables = [{', '.join(_quoted(v.name) for v in guess.variables)}]  # GUESS"
        )
        lines += [
            f"# {v.name} [{v.unit or 'no unit'}]: {_comment(v.description)}"
            for v in guess.variables
        ]
    lines += _units(table, guess)
    if table == "current":
        drawn = guess is not None and any(map(hints.is_drawn, guess.variables))
        way, other = (
            ("into the converter", "into the grid")
            if drawn
            else ("into the grid", "into the converter")
        )
        lines.append(
            f'direction = "{way}"  # GUESS{": from the description" * drawn}; or "{other}"'
        )
    lines.append("# frame_angle = \"-90 deg\"  # by which the FMU's frame leads the network's")
    return lines


def _moment(voltage: Guess | None, fmu: FmuDescription) -> list[str]:
    """Write the moment of a communication step whose phase voltages it is given."""
    if voltage is None or voltage.form != "abc":
        return []
    if _FRAME in fmu.variables:
        return [f'moment = "begin"  # GUESS: {_FRAME} stands still within a communication step']
    return ['# moment = "begin"  # where its own frame stands still within a communication step']


def _units(table: str, guess: Guess | None) -> list[str]:
    if guess is None:
        kinds = "line-to-line rms, phase rms or phase peak" if table == "voltage" else "rms or peak"
        asked = [
            f'unit = "{REQUIRED}: pu, V, kV, A, kA, MW…"',
            f'# value = "…"  # of what is in V or A: {kinds}',
        ]
        return (
            [*asked, 'base = "S_n"  # GUESS; or such as "100 MVA"'] if table == "current" else asked
        )
    first = hints.likely_unit(guess.variables[0])
    lines = _unit(guess.variables[0], "pu, V, kV, A, kA, MW…")
    if first in (*hints.VOLTS, *hints.AMPERES) and guess.form != "abc":
        lines += _value(guess.variables, first)
    elif not first and guess.form != "abc":
        lines.append(
            '# value = "…"  # of what is in V: line-to-line rms, phase rms or phase peak; in A: rms or peak'
        )
    if table == "current" and first in ("pu", "p.u.", ""):
        text = _comment(" ".join(v.description for v in guess.variables))
        base = re.search(r"(\d+(?:\.\d+)?)\s*([kMG]?VA)\b", text)
        known = (
            f'"{base[1]} {base[2]}"  # GUESS: from the description'
            if base
            else '"S_n"  # GUESS; or such as "100 MVA"'
        )
        lines.append(f"base = {known}")
    if guess.form == "polar" and guess.variables[1].unit not in ("rad", "deg"):
        lines.append(f'angle_unit = "{REQUIRED}: rad or deg"')
    return lines


def _unit(info: VariableInfo, such_as: str) -> list[str]:
    if not hints.lacks_unit(info):
        return []
    unit = hints.likely_unit(info)
    if unit:
        return [f'unit = "{unit}"  # GUESS: from the description']
    if info.unit == "1":
        return ['unit = "pu"  # GUESS: the FMU declares the unit 1']
    return [f'unit = "{REQUIRED}: {such_as}"']


def _value(variables: Sequence[VariableInfo], unit: str) -> list[str]:
    """Which value of an alternating quantity in V or A is meant."""
    text = " ".join(v.description for v in variables)
    kind = hints.kind_of_voltage(text) if unit in hints.VOLTS else hints.kind_of_current(text)
    if kind:
        return [f'value = "{kind}"  # GUESS: from the description']
    kinds = "line-to-line rms, phase rms or phase peak" if unit in hints.VOLTS else "rms or peak"
    return [f'value = "{REQUIRED}: {kinds}"']


def _starts(starts: dict[str, VariableInfo | None]) -> list[str]:
    lines = [
        "# Where the power flow's start values go; without them the FMU starts where it wants to."
    ]
    for name, info in starts.items():
        if info is None:
            lines.append(
                f'# [start.{name}]\n# variable = "…"  # nothing was found that looks like it'
            )
            continue
        lines += [
            f"[start.{name}]",
            f"variable = {_quoted(info.name)}  # GUESS: {_comment(info.description)}",
        ]
        lines += _unit(info, "the FMU declares none")
        if name == "v_0" and hints.likely_unit(info) in hints.VOLTS:
            lines += _value([info], hints.likely_unit(info))
        if name in ("P_0", "Q_0") and hints.is_drawn(info):
            lines.append("sign = -1  # GUESS: from the description")
    return lines


def _signals(fmu: FmuDescription, taken: Iterable[str]) -> list[str]:
    found = next(
        (
            n
            for n in fmu.outputs
            if re.fullmatch(r"(omega|w|speed|freq\w*|f)", _last(n), re.IGNORECASE)
        ),
        None,
    )
    if found is None or found in taken:
        return []
    return [
        "",
        "[signals.omega]",
        f"variable = {_quoted(found)}  # GUESS: {_comment(fmu.variables[found].description)}",
        *_unit(fmu.variables[found], "pu, Hz or rad/s"),
    ]

"""Hints in a variable's description on its meaning, where the declaration has none."""

import re

from orchestrator.devices.fmi.description import VariableInfo

VOLTS, AMPERES = ("V", "kV", "mV", "MV"), ("A", "kA", "mA")
WATTS = ("W", "kW", "MW", "GW", "var", "kvar", "Mvar", "VA", "kVA", "MVA", "VAr", "MVAr")
_KNOWN = {*VOLTS, *AMPERES, *WATTS, "pu", "p.u.", "deg", "rad", "Hz", "rad/s"}
_BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]")

# what a description of a start value says, by our name for the value
START_TEXTS = {
    "P_0": re.compile(
        r"\bactive power\b.*(start|init)|(start|init)\w* active power", re.IGNORECASE
    ),
    "Q_0": re.compile(
        r"reactive power\b.*(start|init)|(start|init)\w* reactive power", re.IGNORECASE
    ),
    "v_0": re.compile(
        r"^(?!.*(angle|phase of)).*(voltage.*(start|init)|(start|init)\w* voltage)", re.IGNORECASE
    ),
    "theta_0": re.compile(r"angle.*(start|init)|(start|init)\w* (voltage )?angle", re.IGNORECASE),
}

_DRAWN = re.compile(
    r"\b(consum|drawn|draws|absorb|taken|demand)|into the (converter|device|load|unit)",
    re.IGNORECASE,
)


def lacks_unit(info: VariableInfo) -> bool:
    """Return whether an FMU declares no unit for a variable, or one that says nothing."""
    return info.unit in ("", "1", "-")


def likely_unit(info: VariableInfo) -> str:
    """The declared unit, or else one that stands in brackets in the description; "" where neither is known."""
    if not lacks_unit(info):
        return info.unit
    return next(
        (text for text in reversed(_BRACKETS.findall(info.description)) if text in _KNOWN), ""
    )


def is_drawn(info: VariableInfo) -> bool:
    """Return whether the description counts a current or a power as taken from the grid."""
    return bool(_DRAWN.search(info.description))


def kind_of_voltage(text: str) -> str:
    """Kind of an alternating voltage that a description names, in a binding's words; "" where it does not."""
    words = re.sub(r"[-_\s]+", " ", text.lower())
    line = "line to line" in words or "phase to phase" in words
    size = _size(words)
    if not size or not (line or "phase" in words):
        return ""
    return f"{'line-to-line' if line else 'phase'} {size}"


def kind_of_current(text: str) -> str:
    """Kind of an alternating current that a description names, ``peak`` or ``rms``; "" where it does not."""
    return _size(text.lower())


def _size(words: str) -> str:
    peak, rms = bool(re.search(r"\b(peak|amplitude)\b", words)), bool(re.search(r"\brms\b", words))
    if peak == rms:
        return ""
    return "peak" if peak else "rms"

"""terminalsAndIcons.xml of FMI 3.0: which variables make up a device's electrical port."""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fmus.toolchain.model import Model

KIND = "org.gfor-cosim.electrical.network-frame"
"""Voltage and injected current as complex phasors in the frame turning at rated frequency, in pu."""

_MEMBERS = {"v_re": "signal", "v_im": "signal", "i_re": "outflow", "i_im": "outflow"}


def has_port(model: Model) -> bool:
    """Whether a model meets the grid through a bus voltage and an injected current."""
    return set(_MEMBERS) <= {v.name for v in (*model.inputs, *model.outputs)}


def terminals_and_icons(model: Model) -> bytes:
    """Return the file's text, for a model that has a port."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    terminal = SubElement(
        SubElement(root, "Terminals"), "Terminal", name="bus", matchingRule="bus", terminalKind=KIND,
        description=f"Electrical port of {model.name} in the network frame: bus voltage and injected current",
    )  # fmt: skip
    for name, kind in _MEMBERS.items():
        SubElement(terminal, "TerminalMemberVariable", variableName=name, memberName=name, variableKind=kind)
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()

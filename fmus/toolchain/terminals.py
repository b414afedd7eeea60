"""terminalsAndIcons.xml of FMI 3.0: which variables make up an electrical port."""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

from fmus.toolchain.model import Model

KIND = "org.gfor-cosim.electrical.network-frame"
"""Voltage and injected current as complex phasors in the frame turning at rated frequency, in pu."""

_MEMBERS = ("v_re", "v_im", "i_re", "i_im")


def electrical_ports(model: Model) -> tuple[str, ...]:
    """Prefixes of the ports: a device has one, with an empty prefix; a grid has one for each device."""
    names = {v.name for v in (*model.inputs, *model.outputs)}
    prefixes = [name.removesuffix("v_re") for name in sorted(names) if name.endswith("v_re")]
    return tuple(p for p in prefixes if all(p + member in names for member in _MEMBERS))


def terminals_and_icons(model: Model) -> bytes:
    """Return the file's text, with one terminal per electrical port."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    terminals = SubElement(root, "Terminals")
    for prefix in electrical_ports(model):
        terminal = SubElement(
            terminals,
            "Terminal",
            name=prefix.rstrip(".") or "bus",
            matchingRule="bus",
            terminalKind=KIND,
            description="Electrical port in the network frame: bus voltage and injected current",
        )
        for member in _MEMBERS:
            kind = _kind(model, prefix + member, member)
            SubElement(
                terminal, "TerminalMemberVariable", variableName=prefix + member, memberName=member, variableKind=kind
            )
    indent(root)
    text: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _kind(model: Model, name: str, member: str) -> str:
    """Voltages are signals; a current that leaves a device enters the grid."""
    if member.startswith("v"):
        return "signal"
    return "inflow" if name in {v.name for v in model.inputs} else "outflow"

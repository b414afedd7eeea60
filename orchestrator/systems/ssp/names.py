"""Names that SSP prescribes, and names of our own annotations."""

import re
from collections.abc import Collection
from xml.etree.ElementTree import Element, indent, register_namespace, tostring

from orchestrator.devices.fmi.description import REVERSE_DOMAIN

SSP_VERSION = "1.0"
SYSTEM_FILE = "SystemStructure.ssd"
FMU_TYPE = "application/x-fmu-sharedlibrary"
PARAMETER_SET_TYPE = "application/x-ssp-parameter-set"
PARAMETER_MAPPING_TYPE = "application/x-ssp-parameter-mapping"

# of our annotation, with the parts of a scenario that SSP cannot express
STUDY_TYPE = f"{REVERSE_DOMAIN}.study"
# type of libcosim's annotation, which carries the communication step
OSP_TYPE = "com.opensimulationplatform"

NAMESPACES = {
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "gfor": "urn:gfor-cosim:ssp:1",
}

for _prefix, _address in NAMESPACES.items():
    register_namespace(_prefix, _address)


def tag(name: str) -> str:
    """``ssd:System`` as ElementTree writes it."""
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"


def children(element: Element, path: str) -> list[Element]:
    return element.findall(path, NAMESPACES)


def xml_text(root: Element) -> bytes:
    indent(root)
    text: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


def plain_name(name: str, taken: Collection[str] = ()) -> str:
    """A name of letters, digits, ``_`` and ``-`` that is not taken yet; SSP itself allows any text."""
    plain = re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_") or "unnamed"
    return next(
        n for n in (plain, *(f"{plain}_{k}" for k in range(2, len(taken) + 3))) if n not in taken
    )

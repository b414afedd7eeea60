"""Who made an FMU, when and with what, as its file says."""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from orchestrator.fmi.archive import read_model_description_text


@dataclass(frozen=True)
class Origin:
    """Attributes of a modelDescription that say where the FMU is from; empty where it does not say."""

    author: str
    version: str
    description: str
    generation_tool: str
    generated: str
    copyright: str
    license: str
    fmi_version: str


def read_origin(path: Path) -> Origin:
    root = ElementTree.fromstring(read_model_description_text(path))
    names = ("author", "version", "description", "generationTool", "generationDateAndTime", "copyright", "license",
             "fmiVersion")  # fmt: skip
    return Origin(*(root.get(name, "").strip() for name in names))

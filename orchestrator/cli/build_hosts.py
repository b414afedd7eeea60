"""Which FMU suits which host: the table behind ``gfor fmu build --for``. A page shows it: use-in-another-tool.md."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from fmus.toolchain.model import FmiVersion

Port = Literal["dq", "abc", "phasor"]

ENDINGS: dict[Port, str] = {"dq": "", "abc": "_abc", "phasor": "_phasor"}  # of the names of models with a port


@dataclass(frozen=True)
class Tool:
    """What to build for a host.

    ``why``: the reason for the kind, the version and the port.
    ``source``: where that is to be read; "here" where our own tests run such FMUs in it."""

    native: bool
    fmi: FmiVersion
    port: Port
    platforms: tuple[str, ...]
    why: str
    source: str

    @property
    def kind(self) -> str:
        return "native" if self.native else "Python-backed"


HOSTS = {
    name: Tool(**table | {"platforms": tuple(table["platforms"])})
    for name, table in tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")).items()
}
"""By the name that ``--for`` takes."""


def with_port(name: str, port: Port, known: tuple[str, ...]) -> str:
    """The model with a port; the one that was asked for where it has another port by its name, or there is none."""
    found = name + ENDINGS[port]
    return found if found in known and not name.endswith(tuple(filter(None, ENDINGS.values()))) else name

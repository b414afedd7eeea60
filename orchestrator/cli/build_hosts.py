"""Which FMU suits which host: the table behind ``gfor fmu build --for``. A page shows it: use-in-another-tool.md."""

from dataclasses import dataclass
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


_DESKTOPS = ("linux64", "win64", "darwin64")
_NO_MAC = ("linux64", "win64")

HOSTS: dict[str, Tool] = {
    "cofmupy": Tool(False, "2.0", "dq", _NO_MAC, "it is a program in Python", "here"),
    "dymola": Tool(True, "2.0", "dq", _NO_MAC, "its FMI 2.0 has been there since Dymola 2015 FD01, on both systems",
                   "https://www.3ds.com/products-services/catia/products/dymola/fmi/"),
    "ecos": Tool(True, "2.0", "dq", _NO_MAC, "its command line is a program in C++, which has no Python", "here"),
    "fmpy": Tool(False, "2.0", "dq", _NO_MAC, "it is a program in Python", "here"),
    "fmucontainer": Tool(True, "2.0", "dq", _NO_MAC, "the container's master is in C, and may go to any host", "here"),
    "libcosim": Tool(True, "2.0", "dq", _NO_MAC, "it is a library in C++, which has no Python", "here"),
    "mosaik": Tool(False, "2.0", "dq", _NO_MAC, "it is a program in Python", "here"),
    "openmodelica": Tool(True, "2.0", "dq", _DESKTOPS, "OMSimulator takes FMI 2.0 for co-simulation, without Python",
                         "https://openmodelica.org/doc/OMSimulator/master/html/"),
    "pathsim": Tool(False, "2.0", "dq", _NO_MAC, "it is a program in Python", "here"),
    "plecs": Tool(True, "2.0", "abc", _DESKTOPS, "it takes FMI 2.0 and 3.0, and its circuits have phases",
                  "https://docs.plexim.com/plecs/5.0/functional-mockup-interface"),
    "powerfactory": Tool(True, "2.0", "phasor", ("win64",), "a program for Windows; for its EMT name the model with "
                         "the ending _abc", "https://doi.org/10.1109/ISGTEurope.2019.8905616"),
    "simulink": Tool(True, "2.0", "abc", _DESKTOPS, "Python-backed FMUs were seen to end MATLAB, and its circuits have "
                     "phases", "https://github.com/NTNU-IHB/PythonFMU/issues/222"),
}  # fmt: skip
"""By the name that ``--for`` takes."""


def with_port(name: str, port: Port, known: tuple[str, ...]) -> str:
    """The model with a port; the one that was asked for where it has another port by its name, or there is none."""
    found = name + ENDINGS[port]
    return found if found in known and not name.endswith(tuple(filter(None, ENDINGS.values()))) else name

"""An FMU's binary: loaded, with a reason where it cannot be, and its functions compared with what the FMU declares."""

import ctypes
import os
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave

from orchestrator.core.errors import FmuFileError, UnsupportedFmuError
from orchestrator.devices.fmi.description import FmuDescription, runs_under_wine
from orchestrator.devices.fmi.fmi3 import FUNCTIONS as FUNCTIONS_OF_3
from orchestrator.devices.fmi.fmi3 import in_words_of_3, needed_functions
from orchestrator.devices.sandbox.wine import PLATFORM

# those of co-simulation
_FUNCTIONS = tuple(name for name in dir(FMU2Slave) if name.startswith("fmi2"))

_ALWAYS = (
    "fmi2Instantiate",
    "fmi2FreeInstance",
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2Reset",
    "fmi2DoStep",
    "fmi2GetReal",
    "fmi2SetReal",
)

_MISSING = (
    re.compile(r"^([^/:\s]+): cannot open shared object file"),
    re.compile(r"Library not loaded: (?:\S*/)?(\S+)"),
)
_NEWER = re.compile(r"version [`']([^']+)' not found")
_UNDEFINED = re.compile(r"undefined symbol: (\w+)")


def binary_path(description: FmuDescription, directory: Path) -> Path:
    newer, ending = description.fmi_version == "3.0", fmpy.sharedLibraryExtension
    if runs_under_wine(description):
        library: Path = (
            directory.resolve() / "binaries" / PLATFORM / f"{description.model_identifier}.dll"
        )
        if library.is_file():
            return library
    folder = (directory / "binaries" / (fmpy.platform_tuple if newer else fmpy.platform)).resolve()
    library = folder / f"{description.model_identifier}{ending}"
    if not library.is_file():
        raise FmuFileError(
            f"{description.path}: it has no binaries/{folder.name}/{library.name}, where an FMU of FMI "
            f"{description.fmi_version} has its binary for this platform; export it again"
        )
    return library


def load(description: FmuDescription, directory: Path) -> ctypes.CDLL:
    library, before = binary_path(description, directory), os.getcwd()
    os.chdir(library.parent)  # where some binaries look for what they depend on
    try:
        return ctypes.CDLL(str(library))
    except OSError as error:
        raise _not_loaded(description.path, library, str(error)) from error
    finally:
        os.chdir(before)


def unload(library: ctypes.CDLL) -> None:
    """Give a loaded binary back: while one handle is open, its static data outlive every instance."""
    fmpy.freeLibrary(library._handle)


def _not_loaded(fmu: Path, library: Path, text: str) -> FmuFileError:
    """The loader's words as an error: what is missing here, or what is wrong with the binary."""
    for pattern in _MISSING:
        found = pattern.search(text)
        if found:
            name = found.group(1)
            if (library.parent / name).is_file():
                return FmuFileError(
                    f"{fmu}: its binary needs {name}, which lies beside it and where it does not look; it must be "
                    "linked with $ORIGIN in its path, ask its author"
                )
            return UnsupportedFmuError(
                f"{fmu}: it needs {name}, which this machine has not",
                "missing system library",
                "install it",
            )
    found = _NEWER.search(text)
    if found:
        return UnsupportedFmuError(
            f"{fmu}: it needs {found.group(1)}, and this system is older",
            "newer system needed",
            "run it on a newer one, or ask for a build that needs less",
        )
    found = _UNDEFINED.search(text)
    if found:
        return FmuFileError(
            f"{fmu}: its binary calls {found.group(1)}, which is in none of the libraries that it names; ask its author"
        )
    return FmuFileError(
        f"{fmu}: its binary cannot be loaded: {text}; ask its author for one that can"
    )


def absent_functions(
    description: FmuDescription, library: ctypes.CDLL
) -> tuple[list[str], list[str]]:
    """Functions that a binary lacks: those that it needs by what it declares, and the others of its version of FMI."""
    if description.fmi_version == "3.0":
        every, needed = (
            [f"fmi3{name}" for name in FUNCTIONS_OF_3],
            {f"fmi3{n}" for n in needed_functions(description)},
        )
        every += [name for name in sorted(needed) if name not in every]
    else:
        every, needed = list(_FUNCTIONS), _needed(description)
    absent = [name for name in every if not hasattr(library, name)]
    return [name for name in absent if name in needed], [
        name for name in absent if name not in needed
    ]


def _needed(description: FmuDescription) -> set[str]:
    types = {v.type for v in description.variables.values()}
    needed = set(_ALWAYS)
    if types & {"Integer", "Enumeration"}:
        needed |= {"fmi2GetInteger", "fmi2SetInteger"}
    if "Boolean" in types:
        needed |= {"fmi2GetBoolean", "fmi2SetBoolean"}
    if description.can_save_state:
        needed |= {"fmi2GetFMUstate", "fmi2SetFMUstate", "fmi2FreeFMUstate"}
    if description.can_serialize_state:
        needed |= {"fmi2SerializedFMUstateSize", "fmi2SerializeFMUstate", "fmi2DeSerializeFMUstate"}
    return needed | (
        {"fmi2GetDirectionalDerivative"} if description.gives_directional_derivatives else set()
    )


class _Absent:
    """In the place of a function that a binary does not have; fmpy describes it like any other."""

    def __init__(self, refuse: Callable[[], Any]) -> None:
        self._refuse = refuse

    def __call__(self, *_: Any) -> Any:
        return self._refuse()


class FMU2Tolerant(FMU2Slave):  # type: ignore[misc]
    """fmpy's instance, which does without functions that nobody needs; its name begins as fmpy wants it."""

    def __init__(self, absent: set[str], refuse: Callable[[str], Any], **arguments: Any) -> None:
        self._absent_functions, self._refuse_call = absent, refuse
        super().__init__(**arguments)

    def _loadFunctions(self) -> None:
        for name in self._absent_functions:
            setattr(self.dll, name, _Absent(lambda name=name: self._refuse_call(name)))  # type: ignore[misc]
        for name, told in prototypes().items():
            function = getattr(self.dll, name)
            function.argnames, function.argtypes = told.argnames, told.argtypes
            function.restype = told.restype
            self._functions[name] = function


class _Library:
    """In the place of a library: fmpy describes functions that nobody calls."""

    def __getattr__(self, name: str) -> SimpleNamespace:
        return SimpleNamespace()


@cache
def prototypes() -> dict[str, SimpleNamespace]:
    """Names and types of the arguments, and type of the result, of each of fmpy's functions.

    Fmpy reads them from its own methods anew for each instance, which is a third of what opening one takes."""
    described = FMU2Slave.__new__(FMU2Slave)
    described.dll, described._functions = _Library(), {}
    FMU2Slave._loadFunctions(described)
    prototypes: dict[str, SimpleNamespace] = described._functions
    return prototypes


def in_words_of_2(absent: set[str]) -> set[str]:
    return {name for name in _FUNCTIONS if in_words_of_3(name) in absent}

"""FMUs of FMI 3.0 behind the functions of FMI 2.0: an adapter in C translates, and the master knows one version."""

import ctypes
import os
from functools import cache
from pathlib import Path
from typing import Any

import fmpy

from fmus.toolchain.compiler import compile_here
from orchestrator.errors import FmuFileError
from orchestrator.fmi.description import FmuDescription

_SOURCE = Path(__file__).with_name("fmi3_as_fmi2.c")

_KINDS = ("Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean")
_ALIKE = {"Enumeration": "Int64"}
"""A type that goes through the functions of another."""

_FUNCTIONS = ("InstantiateCoSimulation", "FreeInstance", "SetDebugLogging", "EnterInitializationMode",
              "ExitInitializationMode", "Terminate", "Reset", "DoStep", "GetFMUState", "SetFMUState", "FreeFMUState",
              "SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState", "GetDirectionalDerivative",
              *(f"Get{kind}" for kind in _KINDS), *(f"Set{kind}" for kind in _KINDS))  # fmt: skip
"""In the order of the adapter's table."""

_NAMES = {
    "fmi2Instantiate": "fmi3InstantiateCoSimulation",
    "fmi2": "fmi3",
    "GetReal": "GetFloat64",
    "SetReal": "SetFloat64",
    "FMUstate": "FMUState",
    "DeSerialize": "Deserialize",
}
"""Parts of names in FMI 2.0, and what they are in FMI 3.0; replaced in this order."""


def in_words_of_3(call: str) -> str:
    """The name of a function or status of FMI 2.0 in FMI 3.0."""
    for old, new in _NAMES.items():
        call = call.replace(old, new)
    return call


class _Table(ctypes.Structure):
    _fields_ = (
        ("functions", ctypes.c_void_p * len(_FUNCTIONS)),
        ("resources", ctypes.c_char_p),
        ("references", ctypes.c_void_p),
        ("kinds", ctypes.c_void_p),
        ("n", ctypes.c_size_t),
        ("narrow", ctypes.c_int64),
    )


@cache
def adapter_path() -> Path:
    """The compiled adapter.

    Raises
    ------
    FmuFileError
        If it cannot be compiled here.
    """
    try:
        return compile_here(_SOURCE)
    except (OSError, RuntimeError) as error:
        raise FmuFileError(f"FMUs of FMI 3.0 run behind a compiled adapter: {error}; ask for FMI 2.0") from error


class Fmi3Library:
    """The binary of an extracted FMU of FMI 3.0, and what the adapter has to know of it; kept as long as instances."""

    def __init__(self, description: FmuDescription, directory: Path) -> None:
        self._library = _loaded(description, directory)
        known = sorted(
            (v.reference, _KINDS.index(kind))
            for v in description.variables.values()
            if v.type != "Array" and (kind := _ALIKE.get(v.declared_type, v.declared_type)) in _KINDS
        )
        self._references = (ctypes.c_uint * len(known))(*(reference for reference, _ in known))
        self._kinds = (ctypes.c_ubyte * len(known))(*(kind for _, kind in known))
        self._table = _Table()
        for place, name in enumerate(_FUNCTIONS):
            self._table.functions[place] = ctypes.cast(self._function(description, name), ctypes.c_void_p)
        resources = (directory / "resources").resolve()
        self._table.resources = f"{resources}{os.sep}".encode() if resources.is_dir() else None
        self._table.references = ctypes.addressof(self._references)
        self._table.kinds = ctypes.addressof(self._kinds)
        self._table.n = len(known)
        self._table.narrow = any(kind == _KINDS.index("Float32") for _, kind in known)

    def _function(self, description: FmuDescription, name: str) -> Any:
        try:
            return getattr(self._library, f"fmi3{name}")
        except AttributeError:
            raise FmuFileError(
                f"{description.path}: its binary has no function fmi3{name}, which every FMU of FMI 3.0 must have; "
                "export it again"
            ) from None

    def prepare(self, adapter: Any) -> None:
        """Make the adapter's next instance one of this FMU."""
        adapter.fmi3_prepare(ctypes.byref(self._table))


def _loaded(description: FmuDescription, directory: Path) -> ctypes.CDLL:
    folder = (directory / "binaries" / fmpy.platform_tuple).resolve()
    library = folder / f"{description.model_identifier}{fmpy.sharedLibraryExtension}"
    if not library.is_file():
        raise FmuFileError(
            f"{description.path}: it has no binaries/{folder.name}/{library.name}, where an FMU of FMI 3.0 has its "
            "binary for this platform; export it again"
        )
    before = os.getcwd()
    os.chdir(folder)  # where some binaries look for what they depend on
    try:
        return ctypes.CDLL(str(library))
    finally:
        os.chdir(before)

"""FMUs of FMI 3.0 behind the functions of FMI 2.0: an adapter in C translates, and the master knows one version."""

import ctypes
import os
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

from fmus.toolchain.compiler import compile_here
from orchestrator.core.errors import FmuFileError, UnsupportedFmuError
from orchestrator.devices.fmi.clocks import MOST_CLOCKS, FmiClock
from orchestrator.devices.fmi.description import FmuDescription

SOURCES = ("fmi3_instance.c", "fmi3_events.c", "fmi3_as_fmi2.c")  # compiled as one, in this order
_KINDS = (
    "Float64",
    "Float32",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
)
_ALIKE = {"Enumeration": "Int64"}  # A type that goes through the functions of another

FUNCTIONS = (
    "InstantiateCoSimulation",
    "FreeInstance",
    "SetDebugLogging",
    "EnterInitializationMode",
    "ExitInitializationMode",
    "Terminate",
    "Reset",
    "DoStep",
    "GetFMUState",
    "SetFMUState",
    "FreeFMUState",
    "SerializedFMUStateSize",
    "SerializeFMUState",
    "DeserializeFMUState",
    "GetDirectionalDerivative",
    "EnterEventMode",
    "EnterStepMode",
    "UpdateDiscreteStates",
    "GetIntervalDecimal",
    "GetShiftDecimal",
    "SetClock",
    "GetClock",
    *(f"Get{kind}" for kind in _KINDS),
    *(f"Set{kind}" for kind in _KINDS),
)
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

_CLOCK_KINDS = ("periodic", "changing", "countdown", "output")
_DISCRETE_INPUT, _CLOCKED_INPUT, _CLOCKED = range(3)


def in_words_of_3(call: str) -> str:
    for old, new in _NAMES.items():
        call = call.replace(old, new)
    return call


class _Clock(ctypes.Structure):
    _fields_ = (
        ("interval", ctypes.c_double),
        ("shift", ctypes.c_double),
        ("reference", ctypes.c_uint),
        ("kind", ctypes.c_int32),
        ("asked", ctypes.c_int32),
        ("tunable", ctypes.c_int32),
    )


class _Special(ctypes.Structure):
    _fields_ = (
        ("clocks", ctypes.c_uint64),
        ("start", ctypes.c_double),
        ("reference", ctypes.c_uint),
        ("kind", ctypes.c_int32),
        ("role", ctypes.c_int32),
    )


class _Table(ctypes.Structure):
    _fields_ = (
        ("functions", ctypes.c_void_p * len(FUNCTIONS)),
        ("resources", ctypes.c_char_p),
        ("references", ctypes.c_void_p),
        ("kinds", ctypes.c_void_p),
        ("n", ctypes.c_size_t),
        ("narrow", ctypes.c_int64),
        ("events", ctypes.c_int64),
        ("early", ctypes.c_int64),
        ("clocks", ctypes.c_void_p),
        ("n_clocks", ctypes.c_size_t),
        ("specials", ctypes.c_void_p),
        ("n_specials", ctypes.c_size_t),
    )


@cache
def adapter_path() -> Path:
    try:
        return compile_here(*(Path(__file__).with_name(name) for name in SOURCES))
    except (OSError, RuntimeError) as error:
        raise FmuFileError(
            f"FMUs of FMI 3.0 run behind a compiled adapter: {error}; ask for FMI 2.0"
        ) from error


def needed_functions(description: FmuDescription) -> set[str]:
    """Functions without which an FMU of FMI 3.0 cannot be run, by what it declares; without ``fmi3``."""
    needed = {
        "InstantiateCoSimulation",
        "FreeInstance",
        "EnterInitializationMode",
        "ExitInitializationMode",
        "Terminate",
        "Reset",
        "DoStep",
        "GetFloat64",
        "SetFloat64",
    }
    for kind in {
        _kind(v.declared_type) for v in description.variables.values() if v.type != "Array"
    } & set(_KINDS):
        needed |= {f"Get{kind}", f"Set{kind}"}
    if description.can_save_state:
        needed |= {"GetFMUState", "SetFMUState", "FreeFMUState"}
    if description.can_serialize_state:
        needed |= {"SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState"}
    if description.gives_directional_derivatives:
        needed.add("GetDirectionalDerivative")
    if description.has_event_mode:
        needed |= {"EnterEventMode", "EnterStepMode", "UpdateDiscreteStates"}
    ticking = [c for c in description.clocks if c.variability != "triggered"]
    asked = [c for c in ticking if c.interval is None]
    needed |= {"SetClock"} if ticking else set()
    needed |= {"GetClock"} if len(ticking) < len(description.clocks) else set()
    needed |= {"GetIntervalDecimal"} if asked else set()
    return needed | ({"GetShiftDecimal"} if any(c.periodic for c in asked) else set())


def refuse_other_clocks(description: FmuDescription) -> None:
    """Raise where a clock ticks only with those of other FMUs, which this master does not connect."""
    others = [
        c.name
        for c in description.clocks
        if c.variability == "triggered" and c.causality == "input"
    ]
    if others:
        raise UnsupportedFmuError(
            f"{description.path}: its clock {others[0]!r} is triggered by another FMU's clock, and this master has "
            "clocks that tick by the time only",
            "triggered clocks",
            "ask for an export with periodic clocks",
        )
    if len(description.clocks) > MOST_CLOCKS:
        raise UnsupportedFmuError(
            f"{description.path}: it has {len(description.clocks)} clocks, and this master has room for {MOST_CLOCKS}",
            "too many clocks",
            "ask for an export with fewer",
        )


def _kind(declared: str) -> str:
    return _ALIKE.get(declared, declared)


class Fmi3Library:
    """The binary of an extracted FMU of FMI 3.0, and what the adapter has to know of it; kept as long as instances."""

    def __init__(self, description: FmuDescription, directory: Path, library: ctypes.CDLL) -> None:
        refuse_other_clocks(description)
        self._library = library
        known = sorted(
            (v.reference, _KINDS.index(kind))
            for v in description.variables.values()
            if v.type != "Array" and (kind := _kind(v.declared_type)) in _KINDS
        )
        self._references = (ctypes.c_uint * len(known))(*(reference for reference, _ in known))
        self._kinds = (ctypes.c_ubyte * len(known))(*(kind for _, kind in known))
        self._clocks = (_Clock * len(description.clocks))(*map(_described, description.clocks))
        specials = _specials(description)
        self._specials = (_Special * len(specials))(*specials)
        self._table = table = _Table()
        resources = (directory / "resources").resolve()
        table.resources = f"{resources}{os.sep}".encode() if resources.is_dir() else None
        table.references, table.kinds = (
            ctypes.addressof(self._references),
            ctypes.addressof(self._kinds),
        )
        table.n, table.narrow = (
            len(known),
            any(kind == _KINDS.index("Float32") for _, kind in known),
        )
        table.events, table.early = description.has_event_mode, description.returns_early
        table.clocks, table.n_clocks = ctypes.addressof(self._clocks), len(description.clocks)
        table.specials, table.n_specials = ctypes.addressof(self._specials), len(specials)

    def prepare(self, adapter: Any) -> None:
        for place, name in enumerate(FUNCTIONS):
            function = getattr(self._library, f"fmi3{name}", adapter.fmi3_absent)
            self._table.functions[place] = ctypes.cast(function, ctypes.c_void_p)
        adapter.fmi3_prepare(ctypes.byref(self._table))


def _described(clock: FmiClock) -> _Clock:
    kind = "output" if clock.variability == "triggered" else clock.variability
    kind = "periodic" if clock.periodic else kind
    asked = kind != "output" and clock.interval is None
    interval = 0.0 if clock.interval is None else clock.interval
    return _Clock(
        interval,
        clock.shift,
        clock.reference,
        _CLOCK_KINDS.index(kind),
        asked,
        clock.variability == "tunable",
    )


def _specials(description: FmuDescription) -> list[_Special]:
    place = {clock.reference: k for k, clock in enumerate(description.clocks)}
    variables = {v.reference: v for v in description.variables.values() if v.type != "Array"}
    found = []
    for reference, clocks in sorted(description.specials.items()):
        variable = variables.get(reference)
        if variable is None or (kind := _kind(variable.declared_type)) not in _KINDS:
            continue
        inside = variable.causality == "input"
        clocked = _CLOCKED_INPUT if inside else _CLOCKED
        role = clocked if clocks else _DISCRETE_INPUT
        bits = sum(1 << place[clock] for clock in set(clocks) if clock in place)
        start = variable.start_number if isfinite(variable.start_number) else 0.0
        found.append(_Special(bits, start, reference, _KINDS.index(kind), role))
    return found

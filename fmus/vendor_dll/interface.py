"""Declarations of an IEEE/CIGRE DLL: its signals, parameters and states, and where each lies in the host's memory.

Source of the structures: CIGRE Technical Brochure 958 (2025) and the header of its API, version 2."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

Number = int | float


@dataclass(frozen=True)
class DataType:
    name: str  # as the interface has it, such as ``real64``
    c: str
    size: int  # of one value, which is also its alignment [bytes]
    kind: Literal["Real", "Integer", "String"]  # type of a variable of FMI 2.0 for it


DATA_TYPES = {
    1: DataType("char", "char", 1, "Integer"),
    2: DataType("int8", "int8_t", 1, "Integer"),
    3: DataType("uint8", "uint8_t", 1, "Integer"),
    4: DataType("int16", "int16_t", 2, "Integer"),
    5: DataType("uint16", "uint16_t", 2, "Integer"),
    6: DataType("int32", "int32_t", 4, "Integer"),
    7: DataType("uint32", "uint32_t", 4, "Real"),  # an Integer of FMI 2.0 has 32 bits with a sign
    8: DataType("real32", "float", 4, "Real"),
    9: DataType("real64", "double", 8, "Real"),
    10: DataType("c_string", "const char *", 8, "String"),
}
"""By the number that the interface gives each."""

CALLS = (
    "FirstCall",
    "CheckParameters",
    "Initialize",
    "Outputs",
    "Iterate",
    "Terminate",
    "PrintInfo",
)
"""Functions beside ``Model_GetInfo``, without their prefix ``Model_``."""

# before the names of the DLL's variables, where a circuit lies around it
CONTROLLER = "controller."
_SHORTEST = 1e-9  # A shorter sample time is none [s]
_VERSIONS = (0, 1, 2)
"""First numbers of the interface's version that are known: 1 is that of both editions of its API; some write 2 for the
second edition, some nothing.
"""

NEEDED = ("Initialize", "Outputs")  # without these a DLL cannot be run


@dataclass(frozen=True)
class Signal:
    """An input or output; ``data_type`` is the interface's number, ``width`` the length of its array."""

    name: str
    description: str
    unit: str
    data_type: int
    width: int


@dataclass(frozen=True)
class DllParameter:
    """A parameter; one that is ``fixed`` can be set before the start only."""

    name: str
    group: str
    description: str
    unit: str
    data_type: int
    fixed: bool
    # default, minimum, maximum: in the parameter's own type; text for a ``c_string``, which has no bounds.
    default: Number | str
    minimum: Number | None
    maximum: Number | None


@dataclass(frozen=True)
class DllInterface:
    # ``ModelName``, ``ModelVersion`` and the eight others, by the interface's names
    texts: dict[str, str]
    interface_version: tuple[int, ...]  # four numbers
    sample_time: float  # ``FixedStepBaseSampleTime`` [s]; not positive means: that of the host
    mode: int  # ``EMT_RMS_Mode``: 1 is EMT, 2 RMS, 3 both; others say nothing
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    parameters: tuple[DllParameter, ...]
    states: tuple[int, int, int]  # numbers of integer, float and double states
    calls: tuple[str, ...]  # those of `CALLS` that the DLL has

    def as_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "DllInterface":
        signals = {
            name: tuple(Signal(**row) for row in data[name]) for name in ("inputs", "outputs")
        }
        rows = {"parameters": tuple(DllParameter(**row) for row in data["parameters"])}
        plain = {name: tuple(data[name]) for name in ("interface_version", "states", "calls")}
        return cls(**data | signals | rows | plain)

    def with_defaults(self, values: Mapping[str, Number | str]) -> "DllInterface":
        rows = tuple(
            replace(row, default=values.get(row.name, row.default)) for row in self.parameters
        )
        return replace(self, parameters=rows)

    def faults(self) -> list[str]:
        """Declarations that no host can run, in words; empty for a sound DLL."""
        found = [
            f"it has no function Model_{call}, which every host calls"
            for call in NEEDED
            if call not in self.calls
        ]
        if self.interface_version[0] not in _VERSIONS:
            told = ".".join(map(str, self.interface_version))
            found.append(
                f"it was written for version {told} of the interface, whose structures are not known here"
            )
        if not self.outputs:
            found.append("it declares no outputs, or its structure is of another layout")
        groups: tuple[tuple[str, Sequence[Signal | DllParameter]], ...] = (
            ("input", self.inputs),
            ("output", self.outputs),
            ("parameter", self.parameters),
        )
        for kind, rows in groups:
            names = [row.name for row in rows]
            for place, row in enumerate(rows, start=1):
                where = f"{kind} {place} ({row.name!r})"
                if not row.name:
                    found.append(f"{kind} {place} has no name")
                elif names.index(row.name) != place - 1:
                    found.append(
                        f"{where} has the name of {kind} {names.index(row.name) + 1}; each needs its own"
                    )
                if row.data_type not in DATA_TYPES:
                    found.append(
                        f"{where} has data type {row.data_type}; the interface knows 1 to 10"
                    )
                if isinstance(row, Signal) and not 1 <= row.width <= 100_000:
                    found.append(
                        f"{where} has width {row.width}; it must be at least 1 (and 100,000 at most)"
                    )
                if isinstance(row, DllParameter) and (row.minimum or 0) > (row.maximum or 0):
                    found.append(
                        f"{where} has the bounds {row.minimum} to {row.maximum}, between which nothing is"
                    )
                if not row.name.isprintable():
                    found.append(f"{where} has a name that cannot be written")
        if not math.isfinite(self.sample_time) or 0 < self.sample_time < _SHORTEST:
            found.append(
                f"its sample time is {self.sample_time:g} s; at least {_SHORTEST:g} s, or none, can be run"
            )
        if any(count < 0 for count in self.states):
            found.append(
                f"its numbers of integer, float and double states are {self.states}; none may be negative"
            )
        return found


@dataclass(frozen=True)
class Place:
    """One value in a structure of the host."""

    # of the signal or parameter, with its place in the array in brackets, from 1, where there is
    # one
    name: str
    row: Signal | DllParameter
    offset: int  # from the structure's start [bytes]

    @property
    def type(self) -> DataType:
        return DATA_TYPES[self.row.data_type]


@dataclass(frozen=True)
class Layout:
    """A C structure with one member for each signal or parameter, in order, each at its natural alignment."""

    places: tuple[Place, ...] = field(default=())
    size: int = 0


def layout(rows: Sequence[Signal | DllParameter]) -> Layout:
    """Where a compiler for a 64-bit machine puts each value: every member begins at a multiple of its size."""
    places, end, widest = [], 0, 1
    for row in rows:
        size = DATA_TYPES[row.data_type].size
        end = -(-end // size) * size
        widest = max(widest, size)
        width = row.width if isinstance(row, Signal) else 1
        for place in range(width):
            name = row.name if width == 1 else f"{row.name}[{place + 1}]"
            places.append(Place(name, row, end + place * size))
        end += width * size
    return Layout(tuple(places), -(-end // widest) * widest)

"""Where a DLL keeps its state, found by running it twice from the same arrays.

The interface asks a DLL to keep its state in arrays of the host. Then a host can save and restore it. Some DLLs keep
variables of their own as well: the library's writable memory then changes in a run, and belongs to the state."""

import ctypes as c
import math
import struct
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from fmus.vendor_dll.interface import DllInterface, DllParameter, Layout, Signal, layout
from fmus.vendor_dll.memory import Library, Region

SAMPLES = 200  # in each of the runs
# of the inputs' waves; the second where the DLL refuses the first with an error
LARGEST = (1.5, 0.6)
# A word is taken for a number where its magnitude is zero or between these at all times
_MODEST = (1e-12, 1e12)


@dataclass(frozen=True)
class Trial:
    # ``arrays``: in the host's arrays alone; ``library``: also in variables of its own, in the library's memory;
    # ``hidden``: neither brings it back; ``not tried``.
    state: str
    # doubles, floats: places of numbers in the library's memory that move in a run, from where the library was loaded
    # [bytes].
    doubles: tuple[int, ...] = ()
    floats: tuple[int, ...] = ()
    # start and size of each stretch of the library's memory that belongs to the state [bytes].
    regions: tuple[tuple[int, int], ...] = ()
    why: str = ""  # reason in words where nothing was tried
    # that reason lies in this machine at this time, so that the DLL is tried again at the next call.
    passing: bool = False

    def as_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Trial":
        places = {name: tuple(data[name]) for name in ("doubles", "floats")}
        regions = tuple((start, size) for start, size in data["regions"])
        return cls(
            data["state"], **places, regions=regions, why=data["why"], passing=data["passing"]
        )


class InstanceStructure(c.Structure):
    """The structure that a host hands to every call for one instance."""

    _fields_ = (
        ("inputs", c.c_void_p),
        ("outputs", c.c_void_p),
        ("parameters", c.c_void_p),
        ("time", c.c_double),
        ("mode", c.c_uint8),
        ("error", c.c_void_p),
        ("message", c.c_void_p),
        ("ints", c.c_void_p),
        ("floats", c.c_void_p),
        ("doubles", c.c_void_p),
    )


class _Host:
    """One instance of a DLL, with inputs that move."""

    def __init__(self, library: Library, interface: DllInterface, largest: float) -> None:
        self._library, self._interface, self._largest = library, interface, largest
        self._layouts = [
            layout(rows) for rows in (interface.inputs, interface.outputs, interface.parameters)
        ]
        self._sizes = [found.size for found in self._layouts] + [
            n * size for n, size in zip(interface.states, (4, 4, 8), strict=True)
        ]
        self._sizes = [size + 64 for size in self._sizes]
        self._at = [library.allocate(size) for size in self._sizes]
        at = self._at
        self._instance = InstanceStructure(
            *at[:3], 0.0, 2 if interface.mode == 2 else 1, None, None, *at[3:]
        )
        self._instance_at = library.allocate(c.sizeof(InstanceStructure))
        self._inputs = bytearray(self._sizes[0])
        self._set_defaults(interface.parameters, self._layouts[2])

    def _set_defaults(self, parameters: Sequence[DllParameter], places: Layout) -> None:
        content = bytearray(self._sizes[2])
        for parameter, place in zip(parameters, places.places, strict=True):
            if isinstance(parameter.default, str):
                text = parameter.default.encode() + b"\0"
                address = self._library.allocate(len(text))
                self._library.write(address, text)
                struct.pack_into("P", content, place.offset, address)
            else:
                pack_value(content, place.row, place.offset, parameter.default)
        self._library.write(self._at[2], bytes(content))

    def start(self) -> None:
        for call in ("FirstCall", "CheckParameters", "Initialize"):
            if call in self._interface.calls:
                self._call(call)

    def _call(self, name: str) -> None:
        library = self._library
        library.write(self._instance_at, bytes(self._instance))
        if c.c_int32(library.call(f"Model_{name}", self._instance_at)).value == 2:
            said = InstanceStructure.from_buffer_copy(
                library.read(self._instance_at, c.sizeof(InstanceStructure))
            ).error
            words = (library.text(said) or b"(no message)").decode("utf-8", "replace").strip()
            raise ValueError(f"Model_{name} ends with an error: {words}")

    def run(self, first: int) -> bytes:
        """Everything that came out in one run, which begins at a sample."""
        seen = b""
        step = self._interface.sample_time if self._interface.sample_time > 0 else 1e-4
        for sample in range(first, first + SAMPLES):
            for k, place in enumerate(self._layouts[0].places):
                if place.type.kind != "String":
                    value = moving_input(sample, k, place.type.kind, self._largest)
                    pack_value(self._inputs, place.row, place.offset, value)
            self._library.write(self._at[0], bytes(self._inputs))
            self._instance.time = sample * step
            self._call("Outputs")
            seen += self._library.read(self._at[1], self._sizes[1])
        return seen + b"".join(self.arrays()[3:])

    def arrays(self) -> list[bytes]:
        return [
            self._library.read(at, size) for at, size in zip(self._at, self._sizes, strict=True)
        ]

    def restore(self, arrays: list[bytes]) -> None:
        for at, kept in zip(self._at, arrays, strict=True):
            self._library.write(at, kept)
        self._inputs[:] = arrays[0]


def tried(library: Library, interface: DllInterface) -> Trial:
    """Run a DLL from the same arrays twice, and then from the same arrays and the same memory of its library."""
    for largest in LARGEST:
        try:
            return _tried(_Host(library, interface, largest), library)
        except ValueError as error:
            refused = Trial("not tried", why=str(error), passing=getattr(error, "passing", False))
    return refused


def _tried(host: _Host, library: Library) -> Trial:
    host.start()
    host.run(0)
    regions = library.regions() or []
    arrays, memory = host.arrays(), _copy(library, regions)
    first = host.run(SAMPLES)
    moving = [memory, _copy(library, regions)]
    host.restore(arrays)
    from_arrays = host.run(SAMPLES) == first
    places = tuple((start - base, size) for base, start, size in regions)
    if from_arrays and moving[0] == moving[1]:
        return Trial("arrays", regions=places)
    if not regions:
        return Trial("hidden", why="the library's own memory is looked at on Linux only")
    host.restore(arrays)
    _put_back(library, regions, memory)
    if host.run(SAMPLES) != first:
        return Trial(
            "hidden", why="a run from the same arrays and the same memory of the library differs"
        )
    return Trial("library", *_numbers(regions, moving), regions=places)


def moving_input(sample: int, k: int, kind: str, largest: float) -> float:
    """Waves beyond what is usual in per unit, then around 1, where a voltage is; whole numbers change in turn."""
    if kind == "Integer":
        return (sample // 25 + k) % 3
    wave = math.sin(0.031 * sample * (1 + 0.01 * k) + 2.0944 * k)
    return largest * wave if sample % SAMPLES < SAMPLES // 2 else 1.0 + 0.2 * wave


def pack_value(buffer: bytearray, row: Signal | DllParameter, offset: int, value: float) -> None:
    code = {1: "b", 2: "b", 3: "B", 4: "h", 5: "H", 6: "i", 7: "I", 8: "f", 9: "d"}[row.data_type]
    whole = max(0, round(value)) if code in "BHI" else round(value)
    struct.pack_into(code, buffer, offset, value if code in "fd" else whole)


def _copy(library: Library, regions: Sequence[Region]) -> list[bytes]:
    return [library.read(start, size) for _, start, size in regions]


def _put_back(library: Library, regions: Sequence[Region], memory: list[bytes]) -> None:
    for (_, start, _), kept in zip(regions, memory, strict=True):
        library.write(start, kept)


def _numbers(
    regions: Sequence[Region], moving: Sequence[list[bytes]]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Places of doubles and of floats that differ between two times, as numbers look."""
    doubles, floats = [], []
    for k, (base, start, size) in enumerate(regions):
        ahead = -start % 8
        for offset in range(ahead, size - 7, 8):
            words = [memory[k][offset : offset + 8] for memory in moving]
            if words[0] == words[1]:
                continue
            place = start + offset - base
            if all(_modest(struct.unpack("d", word)[0]) for word in words):
                doubles.append(place)
                continue
            halves = [struct.unpack("2f", word) for word in words]
            floats += [
                place + 4 * half
                for half in (0, 1)
                if halves[0][half] != halves[1][half]
                and all(_modest(pair[half]) for pair in halves)
            ]
    return tuple(doubles), tuple(floats)


def _modest(value: float) -> bool:
    return value == 0.0 or _MODEST[0] <= abs(value) <= _MODEST[1]

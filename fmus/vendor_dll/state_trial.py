"""Where a DLL keeps its state, found by running it twice from the same arrays.

The interface asks a DLL to keep its state in arrays of the host. Then a host can save and restore it. Some DLLs keep
variables of their own as well: the library's writable memory then changes in a run, and belongs to the state.
"""

import ctypes as c
import math
import struct
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fmus.vendor_dll.interface import DllInterface, DllParameter, Layout, Signal, layout

_SAMPLES = 200
"""In each of the runs."""

_LARGEST = (1.5, 0.6)
"""Of the inputs' waves; the second where the DLL refuses the first with an error."""

_MODEST = (1e-12, 1e12)
"""A word is taken for a number where its magnitude is zero or between these at all times."""

_WRITABLE, _LOADED, _RELOCATED_ONLY = 2, 1, 0x6474E552  # PF_W, PT_LOAD, PT_GNU_RELRO


@dataclass(frozen=True)
class Trial:
    """How a DLL keeps its state.

    Attributes
    ----------
    state
        ``arrays``: in the host's arrays alone; ``library``: also in variables of its own, in the library's memory;
        ``hidden``: neither brings it back; ``not tried``.
    doubles, floats
        Places of numbers in the library's memory that move in a run, from where the library was loaded [bytes].
    regions
        Start and size of each stretch of the library's memory that belongs to the state [bytes].
    why
        Reason in words where nothing was tried.
    """

    state: str
    doubles: tuple[int, ...] = ()
    floats: tuple[int, ...] = ()
    regions: tuple[tuple[int, int], ...] = ()
    why: str = ""

    def as_json(self) -> dict[str, Any]:
        """For another process."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Trial":
        """What `as_json` gave."""
        places = {name: tuple(data[name]) for name in ("doubles", "floats")}
        regions = tuple((start, size) for start, size in data["regions"])
        return cls(data["state"], **places, regions=regions, why=data["why"])


class _Instance(c.Structure):
    _fields_ = (
        *((name, c.c_void_p) for name in ("inputs", "outputs", "parameters")),
        ("time", c.c_double),
        ("mode", c.c_uint8),
        *((name, c.c_char_p) for name in ("error", "message")),
        *((name, c.c_void_p) for name in ("ints", "floats", "doubles")),
    )


class _Host:
    """One instance of a DLL, with inputs that move."""

    def __init__(self, library: c.CDLL, interface: DllInterface, largest: float) -> None:
        self._library, self._interface, self._largest = library, interface, largest
        self._layouts = [layout(rows) for rows in (interface.inputs, interface.outputs, interface.parameters)]
        sizes = [found.size for found in self._layouts] + [
            n * size for n, size in zip(interface.states, (4, 4, 8), strict=True)
        ]
        self._buffers = [c.create_string_buffer(size + 64) for size in sizes]
        addresses = [c.addressof(buffer) for buffer in self._buffers]
        self._instance = _Instance(*addresses[:3], 0.0, 2 if interface.mode == 2 else 1, None, None, *addresses[3:])
        self._kept: list[c.Array[c.c_char]] = []
        self._set_defaults(interface.parameters, self._layouts[2])

    def _set_defaults(self, parameters: Sequence[DllParameter], places: Layout) -> None:
        for parameter, place in zip(parameters, places.places, strict=True):
            if isinstance(parameter.default, str):
                text = c.create_string_buffer(parameter.default.encode())
                self._kept.append(text)
                struct.pack_into("P", self._buffers[2], place.offset, c.addressof(text))
            else:
                _pack(self._buffers[2], place.row, place.offset, parameter.default)

    def start(self) -> None:
        for call in ("FirstCall", "CheckParameters", "Initialize"):
            if call in self._interface.calls:
                self._call(call)

    def _call(self, name: str) -> None:
        if getattr(self._library, f"Model_{name}")(c.byref(self._instance)) == 2:
            words = (self._instance.error or b"(no message)").decode("utf-8", "replace").strip()
            raise ValueError(f"Model_{name} ends with an error: {words}")

    def run(self, first: int) -> bytes:
        """Everything that came out in one run, which begins at a sample."""
        seen = b""
        step = self._interface.sample_time if self._interface.sample_time > 0 else 1e-4
        for sample in range(first, first + _SAMPLES):
            for k, place in enumerate(self._layouts[0].places):
                if place.type.kind != "String":
                    _pack(self._buffers[0], place.row, place.offset, self._input(sample, k, place.type.kind))
            self._instance.time = sample * step
            self._call("Outputs")
            seen += self._buffers[1].raw
        return seen + b"".join(buffer.raw for buffer in self._buffers[3:])

    def _input(self, sample: int, k: int, kind: str) -> float:
        """Waves beyond what is usual in per unit, then around 1, where a voltage is; whole numbers change in turn."""
        if kind == "Integer":
            return (sample // 25 + k) % 3
        wave = math.sin(0.031 * sample * (1 + 0.01 * k) + 2.0944 * k)
        return self._largest * wave if sample % _SAMPLES < _SAMPLES // 2 else 1.0 + 0.2 * wave

    def arrays(self) -> list[bytes]:
        return [buffer.raw for buffer in self._buffers]

    def restore(self, arrays: list[bytes]) -> None:
        for buffer, kept in zip(self._buffers, arrays, strict=True):
            c.memmove(buffer, kept, len(kept))


def tried(library: c.CDLL, interface: DllInterface, path: Path) -> Trial:
    """Run a DLL from the same arrays twice, and then from the same arrays and the same memory of its library."""
    for largest in _LARGEST:
        try:
            return _tried(_Host(library, interface, largest), path)
        except ValueError as error:
            refused = Trial("not tried", why=str(error))
    return refused


def _tried(host: _Host, path: Path) -> Trial:
    host.start()
    host.run(0)
    regions = list(_writable(path)) if sys.platform.startswith("linux") else []
    arrays, memory = host.arrays(), _copy(regions)
    first = host.run(_SAMPLES)
    moving = [memory, _copy(regions)]
    host.restore(arrays)
    from_arrays = host.run(_SAMPLES) == first
    places = tuple((start - base, size) for base, start, size in regions)
    if from_arrays and moving[0] == moving[1]:
        return Trial("arrays", regions=places)
    if not regions:
        return Trial("hidden", why="the library's own memory is looked at on Linux only")
    host.restore(arrays)
    _put_back(regions, memory)
    if host.run(_SAMPLES) != first:
        return Trial("hidden", why="a run from the same arrays and the same memory of the library differs")
    return Trial("library", *_numbers(regions, moving), regions=places)


def _pack(buffer: c.Array[c.c_char], row: Signal | DllParameter, offset: int, value: float) -> None:
    code = {1: "b", 2: "b", 3: "B", 4: "h", 5: "H", 6: "i", 7: "I", 8: "f", 9: "d"}[row.data_type]
    whole = max(0, round(value)) if code in "BHI" else round(value)
    struct.pack_into(code, buffer, offset, value if code in "fd" else whole)


class _Segment(c.Structure):
    _fields_ = (
        ("type", c.c_uint32),
        ("flags", c.c_uint32),
        *((name, c.c_uint64) for name in ("offset", "address", "physical", "in_file", "size", "align")),
    )


class _Loaded(c.Structure):
    _fields_ = (
        ("base", c.c_uint64),
        ("name", c.c_char_p),
        ("segments", c.POINTER(_Segment)),
        ("count", c.c_uint16),
    )


def _writable(path: Path) -> Iterator[tuple[int, int, int]]:
    """Base, start and size of each stretch of a loaded library's memory that it may write."""
    found: list[tuple[int, int, int]] = []

    def look(info: Any, _size: int, _data: Any) -> int:
        loaded = info.contents
        if not loaded.name or Path(loaded.name.decode("utf-8", "surrogateescape")) != path:
            return 0
        segments = [loaded.segments[k] for k in range(loaded.count)]
        fixed = [(s.address, s.address + s.size) for s in segments if s.type == _RELOCATED_ONLY]
        for segment in segments:
            if segment.type == _LOADED and segment.flags & _WRITABLE:
                begin, end = segment.address, segment.address + segment.size
                for low, high in fixed:  # relocated once, then made read-only, by whole pages
                    if low <= begin < high:
                        begin = min(end, -(-high // 4096) * 4096 if high < end else high)
                if begin < end:
                    found.append((loaded.base, loaded.base + begin, end - begin))
        return 0

    callback = c.CFUNCTYPE(c.c_int, c.POINTER(_Loaded), c.c_size_t, c.c_void_p)
    c.CDLL(None).dl_iterate_phdr(callback(look), None)
    return iter(found)


def _copy(regions: Sequence[tuple[int, int, int]]) -> list[bytes]:
    return [c.string_at(start, size) for _, start, size in regions]


def _put_back(regions: Sequence[tuple[int, int, int]], memory: list[bytes]) -> None:
    for (_, start, size), kept in zip(regions, memory, strict=True):
        c.memmove(start, kept, size)


def _numbers(
    regions: Sequence[tuple[int, int, int]], moving: Sequence[list[bytes]]
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
                if halves[0][half] != halves[1][half] and all(_modest(pair[half]) for pair in halves)
            ]
    return tuple(doubles), tuple(floats)


def _modest(value: float) -> bool:
    return value == 0.0 or _MODEST[0] <= abs(value) <= _MODEST[1]

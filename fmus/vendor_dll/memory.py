"""A loaded DLL and its memory, wherever it is: in this process, or in one that is asked."""

import ctypes as c
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol

_WRITABLE = 2  # flag of a segment: PF_W
_LOADED = 1  # type of a segment: PT_LOAD
_RELOCATED_ONLY = 0x6474E552  # type of a segment: PT_GNU_RELRO

Region = tuple[int, int, int]  # base of the library, start and size of a stretch of its memory


Note = Callable[[str], None]  # takes what the DLL is doing, in words that follow "while"


def unheard(_doing: str) -> None:
    """Note nothing."""


class LibraryEndedError(ValueError):
    """The process that holds a DLL has ended; ``passing``: for a reason of this moment, and a try may succeed."""

    def __init__(self, words: str, *, passing: bool = False) -> None:
        super().__init__(words)
        self.passing = passing


class Library(Protocol):
    """A loaded DLL; addresses are those of its own process."""

    def has(self, name: str) -> bool:
        """Return whether it has a function."""

    def call(self, name: str, argument: int = 0) -> int:
        """A function's answer to one pointer, as 64 bits."""

    def read(self, address: int, size: int) -> bytes:
        """A stretch of memory."""

    def text(self, address: int | None) -> bytes:
        """A text that ends with a zero; empty where there is none."""

    def write(self, address: int, content: bytes) -> None:
        """Change a stretch of memory."""

    def allocate(self, size: int) -> int:
        """Address of new memory, all zero, which is never given back."""

    def regions(self) -> list[Region] | None:
        """Memory of the library that it may write; None where that cannot be told."""


class LocalLibrary:
    def __init__(self, path: Path, note: Note = unheard) -> None:
        note("it is loaded")
        self._path, self._library, self._note = path, c.CDLL(str(path)), note
        self._kept: list[Any] = []

    def has(self, name: str) -> bool:
        return hasattr(self._library, name)

    def call(self, name: str, argument: int = 0) -> int:
        """A function's answer to one pointer, as 64 bits."""
        function = getattr(self._library, name)
        function.restype, function.argtypes = c.c_int64, [c.c_void_p]
        self._note(f"{name} runs")
        found = int(function(argument))
        self._note(f"what {name} returned is read")
        return found

    def read(self, address: int, size: int) -> bytes:
        return c.string_at(address, size)

    def text(self, address: int | None) -> bytes:
        """A text that ends with a zero; empty where there is none."""
        return c.string_at(address) if address else b""

    def write(self, address: int, content: bytes) -> None:
        c.memmove(address, content, len(content))

    def allocate(self, size: int) -> int:
        """Address of new memory, all zero, which is never given back."""
        self._kept.append(c.create_string_buffer(size))
        return c.addressof(self._kept[-1])

    def regions(self) -> list[Region] | None:
        """Memory of the library that it may write; None where that cannot be told."""
        return list(_writable(self._path)) if sys.platform.startswith("linux") else None


class _Segment(c.Structure):
    _fields_ = (
        ("type", c.c_uint32),
        ("flags", c.c_uint32),
        *(
            (name, c.c_uint64)
            for name in ("offset", "address", "physical", "in_file", "size", "align")
        ),
    )


class _Loaded(c.Structure):
    _fields_ = (
        ("base", c.c_uint64),
        ("name", c.c_char_p),
        ("segments", c.POINTER(_Segment)),
        ("count", c.c_uint16),
    )


def _writable(path: Path) -> Iterator[Region]:
    """Base, start and size of each stretch of a loaded library's memory that it may write."""
    found: list[Region] = []

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

"""The process that holds a controller DLL for `dll_process`: closed off, then loaded, then told what to call.

What it is told comes line by line; nothing is judged here. Code of the DLL runs in this process and can fake what is
only known from it."""

import ctypes
import json
import os
import struct
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fmus.vendor_dll.memory import Library, LocalLibrary, Note
from fmus.vendor_dll.reading import read_interface
from orchestrator.core.errors import InputError
from orchestrator.devices.sandbox import wine
from orchestrator.devices.sandbox.access_restriction import confine_alone
from orchestrator.devices.sandbox.kernel_calls import end_with_starter
from orchestrator.devices.sandbox.resource_limits import Limits, apply_limits

PAGE = 4096  # the smallest page of the machines that are known [bytes]
_READ_WRITE = (
    3  # PROT_READ and PROT_WRITE of Linux's sys/mman.h; those below are from there as well
)
_NONE = 0  # PROT_NONE
_PRIVATE_ANONYMOUS = 0x22  # MAP_PRIVATE and MAP_ANONYMOUS
_ERROR_AT = 40  # place of the error's text in the instance's structure [bytes]
_MESSAGE_AT = 48  # place of the message's text there [bytes]
_CONTROL = {"x86_64": (28, 4)}
"""Machine → place and size of the control word of floating-point arithmetic in what ``fegetenv`` gives [bytes]."""
_FLAGS = 0x3F  # of that word, set by every inexact operation


class _HeapInfo(ctypes.Structure):
    """``struct mallinfo2`` of glibc."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks"),
            *("uordblks", "fordblks", "keepcost"),
        )
    )


class _Host:
    """Does what it is told; each answer is of JSON's types."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._system = ctypes.CDLL(None)
        self._commands: dict[str, Callable[..., Any]] = {
            "interface": self._interface,
            "has": library.has,
            "call": self._call,
            "read": self._read,
            "write": self._write,
            "allocate": library.allocate,
            "guarded": self._guarded,
            "regions": library.regions,
            "repeat": self._repeat,
            "heap": self._heap,
            "entries": _count_entries,
            "arithmetic": self._arithmetic,
            "thread": self._in_thread,
        }

    def do(self, orders: list[list[Any]]) -> list[Any]:
        return [self._commands[name](*arguments) for name, *arguments in orders]

    def _read(self, address: int, size: int) -> str:
        return self._library.read(address, size).hex()

    def _write(self, address: int, text: str) -> None:
        self._library.write(address, bytes.fromhex(text))

    def _interface(self) -> dict[str, Any]:
        return read_interface(self._library).as_json()

    def _call(self, name: str, instance: int) -> list[Any]:
        """Return what a function returned, and the text that belongs to it (None where its place is empty)."""
        code = ctypes.c_int32(self._library.call(f"Model_{name}", instance)).value
        if code not in (1, 2) or not instance:
            return [code, None]
        at = instance + (_ERROR_AT if code == 2 else _MESSAGE_AT)
        address = int.from_bytes(self._library.read(at, 8), sys.byteorder)
        return [code, self._library.text(address).decode("utf-8", "replace") if address else None]

    def _repeat(self, name: str, instance: int, times: int) -> None:
        for _ in range(times):
            self._library.call(f"Model_{name}", instance)

    def _guarded(self, size: int, at_the_end: bool) -> list[int]:
        """Address of memory, and of its slack, between two pages that nobody may touch."""
        system = self._system
        system.mmap.restype = ctypes.c_void_p
        system.mmap.argtypes = [
            ctypes.c_void_p,
            ctypes.c_size_t,
            *[ctypes.c_int] * 3,
            ctypes.c_long,
        ]
        system.mprotect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
        inner = max(1, -(-size // PAGE)) * PAGE
        found = system.mmap(None, inner + 2 * PAGE, _READ_WRITE, _PRIVATE_ANONYMOUS, -1, 0)
        if found in (None, ctypes.c_void_p(-1).value):
            raise MemoryError
        for guard in (found, found + PAGE + inner):
            if system.mprotect(guard, PAGE, _NONE):
                raise OSError(0, "a page cannot be closed")
        begin = int(found + PAGE)
        return [begin + inner - size if at_the_end else begin, begin, inner]

    def _heap(self) -> int | None:
        """Bytes that the process has in use; None where the C library does not tell."""
        if not hasattr(self._system, "mallinfo2"):
            return None
        self._system.mallinfo2.restype = _HeapInfo
        found = self._system.mallinfo2()
        return int(found.uordblks + found.hblkhd)

    def _arithmetic(self) -> int | None:
        """Control of rounding, of tiny numbers and of traps, as a word; None where its place is not known."""
        place = _CONTROL.get(os.uname().machine)
        if place is None:
            return None
        found = ctypes.create_string_buffer(64)
        try:
            ctypes.CDLL("libm.so.6").fegetenv(found)
        except (OSError, AttributeError):
            return None
        at, size = place
        return int.from_bytes(found.raw[at : at + size], sys.byteorder) & ~_FLAGS

    def _in_thread(self, orders: list[list[Any]]) -> list[Any]:
        found: list[Any] = []
        thread = threading.Thread(target=lambda: found.extend(self.do(orders)))
        thread.start()
        thread.join()
        return found


def _count_entries(folder: str) -> int | None:
    return len(os.listdir(folder)) if os.path.isdir(folder) else None


def _noting(channel: Any) -> Note:
    def note(doing: str) -> None:
        os.write(channel, f"{json.dumps({'doing': doing})}\n".encode())

    return note


class _Quiet:
    """Tells of each kind of doing once, as a run has thousands of calls."""

    def __init__(self, note: Note) -> None:
        self._note, self._last = note, ""

    def __call__(self, doing: str) -> None:
        if doing.startswith("what ") or doing == self._last:
            return
        self._last = doing
        self._note(doing)


def _loaded(library: Path, folder: Path, texts: list[str], note: Note) -> Library:
    files = [path for path in map(Path, texts) if path.is_absolute() and path.is_file()]
    windows = sys.platform == "linux" and library.read_bytes()[:2] == b"MZ"
    if not windows:
        apply_limits(Limits(), folder, own_users=True)
        confine_alone(folder, [library, *files])
        return LocalLibrary(library, note)
    from orchestrator.devices.sandbox.compiled_programs import compile_programs  # noqa: PLC0415 - imports a compiler

    programs = compile_programs()
    confine_alone(folder, [library, *programs, *files], windows=True)
    from orchestrator.devices.sandbox.wine_program import WineLibrary  # noqa: PLC0415 - numpy brings threads, so after

    return WineLibrary(library, note)


def serve(library: Path, folder: Path, texts: list[str]) -> None:
    """Answer until the asking process is gone. What the DLL prints goes nowhere."""
    channel, orders = os.dup(1), os.fdopen(os.dup(0), "r", encoding="ascii")
    for number in (0, 1, 2):
        os.dup2(os.open(os.devnull, os.O_RDWR), number)
    note = _Quiet(_noting(channel))

    def tell(answer: dict[str, Any]) -> None:
        content = f"{json.dumps(answer)}\n".encode("ascii")
        while content:
            content = content[os.write(channel, content) :]

    try:
        host = _Host(_loaded(library, folder, texts, note))
    except (OSError, ValueError, wine.NoWineError, InputError) as error:
        return tell({"not_loaded": str(error)})
    tell({"found": []})
    for line in orders:
        try:
            tell({"found": host.do(json.loads(line))})
        except (OSError, ValueError) as error:
            tell({"error": str(error)})
        except (AttributeError, TypeError, KeyError, IndexError, struct.error) as error:
            tell({"broken": repr(error)})
    return None


if __name__ == "__main__":
    end_with_starter()  # it sees that nobody asks any more only where the DLL comes back
    serve(Path(sys.argv[1]), Path(sys.argv[2]), json.loads(sys.argv[3]))
    os._exit(0)  # what a DLL registered for the end of the process is of no use to anyone

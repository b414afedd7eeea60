"""The program under Wine that runs a Windows library, and what it is asked (`wine_talk.c`)."""

import ctypes
import mmap
import os
import signal
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

from fmus.toolchain.temporary import own_folder, remove
from fmus.vendor_dll.memory import LibraryEndedError, Note, Region, unheard
from orchestrator.devices.sandbox import wine
from orchestrator.devices.sandbox.compiled_programs import host_path, proxy_path
from orchestrator.devices.sandbox.mailbox import DIED, HUNG, Client, mailbox_library

_WRITABLE = 0x80000000  # IMAGE_SCN_MEM_WRITE
LOAD, SYMBOL, CALL, READ, WRITE, ALLOCATE = range(6)


class _Talk(ctypes.Structure):
    _fields_ = (
        ("command", ctypes.c_int64),
        ("result", ctypes.c_int64),
        ("a", ctypes.c_int64 * 4),
        ("d", ctypes.c_double * 4),
    )


_ENDED = os.WEXITED | os.WNOHANG | os.WNOWAIT if hasattr(os, "waitid") else 0
_FROM_OUTSIDE = tuple(
    -getattr(signal, name)
    for name in ("SIGKILL", "SIGTERM", "SIGHUP", "SIGINT")
    if hasattr(signal, name)
)
_TO_END = 2.0  # for a program that no longer answers to end [s]
_WORDS = 4000  # most bytes of its last words that are read
_idle: list[tuple[Path, "subprocess.Popen[bytes]"]] = []
"""Programs without an instance, in a process that is closed off, with the files of their shared memory."""


class WineEndedError(LibraryEndedError):
    """The program under Wine has ended."""


@cache
def proxy() -> Any:
    library = ctypes.CDLL(str(proxy_path()))
    library.wine_attach.argtypes = [ctypes.c_void_p, ctypes.c_int64]
    library.wine_attach.restype = None
    library.wine_ask.argtypes = [ctypes.c_void_p, ctypes.c_int]
    return library


class WineProgram:
    def __init__(self, library: Path, patience: float = 1e300, note: Note | None = None) -> None:
        self._folder: Path | None = None
        if wine.in_process:
            self._server = wine.in_process[0]
        else:
            self._folder = own_folder("wine")
            wine.prepare(self._folder)
            self._server = wine.Server(self._folder, tied=False)
        try:
            self._begin(patience)
            if note is not None:
                self.ask(ALLOCATE, 1)  # it answers as soon as Wine has started
                note("it is loaded")
            self.handle = self._load(library)
        except BaseException:
            self.close()
            raise

    def _begin(self, patience: float) -> None:
        if _idle:
            self._path, self._process = _idle.pop()
        else:
            self._path = self._server.next_shared()
            shared = f"Z:{self._path}".replace("/", "\\")
            self._process = self._server.start(host_path(), shared, str(os.getpid()))
        self._memory = self._shared(self._path)
        self._client = Client(box=self.address, peer=self._process.pid, patience=patience)

    def _shared(self, path: Path) -> mmap.mmap:
        assert mailbox_library().mailbox_size() <= wine.SHARED
        with path.open("r+b") as file:
            memory = mmap.mmap(file.fileno(), 0)
        self._head = ctypes.c_char.from_buffer(memory)
        self.address = ctypes.addressof(self._head)
        self._talk_at = mailbox_library().mailbox_offset(0)
        self._talk = _Talk.from_buffer(memory, self._talk_at)
        self._data = self._talk_at + ctypes.sizeof(_Talk)
        return memory

    def attach(self) -> None:
        proxy().wine_attach(self.address, self._process.pid)

    def ask(
        self, command: int, *arguments: int, data: bytes = b"", answer: int = 0
    ) -> tuple[int, bytes]:
        for k, value in enumerate(arguments):
            self._talk.a[k] = value
        self._memory[self._data : self._data + len(data)] = data
        status = proxy().wine_ask(ctypes.byref(self._client), command)
        if status == HUNG:
            raise WineEndedError("gives no answer")
        if status >= DIED:
            raise self._ended()
        return int(self._talk.result), bytes(self._memory[self._data : self._data + answer])

    def _ended(self) -> WineEndedError:
        try:
            code = self._process.wait(_TO_END)
        except subprocess.TimeoutExpired:
            code = 0
        if code in _FROM_OUTSIDE:
            name = signal.Signals(-code).name
            return WineEndedError(
                f"its process under Wine ends with {name}: something else ended it, such as the system for want of "
                "memory; try again",
                passing=True,
            )
        return WineEndedError(
            f"its process under Wine ends: {self._last_words() or 'it crashes or ends its own process'}"
        )

    def _last_words(self) -> str:
        """Last words of the program, in the mailbox's log: the crash."""
        at = mailbox_library().mailbox_offset(1)
        size = int.from_bytes(self._memory[at + 4 : at + 8], sys.byteorder)
        words = self._memory[at + 8 : at + 8 + min(max(size, 0), _WORDS)].split(b"\0")
        return words[2].decode("utf-8", "replace") if len(words) > 2 else ""

    def _load(self, library: Path) -> int:
        handle, _ = self.ask(LOAD, data=f"Z:{library}".encode() + b"\0")
        if not handle:
            code = int(self._talk.a[0])
            why = {
                126: "a library that it needs is missing",
                193: "it is for another processor or damaged",
            }.get(code)
            raise ValueError(
                f"Wine cannot load it: Windows error {code}{f' ({why})' if why else ''}"
            )
        return handle

    def close(self) -> None:
        """End the program and Wine's server; in a process that is closed off, keep it for the next library."""
        process: subprocess.Popen[bytes] | None = getattr(self, "_process", None)
        if (
            process is not None
            and self._folder is None
            and os.waitid(os.P_PID, process.pid, _ENDED) is None
        ):
            _idle.append((self._path, process))
        elif process is not None:
            process.kill()
            process.wait()
        self.__dict__.pop("_process", None)
        if self._folder is not None:
            self._server.close()
            remove(self._folder)
            self._folder = None


class WineLibrary:
    """A DLL for Windows under Wine, as `fmus.vendor_dll.memory.Library`."""

    def __init__(self, path: Path, note: Note = unheard) -> None:
        self._doing, self._note = "Wine starts", note
        try:
            self._program = WineProgram(path, note=self._now)
        except WineEndedError as error:
            raise self._with_name(error) from error
        self._functions: dict[str, int] = {}

    def _now(self, doing: str) -> None:
        self._doing = doing
        self._note(doing)

    def _with_name(self, error: WineEndedError) -> WineEndedError:
        if error.passing:
            return WineEndedError(f"while {self._doing}, {error}", passing=True)
        remedy = "ask its author for a DLL that does not"
        if self._doing.startswith("what"):
            remedy = "its structures are of another layout; ask its author for a DLL of the interface's layout"
        return WineEndedError(f"while {self._doing}, {error}; {remedy}")

    def _ask(
        self, command: int, *arguments: int, data: bytes = b"", answer: int = 0
    ) -> tuple[int, bytes]:
        try:
            return self._program.ask(command, *arguments, data=data, answer=answer)
        except WineEndedError as error:
            raise self._with_name(error) from error

    def _function(self, name: str) -> int:
        if name not in self._functions:
            self._functions[name] = self._ask(SYMBOL, data=name.encode() + b"\0")[0]
        return self._functions[name]

    def has(self, name: str) -> bool:
        return self._function(name) != 0

    def call(self, name: str, argument: int = 0) -> int:
        """Return what a function returns for one pointer, as 64 bits."""
        function = self._function(name)
        self._now(f"{name} runs")
        found = self._ask(CALL, function, argument)[0]
        self._now(f"what {name} returned is read")
        return found

    def read(self, address: int, size: int) -> bytes:
        return self._ask(READ, address, size, answer=size)[1]

    def text(self, address: int | None) -> bytes:
        """A text that ends with a zero; empty where there is none."""
        found = b""
        while address and b"\0" not in found:
            ahead = 64 - (address + len(found)) % 64  # what lies beyond may not be there
            found += self.read(address + len(found), ahead)
        return found.split(b"\0")[0]

    def write(self, address: int, content: bytes) -> None:
        self._ask(WRITE, address, len(content), data=content)

    def allocate(self, size: int) -> int:
        """Address of new memory, all zero, which is never given back."""
        return self._ask(ALLOCATE, size)[0]

    def regions(self) -> list[Region] | None:
        """Sections that may be written, by the table of the file's head."""
        base = self._program.handle
        head = self.read(base, 4096)
        at = int.from_bytes(head[60:64], "little")
        count = int.from_bytes(head[at + 6 : at + 8], "little")
        table = at + 24 + int.from_bytes(head[at + 20 : at + 22], "little")
        found = []
        for place in range(table, min(table + 40 * count, len(head) - 39), 40):
            size, start, flags = (
                int.from_bytes(head[place + k : place + k + 4], "little") for k in (8, 12, 36)
            )
            if flags & _WRITABLE:
                found.append((base, base + start, size))
        return found

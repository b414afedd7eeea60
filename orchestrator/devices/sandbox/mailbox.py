"""Shared memory between a process that runs an FMU and the one that calls it."""

import ctypes
import json
import mmap
import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.core.errors import InputError
from orchestrator.core.interrupts import calls
from orchestrator.core.options import Option
from orchestrator.devices.sandbox.compiled_programs import mailbox_path

_TEXT, _LOG = 1 << 24, 8192
MOST, ROOM = 16384, 1 << 18  # references of one question; numbers of a question for many steps
SET = 1
STEP = 2
GET = 4
TALK = 2
RUN = 3
OK = 0
# answers that no FMU gives; as in mailbox.c
DIED = 64
HUNG = 65
NOT_A_NUMBER = 66
INTERRUPTED = 67
TAMPERED = 68


class Head(ctypes.Structure):
    _fields_ = (
        ("request", ctypes.c_int32),
        ("reply", ctypes.c_int32),
        ("sleeping", ctypes.c_int32 * 2),
        ("kind", ctypes.c_int32),
        ("what", ctypes.c_int32),
        ("status", ctypes.c_int32),
        ("steps", ctypes.c_int32),
        ("time", ctypes.c_double),
        ("step", ctypes.c_double),
        ("n_set", ctypes.c_int64),
        ("n_get", ctypes.c_int64),
        ("text_length", ctypes.c_int64),
    )


class Client(ctypes.Structure):
    """``struct client``: what the asking side knows for itself, out of the other one's reach."""

    _fields_ = (
        ("box", ctypes.c_void_p),
        ("peer", ctypes.c_int64),
        ("patience", ctypes.c_double),
        ("n_set", ctypes.c_int64),
        ("n_get", ctypes.c_int64),
        ("number", ctypes.c_int32),
        ("bad_reference", ctypes.c_uint32),
        ("fresh", ctypes.c_uint32),
        ("get_references", ctypes.c_uint32 * MOST),
    )


class MailboxRun(ctypes.Structure):
    """Content of one question for many steps, behind the log in ``struct mailbox``."""

    _fields_ = (
        ("instance", ctypes.c_int64),
        ("n_steps", ctypes.c_int64),
        ("n_rows", ctypes.c_int64),
        ("n_in", ctypes.c_int64),
        ("n_out", ctypes.c_int64),
        ("n_network", ctypes.c_int64),
        ("n_late", ctypes.c_int64),
        ("done", ctypes.c_int64),
        ("stage", ctypes.c_int64),
    )


class Served(ctypes.Structure):
    """``struct served``: an instance that a process of several serves."""

    _fields_ = tuple(
        (name, ctypes.c_void_p) for name in ("component", "set_real", "get_real", "step")
    )


@cache
def mailbox_library() -> Any:
    """The compiled mailbox; its calls hold Python's lock, as those of an FMU in this process do."""
    try:
        library = ctypes.PyDLL(str(mailbox_path()))
    except (OSError, RuntimeError) as error:
        raise InputError(
            f"the mailbox to an FMU's own process is compiled, and {error}; if you trust "
            "the FMU, set isolated = false in the case and give " + Option.TRUST_FMUS
        ) from error
    address, size = ctypes.c_void_p, ctypes.c_size_t
    library.mailbox_size.restype = library.mailbox_offset.restype = library.client_size.restype = (
        size
    )
    library.mailbox_talk.argtypes = [address]
    library.mailbox_serve.argtypes = [address, ctypes.c_int64, *[address] * 4]
    library.mailbox_host.argtypes = [address, ctypes.c_int64, address, ctypes.c_int64]
    library.mailbox_answer.argtypes = [address, ctypes.c_int]
    library.mailbox_answer.restype = None
    library.mailbox_heed.argtypes = [address, address]
    library.mailbox_heed.restype = None
    library.mailbox_heed(
        ctypes.cast(ctypes.pythonapi.PyErr_CheckSignals, address), calls.asked_address
    )
    return library


@cache
def unlocked_library() -> Any:
    """Give those of the functions that ask without running an FMU here: they leave Python's lock to other threads."""
    library = ctypes.CDLL(mailbox_library()._name)
    library.mailbox_post.argtypes = [ctypes.c_void_p, ctypes.c_int32, ctypes.c_int32]
    library.mailbox_post.restype = None
    library.mailbox_wait.argtypes = [ctypes.c_void_p, ctypes.c_int32, ctypes.c_double]
    return library


def shared_memory(folder: Path) -> int | str:
    """Room for a mailbox that another process can map, and nobody can shrink: a descriptor, or a file where need be."""
    size = mailbox_library().mailbox_size()
    if not hasattr(os, "memfd_create"):
        path = folder / "mailbox"
        with path.open("wb") as file:
            file.truncate(size)
        return str(path)
    import fcntl  # noqa: PLC0415 - not on Windows

    memory = os.memfd_create("gfor_mailbox", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    os.ftruncate(memory, size)
    fcntl.fcntl(
        memory, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL
    )
    return memory


class Mailbox:
    def __init__(self, memory: int | str) -> None:
        self.library = mailbox_library()
        size = self.library.mailbox_size()
        if isinstance(memory, int):
            self._memory = mmap.mmap(memory, size)
        else:
            with open(memory, "r+b") as file:
                self._memory = mmap.mmap(file.fileno(), size)
        self.head = Head.from_buffer(self._memory)
        self.address = ctypes.addressof(self.head)
        self.client = Client(box=self.address)
        self._text, self._log, run, *arrays = (
            self.library.mailbox_offset(which) for which in range(6)
        )
        self.run = MailboxRun.from_buffer(self._memory, run)
        self._arrays = arrays

    def array(self, which: int, kind: Any, count: int) -> Any:
        """A view of shared memory: references that are set (0), that are read (1), room for their values (2)."""
        return np.frombuffer(self._memory, kind, count, self._arrays[which])

    def write_text(self, value: Any) -> None:
        content = json.dumps(value).encode()
        if len(content) > _TEXT:
            raise ValueError(f"{len(content)} bytes do not fit into the mailbox of {_TEXT} bytes")
        self._memory[self._text : self._text + len(content)] = content
        self.head.text_length = len(content)

    def read_text(self) -> Any:
        length = self.head.text_length
        if not 0 <= length <= _TEXT:
            raise ValueError("the length of the text is out of bounds")
        return _read(bytes(self._memory[self._text : self._text + length]))

    def write_log(self, messages: list[tuple[int, str]]) -> None:
        """Leave the newest messages where they outlive the process that wrote them."""
        kept = [(status, text[:500]) for status, text in messages[-8:]]
        while kept and len(content := json.dumps(kept).encode()) > _LOG - 1:
            kept.pop(0)
        content = json.dumps(kept).encode()
        self._memory[self._log : self._log + len(content) + 1] = content + b"\0"

    def read_log(self) -> list[tuple[int, str]]:
        """The newest messages of the other side; none where they cannot be read."""
        content = bytes(self._memory[self._log : self._log + _LOG]).split(b"\0")[0]
        try:
            return [(int(status), str(text)) for status, text in _read(content)]
        except (ValueError, TypeError, OverflowError):
            return []

    def clear_log(self) -> None:
        self._memory[self._log] = 0

    def question(self) -> int:
        """Have the other side do what the text says, and wait: a status of FMI's, or one that none gives."""
        return int(self.library.mailbox_talk(ctypes.addressof(self.client)))

    def function(self, name: str, *arguments: Any) -> Any:
        return ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.c_void_p, *arguments)((name, self.library))


def _read(content: bytes) -> Any:
    """A JSON value from a process that is not trusted."""
    try:
        return json.loads(content)
    except RecursionError:
        raise ValueError("it is nested too deep") from None

"""Calls of the Linux kernel for which Python has no function."""

import ctypes
import os
import platform
import signal
import sys
from functools import cache
from typing import Any

# flags of ``unshare`` and ``clone``, one for each namespace, from linux/sched.h
NEW_USER = 0x10000000
NEW_PROCESSES = 0x20000000
NEW_NETWORK = 0x40000000
NEW_MOUNTS = 0x00020000
NEW_IPC = 0x08000000

# flag of ``clone`` with which the new process is a child of the caller's parent, from linux/sched.h
_BESIDE = 0x00008000
_CLONE = {"x86_64": 56, "aarch64": 220}

# options of prctl, from linux/prctl.h
_DIES_WITH_PARENT = 1
_DROP_CAPABILITY = 24
_NO_NEW_PRIVILEGES = 38
_SUBREAPER = 36
_CAPABILITIES = 64  # more than any kernel has


@cache
def libc() -> Any:
    """The C library, whose `syscall` gives what the kernel returned."""
    library = ctypes.CDLL(None, use_errno=True)
    library.syscall.restype = ctypes.c_long
    return library


def call(number: int, *arguments: Any) -> int:
    found = int(libc().syscall(ctypes.c_long(number), *arguments))
    if found < 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))
    return found


def _check_result(found: int) -> None:
    if found:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))


def on_known_machine() -> bool:
    """Return whether this is Linux on a processor whose system calls are known here, with 64-bit Python."""
    return (
        sys.platform == "linux"
        and platform.machine() in ("x86_64", "aarch64")
        and sys.maxsize > 2**32
    )


def copy_beside() -> int:
    """Copy this process like `os.fork`, but as a child of its parent: that one waits for the copy, this one cannot.

    For a process with one thread; nothing that was registered for a fork is called. Python's lock is kept meanwhile."""
    library = ctypes.PyDLL(None, use_errno=True)
    library.syscall.restype = ctypes.c_long
    flags = ctypes.c_ulong(_BESIDE | signal.SIGCHLD)
    found = int(library.syscall(ctypes.c_long(_CLONE[platform.machine()]), flags, *[None] * 4))
    if found < 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))
    return found


def unshare(flags: int) -> None:
    _check_result(libc().unshare(flags))


def mount(
    source: str | None, target: str, kind: str | None, flags: int = 0, data: str | None = None
) -> None:
    texts = [None if text is None else os.fsencode(text) for text in (source, target, kind, data)]
    _check_result(libc().mount(texts[0], texts[1], texts[2], ctypes.c_ulong(flags), texts[3]))


def die_with_parent(number: int) -> None:
    """Have the kernel send a signal to this process when the thread that made it ends."""
    libc().prctl(_DIES_WITH_PARENT, ctypes.c_ulong(number), 0, 0, 0)


def end_with_starter() -> None:
    """Have this process ended by the kernel where the thread that started it ends, which waits for it; on Linux."""
    if sys.platform == "linux":
        die_with_parent(signal.SIGKILL)


def adopt_orphans() -> bool:
    """Become the parent of every descendant whose own parent ends."""
    return sys.platform == "linux" and not libc().prctl(_SUBREAPER, ctypes.c_ulong(1), 0, 0, 0)


def no_new_privileges() -> None:
    """Give up what set-uid programs would grant; Landlock and seccomp ask for it."""
    _check_result(libc().prctl(_NO_NEW_PRIVILEGES, ctypes.c_ulong(1), 0, 0, 0))


def drop_capabilities() -> None:
    for number in range(_CAPABILITIES):
        libc().prctl(_DROP_CAPABILITY, ctypes.c_ulong(number), 0, 0, 0)
    header = (ctypes.c_uint32 * 2)(0x20080522, 0)
    _check_result(libc().capset(header, (ctypes.c_uint32 * 6)()))

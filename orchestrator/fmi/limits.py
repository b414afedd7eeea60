"""What a process that runs a foreign FMU may take and touch; called once, in that process, before the FMU is loaded.

On Linux memory and written files are limited by the kernel, and writing outside of one folder is refused by Landlock
where the kernel has it (5.13 and later). Reading and the network are not limited. On macOS there is no Landlock, and on
Windows none of these: there, only time is limited, from outside.
"""

import contextlib
import ctypes
import os
import signal
import struct
import sys
from dataclasses import dataclass
from pathlib import Path

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_WRITING = 0b1_1111_1111_0010
"""Landlock's rights to write, remove and make files, folders, devices, sockets, pipes and links (ABI 1)."""
_REFER, _TRUNCATE = 1 << 13, 1 << 14
_PATH_BENEATH = 1
_NO_NEW_PRIVILEGES = 38

TO_BEGIN = 60.0
"""Wall-clock time for a process to begin, before it comes to the FMU [s]: on a busy machine that is not the FMU's."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a foreign FMU.

    Attributes
    ----------
    seconds
        Wall-clock time for one call.
    memory
        Address space beyond what the process has before the FMU is loaded [bytes].
    output
        Largest file that it may write, its standard output included [bytes].
    messages
        Log messages in one call after which it counts as flooded.
    """

    seconds: float = 30.0
    memory: int = 4 * 1024**3
    output: int = 16 * 1024**2
    messages: int = 20_000


def apply_limits(limits: Limits, folder: Path) -> list[str]:
    """Limit this process; returns in words what could not be limited.

    Parameters
    ----------
    folder
        The only folder in which it may still write.
    """
    os.chdir(folder)
    for name in ("TMPDIR", "TEMP", "TMP", "HOME"):
        os.environ[name] = str(folder)
    if sys.platform == "win32":
        return ["memory", "files"]
    import resource  # noqa: PLC0415 - not on Windows

    missing = []
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)  # Python ignores it; an FMU that floods a file must end
    _lower(resource.RLIMIT_CORE, 0)
    _lower(resource.RLIMIT_FSIZE, limits.output)
    now = _address_space()
    if now is None or not _lower(resource.RLIMIT_AS, now + limits.memory):
        missing.append("memory")
    if not _forbid_writing_outside(folder):
        missing.append("files")
    return missing


def _lower(kind: int, value: int) -> bool:
    import resource  # noqa: PLC0415 - not on Windows

    hard = resource.getrlimit(kind)[1]
    value = value if hard == resource.RLIM_INFINITY else min(value, hard)
    try:
        resource.setrlimit(kind, (value, value))
    except (ValueError, OSError):
        return False
    return True


def _address_space() -> int | None:
    try:
        import resource  # noqa: PLC0415 - not on Windows

        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    except OSError:
        return None


def _forbid_writing_outside(folder: Path) -> bool:
    """Landlock: from here on this process makes and changes files in one folder only; False where it is not there."""
    if sys.platform != "linux":
        return False
    libc = ctypes.CDLL(None, use_errno=True)
    libc.syscall.restype = ctypes.c_long
    abi = libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), 1)
    if abi < 1:
        return False
    rights = _WRITING | (_REFER if abi >= 2 else 0) | (_TRUNCATE if abi >= 3 else 0)
    handled = ctypes.create_string_buffer(struct.pack("<Q", rights), 8)
    ruleset = libc.syscall(_CREATE_RULESET, handled, ctypes.c_size_t(8), 0)
    if ruleset < 0:
        return False
    try:
        allowed = (folder, Path(os.devnull))
        for path, wanted in zip(allowed, (rights, rights & (_TRUNCATE | 0b10)), strict=True):
            with contextlib.suppress(OSError):
                opened = os.open(path, os.O_PATH | os.O_CLOEXEC)
                rule = ctypes.create_string_buffer(struct.pack("<Qi", wanted, opened), 12)
                libc.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, rule, 0)
                os.close(opened)
        if libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0):
            return False
        return bool(libc.syscall(_RESTRICT_SELF, ruleset, 0) == 0)
    finally:
        os.close(ruleset)

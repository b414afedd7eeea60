"""Landlock: from a moment on, a process and all that it starts open nothing but the files that they were granted.

Which rights there are depends on the kernel: files since 5.13, TCP since 6.7, signals and abstract sockets since 6.12.
It binds the thread that asks and those it starts later, so it comes before there is a second one."""

import contextlib
import os
import struct
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from orchestrator.fmi.linux import call, no_new_privileges

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_ASK_VERSION, _PATH_BENEATH = 1, 1

_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_FOLDER = 1 << 0, 1 << 1, 1 << 2, 1 << 3
_ALL_OF_FIRST = (1 << 13) - 1
_REFER, _TRUNCATE, _DEVICE_CONTROL = 1 << 13, 1 << 14, 1 << 15
_OF_A_FILE = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE | _DEVICE_CONTROL
_TCP = 0b11  # to bind and to connect
_SCOPES = 0b11  # abstract UNIX sockets and signals reach only what is bound likewise


def landlock_version() -> int:
    """Of the kernel's interface; 0 where there is none."""
    if sys.platform != "linux":
        return 0
    try:
        return call(_CREATE_RULESET, None, 0, _ASK_VERSION)
    except OSError:
        return 0


def _rights(version: int) -> int:
    newer = ((2, _REFER), (3, _TRUNCATE), (5, _DEVICE_CONTROL))
    return _ALL_OF_FIRST | sum(right for since, right in newer if version >= since)


def restrict(readable: Iterable[Path], writable: Sequence[Path]) -> None:
    """Bind this thread, and what it starts, for good."""
    version = landlock_version()
    everything = _rights(version)
    asked = struct.pack("<QQQ", everything, _TCP if version >= 4 else 0, _SCOPES if version >= 6 else 0)
    asked = asked[: 8 if version < 4 else 16 if version < 6 else 24]
    ruleset = call(_CREATE_RULESET, asked, len(asked), 0)
    try:
        for path in readable:
            _grant(ruleset, path, _EXECUTE | _READ_FILE | _READ_FOLDER)
        for path in writable:
            _grant(ruleset, path, everything)
        no_new_privileges()
        call(_RESTRICT_SELF, ruleset, 0)
    finally:
        os.close(ruleset)


def _grant(ruleset: int, path: Path, rights: int) -> None:
    with contextlib.suppress(FileNotFoundError, NotADirectoryError, PermissionError):
        opened = os.open(path, os.O_PATH | os.O_CLOEXEC)
        try:
            wanted = rights if path.is_dir() else rights & _OF_A_FILE
            call(_ADD_RULE, ruleset, _PATH_BENEATH, struct.pack("<Qi", wanted, opened), 0)
        finally:
            os.close(opened)

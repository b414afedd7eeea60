"""Namespaces of Linux: a process in them sees other processes, other network devices and other mounts than its parent.

An ordinary user makes them together with a user namespace, which some systems and containers forbid. Then there are
none, and the other protections stand alone."""

import contextlib
import os
import struct
from collections.abc import Iterable
from pathlib import Path

from orchestrator.fmi.linux import NEW_IPC, NEW_MOUNTS, NEW_NETWORK, NEW_PROCESSES, NEW_USER, call, mount, unshare

_MOUNT_SETATTR, _HERE, _RECURSIVE, _READ_ONLY = 442, -100, 0x8000, 0x1
_PRIVATE, _ALL_BELOW = 1 << 18, 1 << 14
_NO_SETUID, _NO_DEVICES = 0x2, 0x4
_FEWEST_NUMBERS = 301  # the smallest number of process numbers that the kernel lets a namespace have
_MOST_FILES = 4096
_SHARED = 16 * 1024**2
"""What memory shared by name may come to [bytes]; it lies outside of the folder, and counts for no process."""


def enter_namespaces() -> None:
    """Go into new namespaces: users, network and System V's objects for this process, processes for its children."""
    user, group = os.geteuid(), os.getegid()
    unshare(NEW_USER | NEW_PROCESSES | NEW_NETWORK | NEW_IPC)
    own = Path("/proc/self")
    (own / "setgroups").write_text("deny", encoding="ascii")
    (own / "uid_map").write_text(f"{user} {user} 1", encoding="ascii")
    (own / "gid_map").write_text(f"{group} {group} 1", encoding="ascii")


def mount_read_only(folder: Path, size: int, more: Iterable[Path] = ()) -> list[str]:
    """Have a view of all files of one's own, where only a folder in memory can be changed.

    ``folder``: where that folder is put, empty.
    ``size``: what it may hold [bytes].
    ``more``: folders in whose place there is an empty one in memory as well."""
    unshare(NEW_MOUNTS)
    mount(None, "/", None, _PRIVATE | _ALL_BELOW)
    sizes = {folder: size, Path("/dev/shm"): min(size, _SHARED)} | dict.fromkeys(more, min(size, _SHARED))
    own = [path for path in sizes if path.is_dir()]
    for path in own:
        options = f"size={sizes[path]},nr_inodes={_MOST_FILES},mode=0700"
        mount("tmpfs", str(path), "tmpfs", _NO_SETUID | _NO_DEVICES, options)
    missing = []
    try:
        mount("proc", "/proc", "proc", _NO_SETUID | _NO_DEVICES)
        with contextlib.suppress(OSError):  # since 6.14 each namespace has numbers of its own
            Path("/proc/sys/kernel/pid_max").write_text(str(_FEWEST_NUMBERS), encoding="ascii")
    except OSError:  # a container that hides a part of /proc forbids it
        missing.append("processes")
    try:
        _set_attributes(Path("/"), _RECURSIVE, _READ_ONLY, 0)
        for path in own:
            _set_attributes(path, 0, 0, _READ_ONLY)
    except OSError:  # before 5.12
        missing.append("files")
    return missing


def _set_attributes(path: Path, flags: int, on: int, off: int) -> None:
    call(_MOUNT_SETATTR, _HERE, os.fsencode(path), flags, struct.pack("<QQQQ", on, off, 0, 0), 32)

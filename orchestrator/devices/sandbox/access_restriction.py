"""Confinement of the process of a foreign FMU: closed once, by itself, before it has a second thread or any library.

Several means of Linux overlap: namespaces (`namespaces`), Landlock, a filter of system calls (`system_call_filter`),
and no capabilities. Each is used where the machine has it; `protections` says what they come to.

Under Landlock a process and all that it starts open nothing but the files that they were granted. Which rights there
are depends on the kernel: files since 5.13, TCP since 6.7, signals and abstract sockets since 6.12. It binds the thread
that asks and those it starts later."""

import contextlib
import os
import struct
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.devices.sandbox import protections_in_force, wine
from orchestrator.devices.sandbox.kernel_calls import (
    call,
    drop_capabilities,
    no_new_privileges,
    on_known_machine,
)
from orchestrator.devices.sandbox.system_call_filter import filter_calls

# numbers of Landlock's system calls, from linux/unistd.h: the same on all architectures since Linux 5.13
_CREATE_RULESET = 444
_ADD_RULE = 445
_RESTRICT_SELF = 446
_ASK_VERSION = 1  # flag LANDLOCK_CREATE_RULESET_VERSION
_PATH_BENEATH = 1  # kind LANDLOCK_RULE_PATH_BENEATH

_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_FOLDER = 1 << 0, 1 << 1, 1 << 2, 1 << 3
_ALL_OF_FIRST = (1 << 13) - 1
_REFER, _TRUNCATE, _DEVICE_CONTROL = 1 << 13, 1 << 14, 1 << 15
_OF_A_FILE = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE | _DEVICE_CONTROL
_TCP = 0b11  # to bind and to connect
_SCOPES = 0b11  # abstract UNIX sockets and signals reach only what is bound likewise


def landlock_version() -> int:
    """Ask for the version of the kernel's interface; 0 if there is none."""
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
    asked = struct.pack(
        "<QQQ", everything, _TCP if version >= 4 else 0, _SCOPES if version >= 6 else 0
    )
    known = 16 if version < 6 else 24  # bytes of the structure that this version of Landlock reads
    asked = asked[: 8 if version < 4 else known]
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


# means that can be left out one by one: tests try each alone
LAYERS = ("namespaces", "landlock", "seccomp")

_SYSTEM = (
    "/usr",
    "/lib",
    "/lib32",
    "/lib64",
    "/bin",
    "/sbin",
    "/opt",
    "/etc/ld.so.cache",
    "/etc/ld.so.conf",
    "/etc/ld.so.conf.d",
    "/etc/alternatives",
    "/etc/localtime",
    "/etc/timezone",
    "/sys/devices/system",
    "/nix/store",
    "/gnu/store",
    "/dev/zero",
    "/dev/full",
    "/dev/random",
    "/dev/urandom",
)
"""What programs and libraries read; nothing of a user's."""

_OF_THE_KERNEL = (
    "/proc/self",
    "/proc/cpuinfo",
    "/proc/meminfo",
    "/proc/stat",
    "/proc/filesystems",
    "/proc/sys/vm",
    "/proc/sys/kernel/osrelease",
)


@dataclass
class Means:
    # empty where they are, else why not; likewise ``landlock`` and ``seccomp``
    namespaces: str = "not tried"
    own_processes: bool = False  # whether /proc shows its own processes only
    # whether it sees every folder but its own read-only, with a limit on the size of its own
    read_only: bool = False
    version: int = 0
    landlock: str = "not tried"
    seccomp: str = "not tried"
    supervised: bool = False  # whether another process watches over its end


def confine(
    means: Means,
    layers: Sequence[str],
    work: Path,
    readable: Iterable[Path],
    *,
    windows: bool = False,
) -> None:
    """Close this process off; ``means`` is completed.

    ``means``: what is in force already.
    ``layers``: which of `LAYERS` may be used.
    ``work``: the folder in which it may write.
    ``readable``: what it may read beside the system's libraries and Python's own folders.
    ``windows``: whether the FMU is for Windows: Wine's server (`wine`) is started here, with what is in force by then.
    """
    if sys.platform != "linux":
        means.landlock = means.seccomp = f"{sys.platform} has none"
        return
    no_new_privileges()
    means.version = landlock_version()
    outside = wine.prepare(work) if windows else []
    means.landlock = _tried("landlock" in layers, lambda: _restrict(means, work, readable, outside))
    if means.landlock:
        means.version = 0
    drop_capabilities()
    if windows:
        wine.in_process.append(wine.Server(work, tied=True, programs=wine.PROGRAMS))
    means.seccomp = _tried(
        "seccomp" in layers and on_known_machine(),
        lambda: filter_calls(
            attributes=not means.read_only,
            ipc=bool(means.namespaces),
            own_process=os.getpid() if means.namespaces else None,
            signals=means.version < 6,
        ),
    )


def confine_alone(work: Path, readable: Iterable[Path], *, windows: bool = False) -> None:
    """Close this process off, which nobody watches over and which tells nobody what is in force.

    Raises
    ------
    InputError
        If a library brought a second thread before: Landlock would not bind it.
    """
    if sys.platform == "linux" and has_threads():
        raise InputError(
            "the process for a DLL had a second thread before it closed itself off, so the DLL was not loaded; "
            "what Python imports at its start (sitecustomize, usercustomize, a .pth file) may begin no thread"
        )
    confine(Means(), LAYERS, work, readable, windows=windows)


def has_threads() -> bool:
    """Return whether this process has a second thread."""
    return len(os.listdir("/proc/self/task")) > 1


def _tried(wanted: bool, means: Callable[[], None]) -> str:
    """Why a means is not in force; empty where it is."""
    if not wanted:
        return "left out, or unknown on this processor"
    try:
        means()
    except OSError as error:
        return f"the kernel refuses: {error.strerror}"
    return ""


def _restrict(means: Means, work: Path, readable: Iterable[Path], more: Sequence[Path]) -> None:
    if has_threads():
        raise OSError(0, "there is a second thread already")
    proc = ["/proc"] if means.own_processes else list(_OF_THE_KERNEL)
    own = [Path("/dev/shm")] if means.read_only else []
    restrict(
        [*map(Path, [*_SYSTEM, *proc]), *python_folders(), *readable],
        [work, Path(os.devnull), *own, *more],
    )


def python_folders() -> list[Path]:
    """Where Python and its packages are, the user's home folder itself and what is above it left out."""
    home = Path(os.environ.get("HOME") or "/").resolve()
    named = [
        sys.prefix,
        sys.base_prefix,
        sys.exec_prefix,
        *sys.path,
        *os.environ.get("LD_LIBRARY_PATH", "").split(":"),
    ]
    found = {Path(name).resolve() for name in named if name and os.path.isabs(name)}
    for package in ("orchestrator", "fmus"):  # installed for development, they may lie anywhere
        spec = find_spec(package)
        found |= {
            Path(place).resolve() for place in (spec and spec.submodule_search_locations) or ()
        }
    return sorted(path for path in found if path != home and path not in home.parents)


def protections(
    means: Means, lacking: Iterable[str]
) -> tuple[protections_in_force.Protection, ...]:
    spaces, filtered, linux = not means.namespaces, not means.seccomp, sys.platform == "linux"
    landlock, files = means.landlock or "", "read-only mounts"
    no_spaces = f"no namespaces: {means.namespaces}"
    no_landlock = f"no Landlock: {landlock}"

    def first(*ways: tuple[bool, str], otherwise: str) -> tuple[bool, str]:
        used = [name for there, name in ways if there]
        return bool(used), " and ".join(used) if used else otherwise

    found = {
        protections_in_force.END: first(
            (spaces and means.supervised, "a process namespace"),
            (not spaces and means.supervised and linux, "a supervisor that adopts orphans"),
            (means.supervised and not linux, "a supervisor, for its process group only"),
            otherwise="nobody watches over it",
        ),
        protections_in_force.PROCESSES: first(
            (spaces, "a process namespace"),
            (means.version >= 6, "Landlock"),
            (filtered and not spaces and means.version < 6, "a filter of system calls"),
            otherwise=no_spaces,
        ),
        protections_in_force.NETWORK: first(
            (filtered, "a filter of system calls"),
            otherwise=(
                f"sockets of a path only are left open; {means.seccomp}"
                if spaces
                else f"no filter: {means.seccomp}"
            ),
        ),
        protections_in_force.WRITING: first(
            (not landlock, "Landlock"), (means.read_only, files), otherwise=no_landlock
        ),
        protections_in_force.ATTRIBUTES: first(
            (means.read_only, files),
            (filtered and not means.read_only, "a filter of system calls"),
            otherwise=no_spaces,
        ),
        protections_in_force.READING: first((not landlock, "Landlock"), otherwise=no_landlock),
        protections_in_force.ENVIRONMENT: (True, "a new environment"),
        protections_in_force.MEMORY: first(
            (True, "a limit for each process"),
            (linux and means.supervised, "a watch over their sum"),
            otherwise="",
        ),
        protections_in_force.DISK: first(
            (True, "a limit for each file"),
            (means.read_only, "a folder in memory of limited size"),
            (linux and means.supervised and not means.read_only, "a watch over their sum"),
            otherwise="",
        ),
        protections_in_force.TASKS: first(
            (spaces, "limits of its namespaces"),
            (linux and means.supervised, "a watch"),
            otherwise="nothing on this system limits it",
        ),
        protections_in_force.CPU: (True, "a limit for each process"),
    }
    found |= dict.fromkeys(lacking, (False, "this system does not limit it"))
    return protections_in_force.in_order(
        protections_in_force.Protection(name, *said) for name, said in found.items()
    )

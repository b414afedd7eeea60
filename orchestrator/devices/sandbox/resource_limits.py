"""Limits of a process that runs a foreign FMU; called once, in that process, before the FMU is loaded.

These are the limits that the kernel keeps for each process. Those on all of an FMU's processes together are kept by
`supervisor`, what they may touch by `access_restriction`. On Windows, only time and messages are limited."""

import os
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

from orchestrator.devices.sandbox.protections_in_force import CPU, DISK, MEMORY, TASKS

_OUR_TASKS = 3  # processes of ours around an FMU that count as its own
# timers and queued signals, which the kernel counts for the whole user
_TIMERS = 1024
# wall-clock time for a process to begin [s], before the FMU: a busy machine is not its fault
TO_BEGIN = 60.0
# with less [MB] the worker itself cannot load an FMU and answer; another unit was meant
LEAST_MEMORY = 32.0

TOO_MUCH_MEMORY = 93
TOO_MANY_TASKS = 94
TOO_MUCH_DISK = 95
"""Exit codes of a supervisor that ended an FMU's processes for what they took together."""
FLOODED = 97  # exit code of a process whose FMU logs without end


def crowded() -> float:
    """How many programs want to run for each processor, 1 to 8: so many times later an FMU may answer."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    return min(8.0, max(1.0, load / (os.cpu_count() or 1)))


@dataclass(frozen=True, slots=True)
class Limits:
    seconds: float = 30.0  # wall-clock time for one call; in acceptance tests times `crowded`
    # address space of one process beyond what it has before the FMU is loaded, and memory that all its processes
    # together have in use [bytes]
    memory: int = 4 * 1024**3
    # largest file that it may write, its standard output included [bytes]
    output: int = 16 * 1024**2
    messages: int = 20_000  # log messages in one call after which it counts as flooded
    disk: int = 256 * 1024**2  # all files in its folder together [bytes]
    tasks: int = 128  # processes and threads that it may have at the same time
    cpu: float = 7 * 86_400.0  # processor time that one of its processes may take [s]


def apply_limits(limits: Limits, folder: Path, *, own_users: bool) -> list[str]:
    """Limit this process and what it starts; returns the names of limits that the system does not have."""
    os.chdir(folder)
    for name in ("TMPDIR", "TEMP", "TMP", "HOME", "USERPROFILE"):
        os.environ[name] = str(folder)
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "GFOR_COSIM_CACHE"):
        os.environ.pop(name, None)
    if sys.platform == "win32":
        return [MEMORY, DISK, TASKS, CPU]
    import resource  # noqa: PLC0415 - not on Windows

    for excess in (signal.SIGXFSZ, signal.SIGXCPU):
        # Python ignores the first; an FMU that floods a file must end
        signal.signal(excess, signal.SIG_DFL)
    _lower(resource.RLIMIT_CORE, 0)
    lacking = []
    if own_users:
        _lower(resource.RLIMIT_NPROC, limits.tasks + _OUR_TASKS)
        if sys.platform == "linux":
            _lower(resource.RLIMIT_SIGPENDING, _TIMERS)
    if not _lower(resource.RLIMIT_CPU, int(limits.cpu)):
        lacking.append(CPU)
    if not _lower(resource.RLIMIT_FSIZE, limits.output):
        lacking.append(DISK)
    now = _address_space()
    if now is None or not _lower(resource.RLIMIT_AS, now + limits.memory):
        lacking.append(MEMORY)
    return lacking


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

        return (
            int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
            * resource.getpagesize()
        )
    except OSError:
        return None

"""The process between gfor and a foreign FMU: it closes the FMU's process off, watches over it, and ends with gfor.

Three processes stand in a row. The *supervisor* is what gfor starts; it waits for gfor's word or end. The *keeper* is
the first process of the FMU's own process namespace, where there is one: with it all others there end, whatever they
did to hide. The *worker* alone has the FMU's code in it. An ordinary user makes namespaces together with a user
namespace, which some systems and containers forbid: then there are none, and the other protections stand alone.

No library but Python's own is imported here: the worker closes itself off before numpy brings threads. A supervisor
that is a copy of a template (`template`) has numpy already, and has no threads."""

import contextlib
import importlib
import json
import os
import select
import signal
import struct
import sys
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, NoReturn

from fmus.toolchain.removal import remove_tree
from orchestrator.devices.sandbox import kernel_calls, wine
from orchestrator.devices.sandbox.access_restriction import Means, confine
from orchestrator.devices.sandbox.process_tree import (
    descendants,
    end_descendants,
    size_of,
    size_of_removed,
    started_by_fmu,
    usage,
)
from orchestrator.devices.sandbox.resource_limits import (
    TOO_MANY_TASKS,
    TOO_MUCH_DISK,
    TOO_MUCH_MEMORY,
    Limits,
)

_MOUNT_SETATTR, _HERE, _RECURSIVE, _READ_ONLY = 442, -100, 0x8000, 0x1
_PRIVATE, _ALL_BELOW = 1 << 18, 1 << 14
_NO_SETUID = 0x2
_NO_DEVICES = 0x4
# the smallest number of process numbers that the kernel lets a namespace have
_FEWEST_NUMBERS = 301
_MOST_FILES = 4096
# most that memory shared by name comes to [bytes]: outside of the folder, and of no process
_SHARED = 16 * 1024**2


def enter_namespaces() -> None:
    """Go into new namespaces: users, network and System V's objects for this process, processes for its children."""
    user, group = os.geteuid(), os.getegid()
    kernel_calls.unshare(
        kernel_calls.NEW_USER
        | kernel_calls.NEW_PROCESSES
        | kernel_calls.NEW_NETWORK
        | kernel_calls.NEW_IPC
    )
    own = Path("/proc/self")
    (own / "setgroups").write_text("deny", encoding="ascii")
    (own / "uid_map").write_text(f"{user} {user} 1", encoding="ascii")
    (own / "gid_map").write_text(f"{group} {group} 1", encoding="ascii")


def mount_read_only(folder: Path, size: int, more: Iterable[Path] = ()) -> list[str]:
    """Have a view of all files of one's own, where only a folder in memory can be changed.

    ``folder``: where that folder is put, empty.
    ``size``: what it may hold [bytes].
    ``more``: folders in whose place there is an empty one in memory as well."""
    kernel_calls.unshare(kernel_calls.NEW_MOUNTS)
    kernel_calls.mount(None, "/", None, _PRIVATE | _ALL_BELOW)
    sizes = {folder: size, Path("/dev/shm"): min(size, _SHARED)} | dict.fromkeys(
        more, min(size, _SHARED)
    )
    own = [path for path in sizes if path.is_dir()]
    for path in own:
        options = f"size={sizes[path]},nr_inodes={_MOST_FILES},mode=0700"
        kernel_calls.mount("tmpfs", str(path), "tmpfs", _NO_SETUID | _NO_DEVICES, options)
    missing = []
    try:
        kernel_calls.mount("proc", "/proc", "proc", _NO_SETUID | _NO_DEVICES)
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
    kernel_calls.call(
        _MOUNT_SETATTR, _HERE, os.fsencode(path), flags, struct.pack("<QQQQ", on, off, 0, 0), 32
    )


_LOOK = 100  # time after which it is looked what the FMU's processes take [ms]
# memory that the worker may have in use before the FMU is loaded [bytes]; it takes some 100 MB
_OURS = 256 * 1024**2
_LINUX = sys.platform == "linux"


def main(request: dict[str, Any]) -> None:
    """Supervise the worker that a request names; on Windows, be it."""
    means, work = Means(), Path(request["folder"]) / "work"
    if sys.platform == "win32":
        means.namespaces = means.landlock = means.seccomp = "Windows has none"
        _work(request, means)
    if os.getppid() != request["parent"]:  # it ended before this process could look
        _exit()
    means.supervised = True
    means.namespaces = "left out"
    if "namespaces" in request["layers"]:
        means.namespaces = _entered()
    kernel_calls.adopt_orphans()
    told, tell = os.pipe()
    alive, living = os.pipe()
    keeper = os.fork()
    if not keeper:
        os.close(told)
        os.close(living)
        _keep(request, means, work, tell, alive)
    os.close(tell)
    os.close(alive)
    _supervise(request, told, work, means)


def _exit(code: int = 0) -> NoReturn:
    os._exit(code)


def _entered() -> str:
    """Why this process is not in namespaces of its own; empty where it is."""
    if not _LINUX:
        return f"{sys.platform} has none"
    try:
        enter_namespaces()
    except OSError as error:
        return f"the system forbids user namespaces ({error.strerror})"
    return ""


def _supervise(request: dict[str, Any], told: int, work: Path, means: Means) -> NoReturn:
    limits, me = Limits(**request["limits"]), os.getpid()
    poll = select.poll()
    poll.register(0, select.POLLIN)
    poll.register(told, select.POLLIN)
    while True:
        ready = [descriptor for descriptor, _ in poll.poll(_LOOK)]
        if told in ready:
            word = os.read(told, 4)
            end_descendants(me)
            _end_as(struct.unpack("<i", word)[0] if len(word) == 4 else -signal.SIGKILL)
        orphan = os.getppid() != request["parent"]
        if orphan or 0 in ready:
            end_descendants(me)
            if orphan or not os.read(0, 1):  # nobody is left to do it
                remove_tree(Path(request["folder"]))
            if not _LINUX:
                os.killpg(os.getpgrp(), signal.SIGKILL)
            _end_as(-signal.SIGKILL)
        if _LINUX and not request["windows"]:
            _make_idle(started_by_fmu(me))
        excess = _excess(limits, me, work)
        if excess:
            end_descendants(me)
            _exit(excess)


def _make_idle(processes: Iterable[int]) -> None:
    """Let processes that an FMU started run only while nobody else wants to; what they start inherits it.

    The worker keeps its priority: gfor waits for each of its answers, and no longer than its limit."""
    for process in processes:
        with contextlib.suppress(OSError):
            if os.sched_getscheduler(process) != os.SCHED_IDLE:
                os.sched_setscheduler(process, os.SCHED_IDLE, os.sched_param(0))


def _excess(limits: Limits, process: int, work: Path) -> int:
    """Exit code that names what all processes together take too much of; 0 for nothing."""
    if not _LINUX:
        return 0
    most = limits.memory + _OURS
    theirs = descendants(process)[1:]  # the keeper comes first, and is ours
    used = usage(theirs, most)
    if used.memory > most:
        return TOO_MUCH_MEMORY
    if used.tasks > limits.tasks:
        return TOO_MANY_TASKS
    size = size_of(work, limits.disk)
    if size <= limits.disk:
        size += size_of_removed(theirs, limits.disk - size)
    return TOO_MUCH_DISK if size > limits.disk else 0


def _end_as(status: int) -> NoReturn:
    """End as the worker did: with its exit code, or by its signal."""
    if status < 0:
        with contextlib.suppress(OSError, ValueError):
            signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
        signal.pause()
    _exit(status)


def _keep(request: dict[str, Any], means: Means, work: Path, tell: int, alive: int) -> NoReturn:
    """Start the worker, reap all that ends, tell how the worker ended, and end with it."""
    if _LINUX:
        kernel_calls.die_with_parent(signal.SIGKILL)
        if select.select([alive], [], [], 0)[0]:  # the supervisor ended before that
            _exit()
    _attach(Path(os.devnull), 0)
    if not means.namespaces:
        try:
            sockets = wine.socket_bases() if request["windows"] else []
            lacking = mount_read_only(work, int(request["limits"]["disk"]), sockets)
            means.read_only, means.own_processes = (
                "files" not in lacking,
                "processes" not in lacking,
            )
        except OSError:
            pass  # `confine` knows what that leaves open
    kernel_calls.adopt_orphans()
    me = os.getpid()
    worker = os.fork()
    if not worker:
        os.close(tell)
        os.close(alive)
        if _LINUX:
            kernel_calls.die_with_parent(signal.SIGKILL)
            if os.getppid() != me:
                _exit()
        _work(request, means)
    while True:
        ended, status = os.waitpid(-1, 0)
        if ended == worker:
            code = os.waitstatus_to_exitcode(status)
            end_descendants(me)
            os.write(tell, struct.pack("<i", code))
            _exit()


def _attach(path: Path, descriptor: int) -> None:
    opened = os.open(path, os.O_RDONLY)
    os.dup2(opened, descriptor)
    os.close(opened)


def _work(request: dict[str, Any], means: Means) -> NoReturn:
    """Close this process off and do what gfor asks."""
    folder = Path(request["folder"])
    readable = map(Path, request["readable"])
    confine(means, request["layers"], folder / "work", readable, windows=request["windows"])
    request["means"] = asdict(means)
    importlib.import_module(request["worker"]).main(request)
    _exit()


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))

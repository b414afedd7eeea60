"""A supervisor that is a copy of a template (`template`): started in milliseconds, and seen like any child process."""

import atexit
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, ClassVar

from orchestrator.devices.sandbox.kernel_calls import on_known_machine
from orchestrator.devices.sandbox.resource_limits import TO_BEGIN

_LOOK = 0.05  # longest time [s] after which it is looked whether a process has ended
_SHORTEST_LOOK = 0.0005  # the first such time [s]
_PATIENCE = 5.0  # time for a template to end once nobody can ask it any more [s]
_LONGEST_NUMBER = 20  # digits of a process's number
_MOST = 4  # templates at the same time: one for each environment and standing
_INHERITED_STATUS = (
    *("Umask:", "Uid:", "Gid:", "Groups:", "SigBlk:", "SigIgn:", "Cap", "NoNewPrivs:"),
    *("Seccomp", "Cpus_allowed:", "Mems_allowed:"),
)
"""How the lines of /proc/PID/status begin that a program has from the process that starts it."""
_INHERITED_FILES = ("limits", "oom_score_adj", "cgroup")
"""Files of /proc/PID with more of that."""


def standing() -> tuple[str, ...]:
    """Return rights, limits, priority and namespaces that a program has which this process starts now.

    A template that began with another standing is not copied, or an FMU would have what gfor has given up. A
    restriction by Landlock alone cannot be seen: an ordinary user's comes with NoNewPrivs, which can."""
    own, spaces = Path("/proc/thread-self"), Path("/proc/self/ns")
    status = (own / "status").read_text(encoding="utf-8").splitlines()
    lines = [line for line in status if line.startswith(_INHERITED_STATUS)]
    files = [(own / name).read_text(encoding="utf-8") for name in _INHERITED_FILES]
    namespaces = sorted(os.readlink(link) for link in spaces.iterdir())
    turn = f"{os.getpriority(os.PRIO_PROCESS, 0)} {os.sched_getscheduler(0)}"
    return (*lines, *files, *namespaces, turn)


class CopiedProcess:
    """A child of this process; the same as `subprocess.Popen` where it has the same names."""

    _forgotten: ClassVar[list[int]] = []
    """Numbers of processes for whose end nobody waits any more."""

    def __init__(self, pid: int, given: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self.stdin: IO[bytes] | None = os.fdopen(given, "wb", buffering=0)
        self._asking = threading.Lock()
        self._reap_forgotten()

    def __del__(self) -> None:
        if self.returncode is None:
            self._forgotten.append(self.pid)

    @classmethod
    def _reap_forgotten(cls) -> None:
        """Take leave of those that have ended, as `subprocess` does."""
        for process in tuple(cls._forgotten):
            with contextlib.suppress(ChildProcessError):  # somebody else has
                if os.waitpid(process, os.WNOHANG) == (0, 0):
                    continue
            cls._forgotten.remove(process)

    def poll(self) -> int | None:
        with self._asking:
            if self.returncode is None:
                try:
                    ended, status = os.waitpid(self.pid, os.WNOHANG)
                except ChildProcessError:  # somebody else in this process has asked
                    ended, status = self.pid, 0
                if ended:
                    self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        end, pause = None if timeout is None else time.monotonic() + timeout, _SHORTEST_LOOK
        while True:
            code = self.poll()
            if code is not None:
                return code
            left = _LOOK if end is None else end - time.monotonic()
            if left <= 0:
                raise subprocess.TimeoutExpired("a copied process", timeout or 0.0)
            time.sleep(min(pause, left))
            pause = min(2 * pause, _LOOK)

    def kill(self) -> None:
        with self._asking:
            if self.returncode is None:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(self.pid, signal.SIGKILL)


class _Template:
    """A template's process, seen from gfor."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._served = False
        self._line, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._line.settimeout(TO_BEGIN)
        module = "orchestrator.devices.sandbox.template"
        with other:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", module, str(other.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
                env=environment,
                pass_fds=(other.fileno(),),
            )

    @property
    def served(self) -> bool:
        """Return whether it made a process before."""
        return self._served

    def copy(self, worker: str, handles: list[int]) -> int:
        """Number of a new process; 0 where it makes none."""
        try:
            socket.send_fds(self._line, [worker.encode("ascii")], handles)
            told = int(self._line.recv(_LONGEST_NUMBER) or 0)
        except OSError:  # it has ended, or does not answer
            told = 0
        self._served = self._served or bool(told)
        return told

    def forsake(self) -> None:
        """Ask it nothing any more; it ends if nobody else has its line."""
        self._line.close()

    def close(self) -> None:
        self.forsake()
        try:
            self.process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


_Key = tuple[frozenset[tuple[str, str]], tuple[str, ...]]


class _Templates:
    """Those of this process, by the variables of their environment and the standing with which they began."""

    def __init__(self) -> None:
        self._asking = threading.Lock()
        self._found: dict[_Key, _Template] = {}
        self._useless: set[_Key] = set()

    def copy(self, worker: str, environment: Mapping[str, str], handles: list[int]) -> int:
        """Number of a new process; 0 where no template makes one."""
        try:
            key = frozenset(environment.items()), standing()
        except OSError:  # a container that hides /proc
            return 0
        with self._asking:
            while key not in self._useless:
                if key not in self._found:
                    self._make_room()
                    self._found[key] = _Template(environment)
                template, process = self._found[key], 0
                try:
                    process = template.copy(worker, handles)
                finally:  # also after an interrupt: its next answer would be to this question
                    if not process:
                        del self._found[key]
                        template.close()
                if process:
                    return process
                if not template.served:  # else it was idle for long, and a new one is made
                    self._useless.add(key)
        return 0

    def _make_room(self) -> None:
        while len(self._found) >= _MOST:
            self._found.pop(next(iter(self._found))).close()

    def processes(self) -> list[int]:
        return [template.process.pid for template in self._found.values()]

    def forsake(self) -> None:
        for template in self._found.values():
            template.forsake()

    def close(self) -> None:
        while self._found:
            self._found.popitem()[1].close()


_templates = _Templates()
_of_the_original: list[_Templates] = []
"""Those of the process of which this one is a copy, which it neither asks nor waits for."""


@atexit.register
def end_templates() -> None:
    """End what waits for questions of this process; the next question begins a new one."""
    _templates.close()


def template_processes() -> list[int]:
    """Numbers of the processes that wait to be copied for this one."""
    return _templates.processes()


def _in_a_copy() -> None:
    global _templates  # noqa: PLW0603 - a process has its own
    _templates.forsake()
    _of_the_original.append(_templates)
    _templates = _Templates()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_in_a_copy)


def start_copy(
    worker: str, request: Mapping[str, Any], environment: Mapping[str, str], output: int
) -> CopiedProcess | None:
    """Start a supervisor as a copy of a template; None where this system has none, or it does not work.

    ``output``: descriptor of the file that takes what is printed."""
    memory = request["mailbox"]
    if not on_known_machine() or not isinstance(memory, int):
        return None
    try:
        folder = os.getcwd()
    except OSError:  # it was removed
        return None
    asked, given, kept = os.memfd_create("gfor_request", os.MFD_CLOEXEC), -1, -1
    try:
        os.write(asked, json.dumps({**request, "from": folder}).encode())
        os.lseek(asked, 0, os.SEEK_SET)
        given, kept = os.pipe()
        process = _templates.copy(worker, environment, [given, output, memory, asked])
        if process:
            started, kept = CopiedProcess(process, kept), -1
            return started
    finally:
        for handle in (asked, given, kept):
            if handle >= 0:
                os.close(handle)
    return None

"""Processes that compute for the page, from the side of the server: on Linux copies of one that has done the imports.

The imports are 1.4 s of processor, and a page has four such processes; one that was ended is there again in 10 ms. The
server itself cannot be copied safely, for it has threads. Elsewhere than on Linux system libraries object to copies,
and every process does its imports itself."""

import atexit
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import IO

_ROOT = str(Path(__file__).parents[3])
_NUMBER = 64
"""Bytes that hold the number of a process, or the code that it ended with."""
_LOOK = 0.05
"""Longest between two looks at what is known [s]: what a thread waits for may be read by another one as it wakes up."""
UNKNOWN = 255
"""The code of a process of whose end nobody tells, because whoever watched it was ended as well."""


class Copy:
    """A process that was copied, with what `subprocess.Popen` has of one."""

    def __init__(self, line: socket.socket, stdin: IO[str], stdout: IO[str]) -> None:
        self._line, self.stdin, self.stdout = line, stdin, stdout
        self._reading = threading.Lock()
        self._pid = 0
        self.returncode: int | None = None
        # not sooner, for a thread may wait at it, and not at the end, where one may still
        weakref.finalize(self, line.close).atexit = False

    @property
    def pid(self) -> int:
        """Its number; who asks waits until the imports are done."""
        self._wait_until(lambda: self._pid != 0, None)
        return self._pid

    @property
    def is_there(self) -> bool:
        """Say whether the imports were done, so that it can be told to end without a wait."""
        self._read_what_came()
        return self._pid != 0

    def _wait_until(self, is_known: Callable[[], bool], timeout: float | None) -> None:
        """Wait for what the line tells; nobody else is kept from reading it meanwhile."""
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            self._read_what_came()
            left = None if end is None else end - time.monotonic()
            if is_known() or (left is not None and left <= 0.0):
                return
            select.select([self._line], [], [], _LOOK if left is None else min(left, _LOOK))

    def _read_what_came(self) -> None:
        """Take the number, and after it the code of the end, as far as they were told."""
        with self._reading:
            while self.returncode is None and select.select([self._line], [], [], 0.0)[0]:
                told = self._line.recv(_NUMBER)
                if self._pid == 0:
                    self._pid = int(told or b"-1")
                else:
                    self.returncode = int(told or UNKNOWN)

    def poll(self) -> int | None:
        self._read_what_came()
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        self._wait_until(lambda: self.returncode is not None, timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired("gfor explore", timeout or 0.0)
        return self.returncode

    def terminate(self) -> None:
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        self._send(signal.SIGKILL)

    def _send(self, number: int) -> None:
        if self.poll() is None and self.pid > 0:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)


Process = subprocess.Popen[str] | Copy


class _Original:
    """The process that the others are copies of, begun with the first of them, and again after it died."""

    def __init__(self) -> None:
        self._begun = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._asking: socket.socket | None = None

    def copied(self) -> Copy:
        """A copy with this process' environment, folder and standard error, at the head of a session of its own."""
        asked = json.dumps({"env": _environment(), "folder": os.getcwd()}).encode()
        with ExitStack() as theirs, ExitStack() as ours:
            line, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            ours.callback(line.close)
            theirs.callback(other.close)
            questions, stdin = os.pipe()
            theirs.callback(os.close, questions)
            to_it = ours.enter_context(os.fdopen(stdin, "w", encoding="utf-8"))
            stdout, answers = os.pipe()
            theirs.callback(os.close, answers)
            from_it = ours.enter_context(os.fdopen(stdout, encoding="utf-8"))
            given = [other.fileno(), questions, answers, 2]
            with self._begun:
                try:
                    socket.send_fds(self._line(), [asked], given)
                except (BrokenPipeError, ConnectionResetError):  # it was ended
                    self.close()
                    socket.send_fds(self._line(), [asked], given)
            ours.pop_all()  # they are the copy's from now on
            return Copy(line, to_it, from_it)

    def begin(self) -> None:
        with self._begun:
            self._line()

    def _line(self) -> socket.socket:
        if self._asking is None:
            self._asking, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            with theirs:
                self._process = subprocess.Popen(
                    _words("original"),
                    stdin=theirs.fileno(),
                    stdout=subprocess.DEVNULL,
                    env=_environment(),
                    start_new_session=True,
                )
        return self._asking

    def close(self) -> None:
        """Have it end; its copies end when nobody asks them any more."""
        asking, process, self._asking, self._process = self._asking, self._process, None, None
        if asking is not None:
            asking.close()
        if process is not None:
            process.kill()
            process.wait()


_original = _Original()
atexit.register(_original.close)


def begin_imports() -> None:
    """Do the imports while nobody waits for them yet."""
    if sys.platform == "linux":
        _original.begin()


def begun() -> Process:
    """A process that computes for the page; it has yet to be told the case."""
    if sys.platform == "linux":
        with suppress(OSError):  # an environment that is too long for a message
            return _original.copied()
    return subprocess.Popen(
        _words("worker"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        env=_environment(),
        start_new_session=True,
    )


def _words(module: str) -> list[str]:
    return [sys.executable, "-P", "-m", f"orchestrator.face.explore.{module}"]


def _environment() -> dict[str, str]:
    path = os.pathsep.join([_ROOT, *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path}

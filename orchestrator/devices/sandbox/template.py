"""The process of which supervisors are copies: it has imported what a worker needs, which takes most of a start.

It is started like a supervisor, with the same short list of environment variables. It is told names of our modules, and
nothing of any FMU: what a supervisor is asked stands in memory that the copy alone reads. The copy is a child of gfor,
in a session of its own, without this process's descriptors, and closes itself off as `supervisor` says.

Libraries below numpy may have threads, which Landlock would not bind. OpenBLAS ends its own before a process is copied,
and makes them again where they are needed; of a process with others no copy is made."""

import gc
import json
import os
import signal
import socket
import sys
from contextlib import suppress
from importlib import import_module
from typing import Any

from orchestrator.devices.sandbox import supervisor
from orchestrator.devices.sandbox.access_restriction import has_threads
from orchestrator.devices.sandbox.kernel_calls import copy_beside

_HANDLES = 4  # descriptors that a copy is given: standard input, output, the mailbox, its request
_LONGEST = 1024  # name of a worker's module [bytes]
_IDLE = 600.0  # time without a question after which it ends [s]: a notebook stays open for days


def wait_for_request(handle: int) -> dict[str, Any] | None:
    """Copy this process for each question; returns in a copy what it is asked, and None where nobody asks any more.

    ``handle``: descriptor of the line to gfor."""
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    os.chdir("/")  # that of gfor can be removed meanwhile
    with socket.socket(fileno=handle) as line:
        line.settimeout(_IDLE)
        while True:
            try:
                name, handles, *_ = socket.recv_fds(line, _LONGEST, _HANDLES)
            except OSError:  # that time is over
                return None
            if len(handles) != _HANDLES:
                return None
            if _is_copy(name.decode("ascii"), line):
                break
            for given in handles:
                os.close(given)
    return _request_in(handles)


def _is_copy(worker: str, line: socket.socket) -> bool:
    """Copy this process; whether this is the copy, which has told its number."""
    if worker not in sys.modules:
        _prepare(worker)
    try:
        if has_threads():
            raise OSError(0, "a library keeps threads")
        process = copy_beside()
    except OSError:
        line.send(b"0")  # in place of its number
        return False
    if process:
        return False
    os.setsid()
    line.send(b"%d" % os.getpid())
    return True


def _prepare(worker: str) -> None:
    import_module(worker).prepare()
    gc.collect()
    gc.freeze()  # what no copy changes, all share
    copy = os.fork()  # for what libraries do before a process is copied
    if not copy:
        os._exit(0)
    os.waitpid(copy, 0)


def _request_in(handles: list[int]) -> dict[str, Any]:
    """Read what the copy is asked; from here on it has of gfor what a process has that gfor starts."""
    given, output, memory, asked = handles
    with open(asked, "rb") as file:
        request: dict[str, Any] = json.load(file)
    for number, handle in enumerate((given, output, output)):
        os.dup2(handle, number)
    os.close(given)
    os.close(output)
    with suppress(OSError):
        os.chdir(request["from"])
    return request | {"mailbox": memory}


if __name__ == "__main__":
    asked_for = wait_for_request(int(sys.argv[1]))
    if asked_for is None:
        os._exit(0)
    supervisor.main(asked_for)

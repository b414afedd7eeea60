"""The process of which those are copies that compute for the page: it does their imports, and nothing else.

Each copy has another process beside it, which waits for its end and tells it."""

import gc
import json
import os
import signal
import socket
import tempfile
import warnings
from contextlib import suppress
from importlib import import_module

from fmus.toolchain.temporary import in_a_copy
from orchestrator.face.explore.worker import serve

_LATE = ("fmpy.validation", "lxml.etree", "orchestrator.output.report.mode_tables")
"""Modules that the modes of any case import where they first need them."""
_LONGEST = 1 << 20
"""Bytes of the longest request; an environment is shorter."""
_HANDLES = 4
"""A line to tell number and end by, standard input, output and error."""


def main() -> bool:
    """Make a copy for each request, until nobody asks any more; returns whether this process is a copy."""
    asked = socket.socket(fileno=os.dup(0))
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for who waits for a copy
    while True:
        text, handles, _, _ = socket.recv_fds(asked, _LONGEST, _HANDLES)
        if not text:
            return False
        if not _fork():
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            asked.close()
            return _copied(socket.socket(fileno=handles[0]), handles[1:], json.loads(text))
        for handle in handles:
            os.close(handle)


def _copied(line: socket.socket, streams: list[int], asked: dict[str, object]) -> bool:
    """Become the copy, with a process beside it that tells its number and its end."""
    copy = _fork()
    if copy:
        _tell_of(copy, line, streams)
    line.close()
    os.setsid()
    for number, handle in enumerate(streams):
        os.dup2(handle, number)
        os.close(handle)
    in_a_copy()
    environment = asked["env"]
    assert isinstance(environment, dict)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(str(asked["folder"]))
    tempfile.tempdir = None  # the environment may name another
    return True


def _tell_of(copy: int, line: socket.socket, streams: list[int]) -> None:
    for handle in (0, 1, *streams):
        os.close(handle)
    with suppress(OSError):  # nobody wants to know
        line.send(str(copy).encode())
        _, status = os.waitpid(copy, 0)
        line.send(str(os.waitstatus_to_exitcode(status)).encode())
    os._exit(0)


def _fork() -> int:
    with warnings.catch_warnings():
        # BLAS ends its threads before a copy is made
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


if __name__ == "__main__":
    for name in _LATE:
        import_module(name)
    gc.collect()
    gc.freeze()  # or each copy would write to all that it shares
    if main():
        serve()

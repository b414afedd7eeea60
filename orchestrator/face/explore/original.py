"""The process of which those are copies that compute for the page: it does their imports, and nothing else.

What not every question needs it imports once a page has asked its first and no other one comes: the first modes do not
wait for it, and what is asked after them need not import it in each copy.

Each copy has another process beside it, which waits for its end and tells it."""

import gc
import json
import os
import select
import signal
import socket
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module

from fmus.toolchain.temporary import in_a_copy
from orchestrator.core.late import import_xarray_alone
from orchestrator.face.explore.worker import serve

_LATE = (
    "encodings.cp437",  # of names in archives
    "fmpy.validation",
    "lxml.etree",
    "orchestrator.face.api.choice",
    "orchestrator.output.report.mode_tables",
    "pythonfmu",
    "xml.dom.minidom",
)
"""Modules that the modes of any case import where they first need them."""
_LATER: tuple[Callable[[], object], ...] = (
    partial(import_module, "scipy.optimize"),
    import_xarray_alone,
)
"""Imports of slopes, movers and responses: 0.2 and 0.4 s of processor."""
_IDLE = 0.1
"""After so long nobody waits for a copy [s]: a page asks several questions at once."""
_LONGEST = 1 << 20
"""Bytes of the longest request; an environment is shorter."""
_HANDLES = 4
"""A line to tell number and end by, standard input, output and error."""


def main() -> bool:
    """Make a copy for each request, until nobody asks any more; returns whether this process is a copy."""
    asked = socket.socket(fileno=os.dup(0))
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for who waits for a copy
    later, somebody_asked = [*_LATER], False
    while True:
        if later and somebody_asked and not select.select([asked], [], [], _IDLE)[0]:
            later.pop(0)()
            _freeze()
            continue
        text, handles, _, _ = socket.recv_fds(asked, _LONGEST, _HANDLES)
        if not text:
            return False
        somebody_asked = True
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


def _freeze() -> None:
    """Let no copy look at what is there now, or each would write to all that it shares."""
    gc.collect()
    gc.freeze()


def _fork() -> int:
    with warnings.catch_warnings():
        # BLAS ends its threads before a copy is made
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


if __name__ == "__main__":
    for name in _LATE:
        import_module(name)
    _freeze()
    if main():
        serve()

"""``gfor`` in processes that begin with their libraries: copies of one that imported them.

A short run takes 2 s of processor, of which most are the imports of pandas, xarray and matplotlib. Such a copy has a
number, a group, signals and an end of its own, as a process that a shell starts; only its imports are behind it. Where
the start itself is what a test is about, `tests.support.undrawn` has the words for a process from its very beginning.
"""

import contextlib
import gc
import json
import os
import select
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path

from matplotlib.figure import Figure

from fmus.toolchain.temporary import in_a_copy
from orchestrator.core.late import import_xarray_alone, put_off_parts_of_numpy
from tests.support.durations import elsewhere
from tests.support.undrawn import write_empty

ROOT = Path(__file__).parents[2]
_LONGEST_START = 120.0  # to import the libraries [s]: 2 s where a processor is free
_PATIENCE = 0.01  # between two looks at a process [s]


class Ran:
    """A process of `Warm`, with what `subprocess.Popen` has of one."""

    def __init__(self, line: socket.socket, outputs: tuple[int, int], parent: Path) -> None:
        self._line, self._outputs = line, [os.fdopen(one, "rb") for one in outputs]
        self._parent = parent
        self.pid = int(line.recv(64))
        self.returncode: int | None = None

    def poll(self) -> int | None:
        return self._looked(0.0)

    def wait(self, timeout: float) -> int:
        if self._looked(timeout) is None:
            raise subprocess.TimeoutExpired("gfor", timeout)
        assert self.returncode is not None
        return self.returncode

    def communicate(self, timeout: float = 300.0) -> tuple[str, str]:
        """What it printed, once it has ended."""
        self.wait(timeout)
        texts = []
        for output in self._outputs:
            output.seek(0)
            texts.append(output.read().decode())
            output.close()
        return texts[0], texts[1]

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(9)

    def _looked(self, timeout: float) -> int | None:
        if self.returncode is None and select.select([self._line], [], [], timeout)[0]:
            code, seconds = self._line.recv(64).split()
            self.returncode = int(code)
            self._line.close()
            elsewhere[self._parent] += float(seconds)
        return self.returncode


class Warm:
    """Makes processes of ``gfor`` from one that has all libraries of ``gfor run`` and ``gfor report``."""

    def __init__(self, folder: Path) -> None:
        self.address = folder / "socket"
        words = [sys.executable, "-m", "tests.support.warm", str(self.address)]
        self._parent = subprocess.Popen(
            words, stdin=subprocess.PIPE, cwd=ROOT, start_new_session=True
        )
        end = time.monotonic() + _LONGEST_START
        while not self.address.exists():
            assert self._parent.poll() is None
            assert time.monotonic() < end
            time.sleep(_PATIENCE)

    def started(self, *words: object, env: Mapping[str, str], drawn: bool = False) -> Ran:
        """The command of these words, at the head of a session of its own; without pictures, unless they are drawn."""
        line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        line.connect(str(self.address))
        outputs = tuple(_unnamed_file() for _ in range(2))
        asked = {"words": [str(word) for word in words], "env": dict(env), "drawn": drawn}
        asked["folder"] = os.getcwd()
        socket.send_fds(line, [json.dumps(asked).encode()], outputs)
        return Ran(line, outputs, self.address)

    def use_one_core(self) -> None:
        """Let the commands find one core where there are several: a study then has no processes of its own.

        Those of other workers of pytest find another one."""
        if hasattr(os, "sched_setaffinity"):
            cores = sorted(os.sched_getaffinity(0))
            os.sched_setaffinity(self._parent.pid, {cores[self._parent.pid % len(cores)]})

    def close(self) -> None:
        assert self._parent.stdin is not None
        self._parent.stdin.close()
        self._parent.wait()
        del elsewhere[self.address]  # it waited for all of them, and this process for it


def _unnamed_file() -> int:
    handle, path = tempfile.mkstemp()
    os.unlink(path)
    return handle


@contextlib.contextmanager
def running() -> Iterator[Warm]:
    with tempfile.TemporaryDirectory() as folder:  # a short path: an address has 108 bytes at most
        found = Warm(Path(folder))
        try:
            yield found
        finally:
            found.close()


# -- the process that the others are copies of ---------------------------------------------------------


_LATE = (
    "fmpy.validation",
    "h5py",
    "matplotlib.backends.backend_agg",
    "pythonfmu",
    "xml.dom.minidom",
)
"""What a run imports where it first needs it."""


def _import() -> None:
    put_off_parts_of_numpy()
    import_xarray_alone()  # before anybody has it, or each copy would import dask
    os.fsync = lambda handle: None  # as `tests.conftest` has it
    for name in ("orchestrator.face.cli.run", "orchestrator.face.cli.report", *_LATE):
        import_module(name)
    gc.collect()
    gc.freeze()


def _wait_for_work(address: str) -> bool:
    """Copy this process for each command that is asked for; returns whether this is such a copy."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(f"{address}.new")
        listener.listen()
        os.rename(f"{address}.new", address)
        while True:
            ready = select.select([listener, 0], [], [])[0]
            if listener not in ready:
                with contextlib.suppress(ChildProcessError):
                    while True:  # until all have ended
                        os.waitpid(-1, 0)
                return False
            line, _ = listener.accept()
            if os.fork() == 0:  # one that waits for the command and tells its end
                listener.close()
                return _begin(line)
            line.close()


def _begin(line: socket.socket) -> bool:
    """As `_wait_for_work`, in a process for one command alone."""
    text, handles, _, _ = socket.recv_fds(line, 1 << 20, 2)
    copy = os.fork()
    if copy:
        line.send(str(copy).encode())
        _, status, used = os.wait4(copy, 0)
        told = f"{os.waitstatus_to_exitcode(status)} {used.ru_utime + used.ru_stime:.2f}"
        with contextlib.suppress(OSError):
            line.send(told.encode())
        os._exit(0)
    line.close()
    os.setsid()
    for number, handle in enumerate(handles, start=1):
        os.dup2(handle, number)
        os.close(handle)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    _become(json.loads(text))
    return True


def _become(asked: dict) -> None:
    in_a_copy()
    os.environ.clear()
    os.environ.update(asked["env"])
    os.chdir(asked["folder"])
    sys.path += filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    tempfile.tempdir = None
    sys.argv = ["gfor", *asked["words"]]
    if not asked["drawn"]:
        Figure.savefig = write_empty


if __name__ == "__main__":
    _import()
    if _wait_for_work(sys.argv[1]):
        from orchestrator.face.cli import main

        raise SystemExit(main())

"""A controller DLL in a process of its own that is closed off, told from here what to call.

Nothing of the DLL runs in this process. Orders go in batches, as a run has thousands of calls."""

import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

from fmus.toolchain.temporary import own_folder, remove
from orchestrator.core.errors import CosimError
from orchestrator.devices.sandbox.resource_limits import TO_BEGIN, crowded

Order = list[Any]
"""A command of `dll_process_worker` and its arguments."""

_MOST = 64 * 1024**2  # of one answer, for which a DLL could be the author [bytes]
_TO_LOAD = 30.0  # for a DLL to be loaded, its own code among it [s]


class DllEndedError(CosimError):
    """The process of a DLL has ended, or answers no more.

    ``fault``: name of what happened. ``doing``: what the DLL was doing, in words that follow "while"."""

    def __init__(self, fault: str, how: str, doing: str) -> None:
        super().__init__(f"{how} while {doing}" if doing else how)
        self.fault, self.doing = fault, doing


class DllNotLoadedError(CosimError):
    """The DLL cannot be loaded."""


class DllProcess:
    """Holds a loaded DLL.

    Parameters
    ----------
    library
        Path of the DLL.
    texts
        Values of its text parameters; files among them may be read.
    seconds
        Wall-clock time for one batch of orders [s], longer on a crowded machine.

    Raises
    ------
    DllNotLoadedError
        If the system cannot load it.
    DllEndedError
        If its code ends the process while it is loaded, or does not come back.
    """

    def __init__(
        self, library: Path, texts: Mapping[str, str] | None = None, seconds: float = 30.0
    ) -> None:
        self._seconds, self._doing, self._rest = seconds, "", b""
        self._folder = own_folder("dll")
        search = filter(None, [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH")])
        words = [
            str(library.absolute()),
            str(self._folder),
            json.dumps(list((texts or {}).values())),
        ]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "orchestrator.devices.sandbox.dll_process_worker", *words],
            cwd=self._folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(search)},
            start_new_session=True,
        )
        self.alive = True
        try:
            self._answer(TO_BEGIN + _TO_LOAD)
        except BaseException:
            self.close()
            raise

    def do(self, orders: Sequence[Order]) -> list[Any]:
        """Answers to orders, in their order.

        Raises
        ------
        DllEndedError
            If the process has ended, or answers no more.
        ValueError
            If what the DLL declares has not the interface's form.
        """
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(orders).encode("ascii") + b"\n")
            self._process.stdin.flush()
        answer = self._answer(self._seconds * crowded())
        if answer.get("error") is not None:
            raise ValueError(str(answer["error"]))
        if answer.get("broken") is not None:
            raise RuntimeError(
                f"the process of a DLL does not follow its orders: {answer['broken']}"
            )
        found = answer.get("found")
        if not isinstance(found, list) or len(found) != len(orders):
            raise self._ended("tampering", "it gives an answer of another form")
        return found

    def _answer(self, seconds: float) -> dict[str, Any]:
        """The process's next answer; its doing is noted."""
        end = monotonic() + seconds
        while True:
            said = self._line(end)
            try:
                answer = json.loads(said)
            except ValueError:
                answer = None
            if not isinstance(answer, dict):
                raise self._ended("tampering", "it gives an answer of another form")
            if answer.get("not_loaded") is not None:
                raise DllNotLoadedError(str(answer["not_loaded"])[:1000])
            if answer.get("doing") is None:
                return answer
            self._doing = str(answer["doing"])[:80]

    def _line(self, end: float) -> bytes:
        assert self._process.stdout is not None
        channel = self._process.stdout.fileno()
        while b"\n" not in self._rest:
            with selectors.DefaultSelector() as waiting:
                waiting.register(channel, selectors.EVENT_READ)
                ready = waiting.select(max(0.0, end - monotonic()))
            if not ready:
                raise self._ended("hang", "it does not come back")
            more = os.read(channel, 1 << 20)
            if not more:
                raise self._ended(*self._end_of_process())
            self._rest += more
            if len(self._rest) > _MOST:
                raise self._ended("tampering", "it gives an answer without an end")
        line, _, self._rest = self._rest.partition(b"\n")
        return line

    def _end_of_process(self) -> tuple[str, str]:
        code = self._process.wait()
        if code >= 0:
            return "exit", f"it ends its process with exit code {code}"
        with contextlib.suppress(ValueError):
            return "crash", f"its process dies with {signal.Signals(-code).name}"
        return "crash", f"its process dies with signal {-code}"

    def _ended(self, fault: str, how: str) -> DllEndedError:
        self.close()
        return DllEndedError(fault, how, self._doing)

    def close(self) -> None:
        """End the process, and all that it started; a second call does nothing."""
        if not self.alive:
            return
        self.alive = False
        with contextlib.suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.wait()
        for channel in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                if channel is not None:
                    channel.close()
        remove(self._folder)

"""A process for a foreign FMU, from its start to its end, for whoever talks to it through its mailbox."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

from fmus.toolchain.temporary import own_folder, remove
from orchestrator.devices.sandbox import wine
from orchestrator.devices.sandbox.access_restriction import LAYERS
from orchestrator.devices.sandbox.copied_process import CopiedProcess, start_copy
from orchestrator.devices.sandbox.mailbox import Mailbox, mailbox_library, shared_memory
from orchestrator.devices.sandbox.passed_environment import environment
from orchestrator.devices.sandbox.process_end import ProcessFault, fault_of_exit, last_line
from orchestrator.devices.sandbox.process_tree import running, started_by_fmu
from orchestrator.devices.sandbox.protections_in_force import Protection
from orchestrator.devices.sandbox.resource_limits import Limits

# time in which a supervisor ends all that it watches over [s]; then it is ended itself
_PATIENCE = 5.0
_LOOK = 0.01  # time [s] after which it is looked whether a process has ended


def _started(
    told: Mapping[str, Any], output: IO[bytes], variables: Mapping[str, str]
) -> "subprocess.Popen[bytes] | CopiedProcess":
    """The supervisor: a copy of one that was prepared, or, where there is none, a new program.

    Wine's server is started in the process before it is closed, as that of a program of its own."""
    copied = (
        None if told["windows"] else start_copy(told["worker"], told, variables, output.fileno())
    )
    if copied is not None:
        return copied
    memory = told["mailbox"]
    return subprocess.Popen(
        [
            sys.executable,
            "-P",
            "-m",
            "orchestrator.devices.sandbox.supervisor",
            json.dumps(told),
        ],
        stdin=subprocess.PIPE,
        stdout=output,
        stderr=output,
        start_new_session=True,
        env=variables,
        pass_fds=(memory,) if isinstance(memory, int) else (),
    )


class ConfinedProcess:
    """A worker, started behind a supervisor (`supervisor`); it is the function ``main`` of a module.

    ``variables``: further variables of its environment, until the FMU is loaded.
    ``protections``: What keeps it from the rest of the machine; empty until the worker has told."""

    def __init__(
        self,
        worker: str,
        request: Mapping[str, Any],
        readable: Sequence[Path],
        limits: Limits,
        *,
        windows: bool = False,
        variables: Mapping[str, str] | None = None,
    ) -> None:
        self._limits, self.protections = limits, tuple[Protection, ...]()
        if windows:
            wine.socket_bases()  # the closed process cannot make them
        self.folder = own_folder("isolated")
        memory: int | str = ""
        try:
            memory = shared_memory(self.folder)
            self.box = Mailbox(memory)
            (self.folder / "work").mkdir()
            libraries = Path(mailbox_library()._name).parent
            told = {
                **request,
                "worker": worker,
                "mailbox": memory,
                "folder": str(self.folder),
                "readable": [str(path.resolve()) for path in (*readable, libraries)],
                "limits": asdict(limits),
                "layers": list(LAYERS),
                "parent": os.getpid(),
                "windows": windows,
            }
            with (self.folder / "output").open("ab") as output:
                self._process = _started(told, output, {**environment(), **(variables or {})})
        except BaseException:
            remove(self.folder)
            raise
        finally:
            if isinstance(memory, int):
                os.close(memory)
        handle = getattr(self._process, "_handle", None)  # Windows
        self.box.client.peer = self._process.pid if handle is None else int(handle)

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    @property
    def group(self) -> int:
        return self._process.pid

    def left_behind(self, seconds: float) -> list[str]:
        """Programs that still run beside keeper and worker after some time, each with its process's number."""
        end = time.monotonic() + seconds
        while (left := running(started_by_fmu(self.group))) and time.monotonic() < end:
            time.sleep(_LOOK)
        return left

    def wait(self, seconds: float) -> bool:
        """Give it some time to end; whether it did."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)
        return not self.running

    def fault(self) -> tuple[ProcessFault, str]:
        """Name of the fault that ended it, and what happened, once it has ended or is about to."""
        if not self.wait(_PATIENCE):
            self.end()
            return ProcessFault.TAMPERING, "it said that it ended, and had not"
        assert self._process.returncode is not None
        return fault_of_exit(self._process.returncode, self._limits)

    def last_words(self) -> str:
        return last_line(self.folder / "output")

    def end(self) -> None:
        """End it and all that it started; its folder stays."""
        process = self._process
        if process.poll() is None and sys.platform != "win32":
            assert process.stdin is not None
            with contextlib.suppress(OSError):
                os.write(process.stdin.fileno(), b".")
            self.wait(_PATIENCE)
        if process.poll() is None:
            process.kill()
        process.wait()
        if hasattr(os, "killpg"):
            with contextlib.suppress(ProcessLookupError, PermissionError):  # nothing is left of it
                os.killpg(process.pid, signal.SIGKILL)
        if process.stdin is not None and not process.stdin.closed:
            process.stdin.close()

    def close(self) -> None:
        self.end()
        remove(self.folder)

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
from enum import StrEnum
from pathlib import Path
from typing import Any

from fmus.toolchain.temporary import own_folder, remove
from orchestrator.devices.fmi import wine
from orchestrator.devices.fmi.confinement import LAYERS
from orchestrator.devices.fmi.limits import TOO_MANY_TASKS, TOO_MUCH_DISK, TOO_MUCH_MEMORY, Limits
from orchestrator.devices.fmi.mailbox import Mailbox, mailbox_library, shared_memory
from orchestrator.devices.fmi.messages import FLOODED
from orchestrator.devices.fmi.process_tree import MOST_FILES, running, started_by_fmu
from orchestrator.devices.fmi.protection import Protection

# on Windows, a process that dies of a fault ends with its status, at least this
_WINDOWS_FAULTS = 0x80000000


class ProcessFault(StrEnum):
    CRASH = "crash"
    EXIT = "exit"
    HANG = "hang"
    TAMPERING = "tampering"
    OUTPUT = "output flood"
    CPU = "processor time"
    MEMORY = "memory"
    TASKS = "too many processes"
    LEFT = "process left behind"
    DISK = "disk"


def fault_of_exit(code: int, limits: Limits) -> tuple[ProcessFault, str]:
    """Name of the fault that ended a process, and what happened.

    ``code``: As `subprocess.Popen.wait` returns it: the negative number of a signal where one ended the process.

    Examples
    --------
    A process that wrote to a null pointer gives ``("crash", "its process died with SIGSEGV")``.
    """
    if code == FLOODED:
        return ProcessFault.OUTPUT, f"more than {limits.messages} log messages"
    if code < 0 and -code == getattr(signal, "SIGXFSZ", None):
        return ProcessFault.OUTPUT, f"more than {limits.output} bytes written"
    if code < 0 and -code == getattr(signal, "SIGXCPU", None):
        return ProcessFault.CPU, f"more than {limits.cpu:g} s in one process"
    if code == TOO_MUCH_MEMORY:
        return (
            ProcessFault.MEMORY,
            f"its processes used more than {limits.memory} bytes together, and were ended",
        )
    if code == TOO_MANY_TASKS:
        return (
            ProcessFault.TASKS,
            f"more than {limits.tasks} processes and threads, which were ended",
        )
    if code == TOO_MUCH_DISK:
        much = f"{limits.disk} bytes or {MOST_FILES} files and folders"
        return (
            ProcessFault.DISK,
            f"its files came to more than {much}, or could not be counted; its processes were ended",
        )
    if code < 0:
        return ProcessFault.CRASH, f"its process died with {_name_of_signal(-code)}"
    if code >= _WINDOWS_FAULTS:
        return ProcessFault.CRASH, f"its process died with code {code:#x}"
    return ProcessFault.EXIT, f"it ended its process with exit code {code}"


def _name_of_signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # most real-time signals have no name
        return f"signal {number}"


def last_line(output: Path) -> str:
    """The last line of what a process wrote, 300 characters at most; empty where the file cannot be read."""
    try:
        with output.open("rb") as file:
            file.seek(max(0, file.seek(0, 2) - 2000))
            lines = file.read().decode("utf-8", "replace").strip().splitlines()
    except OSError:
        return ""
    return " ".join(lines[-1:])[:300]


_KEPT = (
    "PATH",
    "LANG",
    "LANGUAGE",
    "TZ",
    "LD_LIBRARY_PATH",
    "DYLD_LIBRARY_PATH",
    "DYLD_FALLBACK_LIBRARY_PATH",
    "SYSTEMROOT",
    "WINDIR",
    "COMSPEC",
    "PATHEXT",
    "NUMBER_OF_PROCESSORS",
    "PROCESSOR_ARCHITECTURE",
)
_KEPT_BEGINNINGS = ("LC_", "OMP_", "OPENBLAS_", "MKL_", "KMP_", "PYTHON")
_NOT_FOR_IT = ("PYTHONSTARTUP", "PYTHONINSPECT", "PYTHONBREAKPOINT")

_FOR_THE_CACHE = ("HOME", "USERPROFILE", "XDG_CACHE_HOME", "LOCALAPPDATA", "GFOR_COSIM_CACHE")
"""They say where compiled adapters lie; `apply_limits` takes them away before the FMU is loaded."""

PASSED_ON = "GFOR_COSIM_FMU_ENVIRONMENT"
"""Names, with commas between them, of further variables that FMUs need: where a licence is, for instance."""


def environment(of: Mapping[str, str] | None = None) -> dict[str, str]:
    """Keep part of an environment, by default of this process's own: a short list without keys or passwords."""
    own = os.environ if of is None else of
    more = [name.strip() for name in own.get(PASSED_ON, "").split(",")]
    return {
        name: value
        for name, value in own.items()
        if name in _KEPT
        or name in _FOR_THE_CACHE
        or name in more
        or (name.startswith(_KEPT_BEGINNINGS) and name not in _NOT_FOR_IT)
    }


# time in which a supervisor ends all that it watches over [s]; then it is ended itself
_PATIENCE = 5.0
_LOOK = 0.01  # time [s] after which it is looked whether a process has ended


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
                self._process = subprocess.Popen(
                    [
                        sys.executable,
                        "-P",
                        "-m",
                        "orchestrator.devices.fmi.supervisor",
                        json.dumps(told),
                    ],
                    stdin=subprocess.PIPE,
                    stdout=output,
                    stderr=output,
                    start_new_session=True,
                    env={**environment(), **(variables or {})},
                    pass_fds=(memory,) if isinstance(memory, int) else (),
                )
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

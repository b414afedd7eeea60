"""How the process of a foreign library ended: which fault that was, in words, from its exit code or signal."""

import signal
from enum import StrEnum
from pathlib import Path

from orchestrator.devices.sandbox.process_tree import MOST_FILES
from orchestrator.devices.sandbox.resource_limits import (
    FLOODED,
    TOO_MANY_TASKS,
    TOO_MUCH_DISK,
    TOO_MUCH_MEMORY,
    Limits,
)

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

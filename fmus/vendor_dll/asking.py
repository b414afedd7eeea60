"""Ask the process that reads a DLL, and tell how it ended: by the DLL's own doing or for want of time."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fmus.toolchain.temporary import own_folder, remove
from fmus.vendor_dll.answer_file import ForeignAnswerError, read_answer, read_plain_file

BEFORE_IT_STARTS = 300.0  # for Python, and Wine, to start, until the DLL's own code runs [s]
# processor time, as a part of the time it had, from which a DLL counts as one that never comes back
_OWN_DOING = 0.5
_START = tuple(f"Model_{call} runs" for call in ("FirstCall", "CheckParameters", "Initialize"))
_FROM_OUTSIDE = (*("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP", "SIGQUIT"), *("SIGXCPU", "SIGSTOP"))
"""Signals by which others end a process: the system that lacks memory, a person."""


@dataclass(frozen=True)
class Answer:
    found: dict[str, Any] = field(default_factory=dict)  # its answer; empty where it gave none
    # how it ended where it gave none, in words that follow "the process that reads it"
    end: str = ""
    why: str = ""
    passing: bool = False  # the reason lies in this machine, so that another call may find more
    in_its_start: bool = False  # the DLL's own code ended it before the first sample


def note_beside(answer: Path) -> Path:
    return answer.with_name(answer.name + ".doing")


def ask(path: Path, reader: str, longest: float, *more: str) -> Answer:
    """Read a DLL in a process of its own.

    ``longest``: Time for the DLL's own code, counted from when it is loaded [s]."""
    folder = own_folder("dll")
    try:
        answer = folder / "answer.json"
        # Not sys.path: Python-backed FMUs lengthen it, and Linux takes no variable of more than 128 KiB.
        search = filter(None, [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH")])
        process = subprocess.Popen(
            [sys.executable, "-m", reader, str(path), str(answer), *more],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(search)},
            start_new_session=True,
        )
        note = note_beside(answer)
        try:
            in_time = _wait(process, note, longest)
            used = 0.0 if in_time else _processor_time(process.pid)
        finally:
            _end(process)
        doing = _doing(note)
        if not in_time:
            return _out_of_time(doing, longest, used)
        if os.path.lexists(answer):
            try:
                return Answer(read_answer(answer))
            except ForeignAnswerError as error:
                return Answer(
                    end=f"gives no answer of its form ({error})",
                    why="the DLL's code wrote where a DLL has no business; do not run this file",
                )
        return _ended(doing, process.returncode)
    finally:
        remove(folder)


def _doing(note: Path) -> str:
    """The DLL's present call by the note, which its code can overwrite."""
    if not os.path.lexists(note):
        return ""
    try:
        return "".join(
            filter(str.isprintable, read_plain_file(note, 1000).decode("utf-8", "replace"))
        ).strip()
    except ForeignAnswerError:
        return "its code runs"


def _wait(process: "subprocess.Popen[bytes]", note: Path, longest: float) -> bool:
    """Return whether it ends in time, which is taken from when the DLL's own code begins."""
    end, begun = time.monotonic() + BEFORE_IT_STARTS, False
    while True:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.2)
            return True
        if not begun and note.exists():
            end, begun = time.monotonic() + longest, True
        if time.monotonic() > end:
            return False


def _end(process: "subprocess.Popen[bytes]") -> None:
    with contextlib.suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
    if process.poll() is None:
        process.kill()
    process.wait()


def _processor_time(session: int) -> float:
    """Processor time of all processes of a session [s]; 0 without /proc."""
    ticks = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            words = stat.read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
            if int(words[3]) == session:
                ticks += int(words[11]) + int(words[12])
    return ticks / os.sysconf("SC_CLK_TCK") if ticks else 0.0


def _out_of_time(doing: str, longest: float, used: float) -> Answer:
    if not doing:
        return Answer(
            end=f"does not start within {BEFORE_IT_STARTS:g} s",
            why="time ran out before the DLL was loaded, as this machine is busy or Wine does not start; try again",
            passing=True,
        )
    end = f"does not end within {longest:g} s while {doing}"
    if used >= _OWN_DOING * longest:
        return Answer(
            end=end,
            why=f"the DLL does not come back ({used:.0f} s of processor time); ask its author for one that does",
        )
    return Answer(
        end=end,
        why=f"time ran out after {used:.1f} s of processor time, as this machine is busy or the DLL waits; "
        "try again on a calm machine",
        passing=True,
    )


def _ended(doing: str, code: int) -> Answer:
    name, started = f"exit code {code}", doing in _START
    with contextlib.suppress(ValueError):
        name = signal.Signals(-code).name if code < 0 else name
    end = f"ends with {name}" + (f" while {doing}" if doing else "")
    if name in _FROM_OUTSIDE:
        return Answer(
            end=end,
            why="something else ended it, such as the system for want of memory; try again",
            passing=True,
        )
    if not doing:
        why = "it fails before the DLL is loaded"
    elif doing.startswith("what"):
        why = "its structures are of another layout; ask its author for a DLL of the interface's layout"
    else:
        why = "it crashes there or ends its own process, in which no file is seen but those that its text parameters "
        why += "name; name the one that it needs, or ask its author for a DLL that does not"
    return Answer(end=end, why=why, in_its_start=started)

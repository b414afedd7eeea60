"""The processes that descend from one, and what they have in use together; on Linux, from its files in /proc."""

import contextlib
import errno
import os
import signal
import stat
import sys
import time
from dataclasses import dataclass
from pathlib import Path

_PROC = Path("/proc")
_ENDED = ("Z", "X")  # states of a process that only waits for its parent's question
MOST_FILES = 20_000  # files and folders below a folder beyond which it counts as too large


@dataclass(frozen=True, slots=True)
class Usage:
    """Use of processes: memory [bytes], and how many tasks, which are processes and threads."""

    memory: int
    tasks: int


def descendants(process: int) -> list[int]:
    """Numbers of all processes that descend from one, itself left out; none where there is no /proc."""
    found: list[int] = []
    pending = [process]
    while pending:
        for child in _children(pending.pop()):
            found.append(child)
            pending.append(child)
    return found


def started_by_fmu(supervisor: int) -> list[int]:
    """Numbers of the processes that an FMU started: those after keeper and worker, which come first."""
    return descendants(supervisor)[2:]


def _children(process: int) -> list[int]:
    children: list[int] = []
    with contextlib.suppress(OSError):
        for task in os.listdir(_PROC / str(process) / "task"):
            listed = (_PROC / str(process) / "task" / task / "children").read_text(encoding="ascii")
            children += map(int, listed.split())
    return children


def running(processes: list[int]) -> list[str]:
    """Those of some processes that have not ended: the name of the program, and the number in brackets."""
    found = []
    for process in processes:
        with contextlib.suppress(OSError):
            text = (_PROC / str(process) / "stat").read_text(encoding="utf-8", errors="replace")
            begin, _, rest = text.rpartition(")")
            if rest.split()[0] not in _ENDED:
                found.append(f"{begin.partition('(')[2]} ({process})")
    return found


def usage(processes: list[int], enough: int) -> Usage:
    """Return what processes have in use together.

    Pages that several share are counted for each of them first, and exactly only where that comes to more than
    ``enough`` bytes."""
    memory = tasks = 0
    for process in processes:
        with contextlib.suppress(OSError):
            tasks += len(os.listdir(_PROC / str(process) / "task"))
        memory += _resident(process)
    return Usage(memory if memory <= enough else sum(map(_own_share, processes)), tasks)


def _resident(process: int) -> int:
    """Memory of a process, with all that it shares [bytes]; 0 once it has ended."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        for task in os.listdir(
            _PROC / str(process) / "task"
        ):  # the first has none once it ended before the others
            text = (_PROC / str(process) / "task" / task / "statm").read_text(encoding="ascii")
            pages = int(text.split()[1])
            if pages:
                return pages * os.sysconf("SC_PAGE_SIZE")
    return 0


def _own_share(process: int) -> int:
    """Memory of a process where a page of n processes counts as its nth part [bytes].

    All that it shares counts where the process hides its share, as each process may."""
    with contextlib.suppress(OSError, ValueError):
        for line in (
            (_PROC / str(process) / "smaps_rollup").read_text(encoding="ascii").splitlines()
        ):
            if line.startswith("Pss:"):
                return 1024 * int(line.split()[1])
    return _resident(process)


def size_of(folder: Path, enough: int) -> int:
    """Size of the files below a folder [bytes], counted until there are more than ``enough``.

    It is more than that too where there are more than `MOST_FILES`, or where a folder cannot be listed because its path
    is too long or its permissions forbid it."""
    total, pending, seen = 0, [folder], 0
    while pending and total <= enough:
        try:
            with os.scandir(pending.pop()) as entries:
                for entry in entries:
                    seen += 1
                    if seen > MOST_FILES:
                        return enough + 1
                    with contextlib.suppress(FileNotFoundError):  # it was removed meanwhile
                        if entry.is_dir(follow_symlinks=False):
                            pending.append(Path(entry.path))
                        else:
                            total += 512 * entry.stat(follow_symlinks=False).st_blocks
        except OSError as error:
            if error.errno in (errno.ENAMETOOLONG, errno.EACCES):
                return enough + 1
    return total


def size_of_removed(processes: list[int], enough: int) -> int:
    """Size of the files that processes hold open after they were removed [bytes], counted until more than ``enough``.

    Files that the calling process holds open as well are not theirs, and do not count."""
    known = {(found.st_dev, found.st_ino) for found in _removed("self")}
    total = 0
    for process in processes:
        tasks: list[str] = []
        with contextlib.suppress(OSError):
            tasks = os.listdir(_PROC / str(process) / "task")
        for task in tasks:  # each may have a table of open files of its own
            for found in _removed(f"{process}/task/{task}"):
                if (found.st_dev, found.st_ino) not in known:
                    known.add((found.st_dev, found.st_ino))
                    total += 512 * found.st_blocks
            if total > enough:
                return total
    return total


def _removed(process: str) -> list[os.stat_result]:
    found = []
    with contextlib.suppress(OSError):
        for descriptor in os.listdir(_PROC / process / "fd"):
            with contextlib.suppress(OSError):
                seen = os.stat(_PROC / process / "fd" / descriptor)
                if stat.S_ISREG(seen.st_mode) and not seen.st_nlink:
                    found.append(seen)
    return found


def end_descendants(process: int, patience: float = 2.0) -> None:
    """Kill all that descends from this process, which adopts orphans, and reap what becomes its child."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        for descendant in descendants(process):
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(descendant, signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return
        if sys.platform != "linux":
            return
        time.sleep(0.002)

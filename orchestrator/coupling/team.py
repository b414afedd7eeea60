"""Threads that share the calls of the compiled loop, and memory that they do not share.

Python starts them and they never run its code: they stay in C (``team.c``) until they are dismissed. One that logs in
the name of an FMU waits for Python's lock, which the caller gives away while it waits for the others. Two threads that
write to one line of the processor's cache wait for each other."""

import ctypes
import logging
from threading import Thread
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import DTypeLike, NDArray

from orchestrator.cores import MOST_THREADS

LINE = 128  # bytes that a processor may fetch together: two lines of 64


def apart(count: int, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """An array of zeros, shape (count,), that shares no line with anything else."""
    size = count * np.dtype(dtype).itemsize
    memory = np.zeros(size + 2 * LINE, dtype=np.uint8)
    first = -memory.ctypes.data % LINE
    return memory[first : first + size].view(dtype)


_LOG = logging.getLogger("gfor")


class Team:
    """Threads beside the calling one; `dismiss` ends them, at the latest where Python ends."""

    def __init__(self, library: Any, members: int) -> None:
        self._memory = apart(-(-library.team_size() // 8), np.float64)
        self.address: int = self._memory.ctypes.data
        unlocked = ctypes.CDLL(library._name)
        unlocked.team_work.argtypes = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64]
        unlocked.team_work.restype = None
        threads: list[Thread] = []
        since = library.team_round(self.address)
        try:
            for k in range(1, min(members, MOST_THREADS)):
                arguments = self.address, k, since
                threads.append(Thread(target=unlocked.team_work, args=arguments, name=f"gfor step {k}", daemon=True))
                threads[-1].start()
        except RuntimeError as error:
            threads.pop()
            _LOG.warning("%d threads were wanted, and the system starts %d: %s", members, 1 + len(threads), error)
        self.members = 1 + len(threads)
        unlock, lock = (
            ctypes.cast(function, ctypes.c_void_p)
            for function in (ctypes.pythonapi.PyEval_SaveThread, ctypes.pythonapi.PyEval_RestoreThread)
        )
        library.team_form(self.address, self.members, unlock, lock)
        self.dismiss = finalize(self, _dismiss, library, self._memory, threads)


def _dismiss(library: Any, memory: Any, threads: list[Thread]) -> None:
    library.team_dismiss(memory.ctypes.data)
    for thread in threads:
        thread.join()

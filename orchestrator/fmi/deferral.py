"""A signal that comes while a library is at work waits until the library has come back to our code.

Python runs a signal's handler in whatever Python code comes next, which may be a library's that was called from C. An
exception raised there reaches C that takes it for an error of another kind (Matplotlib's converters of arguments make
a `TypeError` of it, h5py a `SystemError`), or clears it. So it is raised at the next line of our own code."""

import _thread
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import Any

_OURS = frozenset({"orchestrator", "fmus", "gfor_fmu"})
_HANDLERS = frozenset({"orchestrator.fmi.deferral", "orchestrator.fmi.interrupts"})

_WAITS = frozenset(
    {"asyncio", "concurrent", "multiprocessing", "queue", "selectors", "socket", "ssl", "subprocess", "threading"}
)
"""Modules in which Python code waits for others; there a signal is raised at once, as Python does."""

_LONGEST = 3.0  # seconds that a signal waits for a library at most; afterwards it is raised wherever the program is
_LIBRARIES = ("site-packages", "dist-packages", os.path.dirname(os.__file__))


def frame_of_ours(frame: FrameType | None) -> FrameType | None:
    """The nearest frame of this package where a library runs above it; None where a signal can be raised at once."""
    inner = frame
    while frame is not None and not _is_ours(frame):
        if frame is inner and _package(frame) in _WAITS:
            return None
        path = frame.f_code.co_filename
        if not path.startswith("<") and not any(place in path for place in _LIBRARIES):
            return None  # a program of the user's: it decides
        frame = frame.f_back
    return None if frame is inner else frame


def _package(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0]


def _is_ours(frame: FrameType) -> bool:
    return _package(frame) in _OURS


class Deferral:
    """At most one exception that waits for the next line of our code, in the main thread."""

    def __init__(self, deliver: Callable[[], None]) -> None:
        self._deliver, self._number = deliver, 0
        self._frame: FrameType | None = None
        self._before: Any = None
        self._repeats = False

    @property
    def waits(self) -> bool:
        return self._frame is not None

    def until(self, frame: FrameType) -> None:
        """Deliver at the next line of the frame, or in the first function of ours that is called before."""
        self._frame, self._before = frame, sys.gettrace()
        self._number, self._repeats = self._number + 1, False
        frame.f_trace = self._at_line
        sys.settrace(self._at_call)
        _thread.start_new_thread(self._ask_again, (self._number,))

    def drop(self) -> None:
        frame, self._frame = self._frame, None
        if frame is not None:
            del frame.f_trace
            sys.settrace(self._before)
            self._before = None

    def too_late(self) -> bool:
        """Whether the signal that is taken now repeats one that was delivered meanwhile."""
        repeats, self._repeats = self._repeats, False
        return repeats and not self.waits

    def _at_call(self, frame: FrameType, event: str, argument: Any) -> Any:
        here = frame.f_globals.get("__name__") in _HANDLERS
        return self._at_line if self._frame is not None and _is_ours(frame) and not here else None

    def _at_line(self, frame: FrameType, event: str, argument: Any) -> Any:
        if self._frame is not None and event != "call":
            self.drop()
            self._deliver()
        return None

    def _ask_again(self, number: int) -> None:
        """In a thread: a signal that still waits comes a second time, which ends every wait."""
        time.sleep(_LONGEST)
        if self._frame is None or self._number != number:
            return
        self._repeats = True
        if sys.platform == "win32":
            _thread.interrupt_main(signal.SIGINT)
        else:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

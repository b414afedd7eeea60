"""Ctrl-C and SIGTERM while an FMU is in a call, or a library at work: they wait until our own code goes on.

Python raises `KeyboardInterrupt` in whatever Python code runs next. In a call of a Python-backed FMU that is code of
the FMU, which takes it for a failure of its own, reports ``fmi2Fatal``, and must not be called again. In a library's
code that was called from C it reaches C that takes it for an error of another kind (Matplotlib's converters of
arguments make a `TypeError` of it, h5py a `SystemError`), or clears it. So `Deferral` raises it at the next line of our
own code."""

import _thread
import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_OURS = frozenset({"orchestrator", "fmus", "gfor_fmu"})

_WAITS = frozenset(
    {
        "asyncio",
        "concurrent",
        "multiprocessing",
        "queue",
        "selectors",
        "socket",
        "ssl",
        "subprocess",
        "threading",
    }
)
"""Modules in which Python code waits for others; there a signal is raised at once, as Python does."""

# seconds that a signal waits for a library at most; afterwards it is raised wherever the program is
_LONGEST = 3.0
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
        """Return whether the signal that is taken now repeats, by `_ask_again`, one that was delivered meanwhile.

        It must not end anything a second time."""
        repeats, self._repeats = self._repeats, False
        return repeats and not self.waits

    def _at_call(self, frame: FrameType, event: str, argument: Any) -> Any:
        here = frame.f_globals.get("__name__") == __name__
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
            deaf = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
            again = signal.SIGTERM if deaf else signal.SIGINT
            signal.pthread_kill(threading.main_thread().ident or 0, again)


class _Calls:
    """``with calls:`` goes around whatever calls FMUs of this process.

    ``taken``, ``terminated``: Whether any signal was taken since the command began, and whether a SIGTERM was.
    ``over``: Whether all is done: then the exit code says how, and no signal changes it any more. It is set, not
    called, because Python takes signals where a function begins."""

    def __init__(self) -> None:
        self._main = threading.main_thread().ident
        self._depth = 0
        self._asked = ctypes.c_int(0)  # C that waits for another process looks at it as well
        self._kind: type[BaseException] = KeyboardInterrupt
        self._hook: Callable[[Any], None] | None = None
        self._deferral = Deferral(self._raise)
        self.taken = self.terminated = self.over = False

    @property
    def asked_address(self) -> int:
        """Address of an int that is 1 while a signal waits for the end of a call."""
        return ctypes.addressof(self._asked)

    def watch(self) -> None:
        """Take Ctrl-C over from Python, where nobody else has; between calls it works as before.

        A process that was started deaf to it, as in the background of a script, stays so, as every program of Unix: a
        Ctrl-C at the script is not meant for it. SIGTERM ends it in order.

        Where Python would swallow it, as in a weak reference's end, it comes again at the next line of ours."""
        here = threading.current_thread() is threading.main_thread()
        if here and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self.take)
        if here and sys.unraisablehook is not self._hook:
            self._hook = self._swallowed(sys.unraisablehook)
            sys.unraisablehook = self._hook

    @property
    def how(self) -> str:
        return "ended by SIGTERM" if self.terminated else "interrupted"

    @contextmanager
    def terminable(self, ending: bool = False) -> Iterator[None]:
        """Inside, the first SIGTERM does what Ctrl-C does; a second one ends the process at once.

        ``ending``: whether the process ends afterwards. Both signals are ignored then, as where `over` is set."""
        self.taken = self.terminated = self.over = False
        if threading.current_thread() is not threading.main_thread():
            try:
                yield
            finally:
                self.taken = self.over = False
            return
        unraisable = sys.unraisablehook
        self.watch()
        before = signal.signal(signal.SIGTERM, self.take)
        try:
            yield
        finally:
            signal.signal(signal.SIGTERM, signal.SIG_IGN if ending else before)
            if ending:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
            self._deferral.drop()
            self.taken, self.over = False, ending
            sys.unraisablehook = unraisable

    def _swallowed(self, otherwise: Callable[[Any], Any]) -> Callable[[Any], None]:
        """An interrupt that came where Python lets no error out, as in a weak reference's end, comes again."""

        def hook(raised: Any) -> None:
            frame = sys._getframe().f_back
            if raised.exc_type is not None and issubclass(raised.exc_type, self._kind):
                if not self._defer(frame) and frame is not None:
                    self._deferral.until(frame)
            else:
                otherwise(raised)

        return hook

    def leave(self, frame: FrameType | None) -> None:
        """End the process from its main thread, but not in the middle of a call; for a handler, with its frame."""
        self._kind = SystemExit
        self._defer_or_raise(frame)

    def take(self, number: int, frame: FrameType | None) -> None:
        """The handler of signals that end a command."""
        if self.over or self._deferral.too_late():
            return
        self.taken = True
        if number == signal.SIGTERM:
            if self.terminated:
                signal.signal(signal.SIGTERM, signal.SIG_DFL)
                os.kill(os.getpid(), signal.SIGTERM)
            self.terminated = True
        self._defer_or_raise(frame)

    def _defer_or_raise(self, frame: FrameType | None) -> None:
        if (
            self._asked.value or self._deferral.waits
        ):  # who sends a second signal does not want to wait
            self._asked.value = 0
            self._deferral.drop()
            raise self._kind
        if not self._defer(frame):
            raise self._kind

    def _defer(self, frame: FrameType | None) -> bool:
        """Have it raised at the end of the call, or at the next line of ours; False where neither is to come."""
        if self._depth:
            self._asked.value = 1
            return True
        ours = frame_of_ours(frame)
        if ours is None:
            return False
        self._deferral.until(ours)
        return True

    def _raise(self) -> None:
        if self._depth:
            self._asked.value = 1
        else:
            raise self._kind

    def __enter__(self) -> None:
        if threading.get_ident() == self._main:  # signals reach no other thread
            self._depth += 1

    def __exit__(self, *error: object) -> None:
        if threading.get_ident() == self._main:
            self._depth -= 1
            if self._asked.value and not self._depth:
                self._asked.value = 0
                raise self._kind


calls = _Calls()

"""Ctrl-C and SIGTERM while an FMU is in a call, or a library at work: they wait until our own code goes on.

Python raises `KeyboardInterrupt` in whatever Python code runs next. In a call of a Python-backed FMU that is code of
the FMU, which takes it for a failure of its own, reports ``fmi2Fatal``, and must not be called again. For libraries see
`deferral`."""

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from orchestrator.fmi.deferral import Deferral, frame_of_ours


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
        """Of an int that is 1 while a signal waits for the end of a call."""
        return ctypes.addressof(self._asked)

    def watch(self) -> None:
        """Take Ctrl-C over from Python, where nobody else has; between calls it works as before.

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
                if not self._wait(frame) and frame is not None:
                    self._deferral.until(frame)
            else:
                otherwise(raised)

        return hook

    def leave(self, frame: FrameType | None) -> None:
        """End the process from its main thread, but not in the middle of a call; for a handler, with its frame."""
        self._kind = SystemExit
        self._ask(frame)

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
        self._ask(frame)

    def _ask(self, frame: FrameType | None) -> None:
        if self._asked.value or self._deferral.waits:  # who asks twice does not want to wait
            self._asked.value = 0
            self._deferral.drop()
            raise self._kind
        if not self._wait(frame):
            raise self._kind

    def _wait(self, frame: FrameType | None) -> bool:
        """Have it raised at the end of the call, or at the next line of ours; False where neither is to come."""
        if self._depth:
            self._asked.value = 1
            return True
        if (ours := frame_of_ours(frame)) is None:
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

"""Ctrl-C and SIGTERM while an FMU is in a call: they wait until the call is over.

Python raises `KeyboardInterrupt` in whatever Python code runs next. In a call of a Python-backed FMU that is code of
the FMU, which takes it for a failure of its own, reports ``fmi2Fatal``, and must not be called again.
"""

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class _Calls:
    """``with calls:`` goes around whatever calls FMUs of this process.

    Attributes
    ----------
    terminated
        Whether a SIGTERM was taken since the command began.
    over
        Whether all is done: then the exit code says how, and no signal changes it any more. It is set, not called,
        because Python takes signals where a function begins.
    """

    def __init__(self) -> None:
        self._main = threading.main_thread().ident
        self._depth = 0
        self._asked = ctypes.c_int(0)  # C that waits for another process looks at it as well
        self._kind: type[BaseException] = KeyboardInterrupt
        self._hook: Callable[[Any], None] | None = None
        self.terminated = self.over = False

    @property
    def asked_address(self) -> int:
        """Of an int that is 1 while a signal waits for the end of a call."""
        return ctypes.addressof(self._asked)

    def watch(self) -> None:
        """Take Ctrl-C over from Python, where nobody else has; between calls it works as before.

        Where Python would swallow it, as in a weak reference's end, it is asked for again.
        """
        here = threading.current_thread() is threading.main_thread()
        if here and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._take)
        if here and sys.unraisablehook is not self._hook:
            self._hook = self._swallowed(sys.unraisablehook)
            sys.unraisablehook = self._hook

    @property
    def how(self) -> str:
        """How a command was ended, in words."""
        return "ended by SIGTERM" if self.terminated else "interrupted"

    @contextmanager
    def terminable(self, ending: bool = False) -> Iterator[None]:
        """Inside, the first SIGTERM does what Ctrl-C does; a second one ends the process at once.

        Parameters
        ----------
        ending
            Whether the process ends afterwards. Both signals are ignored then, as where `over` is set.
        """
        self.terminated = self.over = False
        if threading.current_thread() is not threading.main_thread():
            try:
                yield
            finally:
                self.over = False
            return
        unraisable = sys.unraisablehook
        self.watch()
        before = signal.signal(signal.SIGTERM, self._take)
        try:
            yield
        finally:
            signal.signal(signal.SIGTERM, signal.SIG_IGN if ending else before)
            if ending:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
            self.over = ending
            sys.unraisablehook = unraisable

    def _swallowed(self, otherwise: Callable[[Any], Any]) -> Callable[[Any], None]:
        """An interrupt that came where Python lets no error out, as in a weak reference's end, is asked for again."""

        def hook(raised: Any) -> None:
            if issubclass(raised.exc_type, KeyboardInterrupt):
                self._asked.value = 1
            else:
                otherwise(raised)

        return hook

    def leave(self) -> None:
        """End the process from its main thread, but not in the middle of a call."""
        self._kind = SystemExit
        self._ask()

    def _take(self, number: int, frame: FrameType | None) -> None:
        if self.over:
            return
        if number == signal.SIGTERM:
            if self.terminated:
                signal.signal(signal.SIGTERM, signal.SIG_DFL)
                os.kill(os.getpid(), signal.SIGTERM)
            self.terminated = True
        self._ask()

    def _ask(self) -> None:
        if self._depth and not self._asked.value:  # who asks twice does not want to wait
            self._asked.value = 1
        else:
            self._asked.value = 0
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

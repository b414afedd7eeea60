"""Ctrl-C while an FMU is in a call: it waits until the call is over.

Python raises `KeyboardInterrupt` in whatever Python code runs next. In a call of a Python-backed FMU that is code of
the FMU, which takes it for a failure of its own, reports ``fmi2Fatal``, and must not be called again.
"""

import ctypes
import signal
import threading
from types import FrameType


class _Calls:
    """``with calls:`` goes around whatever calls FMUs of this process."""

    def __init__(self) -> None:
        self._main = threading.main_thread().ident
        self._depth = 0
        self._asked = ctypes.c_int(0)  # C that waits for another process looks at it as well

    @property
    def asked_address(self) -> int:
        """Of an int that is 1 while Ctrl-C waits for the end of a call."""
        return ctypes.addressof(self._asked)

    def watch(self) -> None:
        """Take Ctrl-C over from Python, where nobody else has; between calls it works as before."""
        here = threading.current_thread() is threading.main_thread()
        if here and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._take)

    def _take(self, number: int, frame: FrameType | None) -> None:
        if self._depth and not self._asked.value:  # who asks twice does not want to wait
            self._asked.value = 1
        else:
            self._asked.value = 0
            signal.default_int_handler(number, frame)

    def __enter__(self) -> None:
        if threading.get_ident() == self._main:  # signals reach no other thread
            self._depth += 1

    def __exit__(self, *error: object) -> None:
        if threading.get_ident() == self._main:
            self._depth -= 1
            if self._asked.value and not self._depth:
                self._asked.value = 0
                raise KeyboardInterrupt


calls = _Calls()

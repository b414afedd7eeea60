"""Messages of FMUs: the callbacks that they are given, and the newest messages of each."""

import ctypes
import itertools
import os
from collections.abc import Callable, Collection
from typing import Any
from weakref import WeakValueDictionary

from fmpy import calloc, fmi2, free

from orchestrator.devices.sandbox.resource_limits import FLOODED

_KEPT = 50

try:  # printf-style arguments of native FMUs need fmpy's proxy; it is missing on some platforms
    from fmpy import logging as fmpy_logging
except (ImportError, OSError):
    fmpy_logging = None


class Messages(list[tuple[int, str]]):
    def __init__(self) -> None:
        super().__init__()
        self.streak = self.step = 0


def texts(messages: Collection[tuple[int, str]], least: int = 0) -> list[str]:
    """Distinct messages of at least that status, in order, oldest first."""
    if not messages:  # as after nearly every call
        return []
    return list(dict.fromkeys(text for status, text in messages if status >= least))


# called for each message: none, or the one that `on_message` sets
_guards: list[Callable[[Messages], None]] = []


def on_message(
    most: int, steps: Callable[[], int], keep: Callable[[list[tuple[int, str]]], None] | None = None
) -> None:
    """Watch what FMUs log in this process, and end it if one logs without end; for processes of foreign FMUs."""

    def guard(messages: Messages) -> None:
        now = steps()
        if messages.step != now:
            messages.step, messages.streak = now, 0
        messages.streak += 1
        if keep is not None and messages.streak < _KEPT:
            keep(messages)
        if messages.streak > most:
            os._exit(FLOODED)

    _guards[:] = [guard]


_message_lists: WeakValueDictionary[int, Messages] = WeakValueDictionary()
_next_environment = itertools.count(1)


def _receive(
    environment: int | None, _instance: bytes, status: int, _category: bytes, message: bytes
) -> None:
    messages = _message_lists.get(environment or 0)
    if messages is not None:
        messages.append((status, (message or b"").decode("utf-8", "replace")))
        del messages[:-_KEPT]
        for guard in _guards:
            guard(messages)


_receive_pointer = fmi2.fmi2CallbackLoggerTYPE(_receive)


def callbacks_for(messages: Messages) -> Any:
    """Callbacks whose messages end in one component's list.

    All components share one logger function, because fmpy's proxy keeps only the last one it was
    given; the component is told by its environment pointer."""
    environment = next(_next_environment)
    _message_lists[environment] = messages
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = _receive_pointer
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    callbacks.componentEnvironment = environment
    if fmpy_logging is not None:
        fmpy_logging.addLoggerProxy(ctypes.byref(callbacks))
    return callbacks

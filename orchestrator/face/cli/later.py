"""Words that a command says below its answer, such as questions about the input."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_waiting: list[list[Callable[[], None]]] = []
"""For each command that is at work, what it says at its end."""


@contextmanager
def answer_first() -> Iterator[None]:
    """Inside, `say_last` waits; what waits is said at the end, also of a command that fails."""
    own: list[Callable[[], None]] = []
    _waiting.append(own)
    try:
        yield
    finally:
        _waiting.pop()
        for say in own:
            say()


def say_last(say: Callable[[], None]) -> None:
    """Say something below the answer; at once where no command is at work."""
    if _waiting:
        _waiting[-1].append(say)
    else:
        say()

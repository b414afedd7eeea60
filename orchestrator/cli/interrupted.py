"""After Ctrl-C or SIGTERM: the last line of a command says how what was begun goes on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from orchestrator.fmi.interrupts import calls


@contextmanager
def saying_how_it_goes_on(words: Callable[[], str]) -> Iterator[None]:
    """Have an interrupt inside carry how the study goes on; `ending` says it.

    Parameters
    ----------
    words
        Asked after the interrupt; "" where nothing was kept.
    """
    try:
        yield
    except KeyboardInterrupt as error:
        if text := words():
            error.add_note(text)
        raise


def ending(error: BaseException) -> str:
    """How a command was ended and, where something was kept, how it goes on."""
    return ": ".join([calls.how, *getattr(error, "__notes__", ())])

"""After Ctrl-C or SIGTERM: the last line of a command says how what was begun goes on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from orchestrator.core.interrupts import calls


@contextmanager
def saying_how_it_goes_on(words: Callable[[], str]) -> Iterator[None]:
    """Have an interrupt inside carry how the study goes on; `ending` says it."""
    try:
        yield
    except BaseException as error:
        text = words() if is_interrupt(error) else ""
        if text:
            error.add_note(text)
        raise


def is_interrupt(error: BaseException | None) -> bool:
    """Return whether it is Ctrl-C or SIGTERM, or came after one: a library in C may have made another error of it."""
    if calls.taken:
        return True
    # an error that was kept and is raised again may stand behind its own cause
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        if isinstance(error, KeyboardInterrupt):
            return True
        seen.add(id(error))
        error = error.__cause__ or error.__context__
    return False


def ending(error: BaseException) -> str:
    return ": ".join([calls.how, *getattr(error, "__notes__", ())])

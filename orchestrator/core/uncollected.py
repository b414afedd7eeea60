"""Work that makes many objects and no circle of them, without the search for circles."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Leave the collection of circles out: it takes a third of the time in which a large network is read."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def stay_uncollected() -> None:
    """Leave all that there is now out of every later search for circles, as modules live as long as their process.

    Circles that are garbage already are never freed: this is for a process that has imported, and has not begun to
    work."""
    gc.freeze()

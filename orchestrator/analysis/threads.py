"""One thread for linear algebra on small or sparse matrices: many would only wait for each other."""

import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from typing import Any

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[Any]:
    """Inside, BLAS and its like take one thread."""
    limited: AbstractContextManager[Any] = _controller().limit(limits=1)
    return limited


_one_at_a_time = threading.Lock()


@contextmanager
def alone() -> Iterator[None]:
    """Inside, no other thread of this process is inside, and BLAS takes one thread; for points of a study.

    FMUs and the limit on BLAS belong to the whole process, whose workers may be threads of a Dask cluster. With one
    BLAS thread each, several workers do not fight, and rounding is the same everywhere.
    """
    with _one_at_a_time, one_thread():
        yield


@cache
def _controller() -> ThreadpoolController:
    """Looking for the libraries that are loaded takes milliseconds; they are there once SciPy is."""
    return ThreadpoolController()

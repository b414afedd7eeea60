"""One thread for linear algebra on small or sparse matrices: several threads would only wait for each other."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[Any]:
    """Inside ``with``, BLAS and similar libraries use one thread."""
    limited: AbstractContextManager[Any] = _controller().limit(limits=1)
    return limited


Found = TypeVar("Found")


@contextmanager
def beside(compute: Callable[[], Found]) -> Iterator[Future[Found]]:
    """Inside ``with``, another thread computes what is given; it has ended where the block ends.

    It pays where one side at least spends its time in linear algebra that lets other threads of Python run, as NumPy's
    does. BLAS uses one thread on each side, so that both cores work and no last digit depends on their number.

    Parameters
    ----------
    compute
        Must not touch an FMU, nor what the block changes.

    Yields
    ------
    Future
        Its ``result()`` raises what ``compute`` raised.
    """
    with one_thread(), ThreadPoolExecutor(1) as pool:
        yield pool.submit(compute)


_one_at_a_time = threading.Lock()


@contextmanager
def alone() -> Iterator[None]:
    """Inside ``with``, BLAS uses one thread, and other threads of this process wait until the block ends. Points of a
    study run in it.

    FMUs and the limit on BLAS belong to the whole process, whose workers may be threads of a Dask cluster. With one
    BLAS thread each, several workers do not fight, and rounding is the same everywhere.
    """
    with _one_at_a_time, one_thread():
        yield


@cache
def _controller() -> ThreadpoolController:
    """Looking for the libraries that are loaded takes milliseconds; they are there once SciPy is."""
    return ThreadpoolController()

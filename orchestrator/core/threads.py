"""One thread for linear algebra on small or sparse matrices: several threads would only wait for each other."""

import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from typing import Any

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[Any]:
    """Inside ``with``, BLAS and similar libraries use one thread."""
    controller = _controller("scipy.linalg" in sys.modules)
    limited: AbstractContextManager[Any] = controller.limit(limits=1)
    return limited


class _InTurn(Executor):
    """Computes what is submitted at once, in the thread that submits it."""

    def submit(self, compute: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        found: Future[Any] = Future()
        try:
            found.set_result(compute(*given, **named))
        except Exception as error:  # for whoever asks for the result
            found.set_exception(error)
        return found


@contextmanager
def side_by_side(*, pays: bool = True) -> Iterator[Executor]:
    """Inside ``with``, two more threads compute what is submitted; all of it has ended where the block ends.

    It pays for what spends its time in linear algebra that lets other threads of Python run, as NumPy's does. BLAS uses
    one thread on each side, so that both cores work and no last digit depends on their number. What is submitted must
    not touch an FMU, nor what the block changes.

    ``pays``: Whether it is worth two threads; else everything is computed in turn.

    Yields its ``submit(compute).result()`` raises what ``compute`` raised."""
    with one_thread(), ThreadPoolExecutor(2) if pays else _InTurn() as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)  # what has begun cannot be stopped
            raise


_one_at_a_time = threading.RLock()


@contextmanager
def alone() -> Iterator[None]:
    """Inside ``with``, BLAS uses one thread, and other threads of this process wait until the block ends. Points of a
    study run in it.

    FMUs and the limit on BLAS belong to the whole process, whose workers may be threads of a Dask cluster. With one
    BLAS thread each, several workers do not fight, and rounding is the same everywhere. The thread that is alone may
    ask for it again."""
    with _one_at_a_time, one_thread():
        yield


@cache
def _controller(with_scipy: bool) -> ThreadpoolController:
    """Looking for loaded libraries takes milliseconds: it is done for NumPy's, and once more when SciPy's are there."""
    return ThreadpoolController()

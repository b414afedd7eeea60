"""One thread for linear algebra on small or sparse matrices: many would only wait for each other."""

from contextlib import AbstractContextManager
from functools import cache
from typing import Any

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[Any]:
    """Inside, BLAS and its like take one thread."""
    limited: AbstractContextManager[Any] = _controller().limit(limits=1)
    return limited


@cache
def _controller() -> ThreadpoolController:
    """Looking for the libraries that are loaded takes milliseconds; they are there once SciPy is."""
    return ThreadpoolController()

"""A worker process that dies: which errors say so, and how often a task that lost its worker is tried again."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from orchestrator.core.errors import CosimError
from orchestrator.core.options import Option

Task = TypeVar("Task")
Result = TypeVar("Result")

ATTEMPTS = 3  # A task that has lost its worker this many times is given up


class WorkerLostError(CosimError):
    """The process that computed a task died every time."""


class WorkerLeftError(Exception):
    """A worker was told to leave what it was at; it takes nothing more."""


ENDED = (BrokenProcessPool, WorkerLeftError, SystemExit)
"""Errors of a future whose worker is gone, or was told to go."""


def try_again(
    new_pool: Callable[[], ProcessPoolExecutor], function: Callable[[Task], Result], task: Task
) -> Result | WorkerLostError:
    """Compute a task whose worker died, alone and in a fresh process, until it has had all its `ATTEMPTS`.

    ``new_pool``: Makes a pool of one worker."""
    for _ in range(ATTEMPTS - 1):
        pool = new_pool()
        try:
            return pool.submit(function, task).result()
        except ENDED:
            continue
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    return WorkerLostError(
        f"its worker process died {ATTEMPTS} times; is there too little memory? Try "
        "fewer " + Option.WORKERS + ", or this point alone with `gfor modes`"
    )

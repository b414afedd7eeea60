"""Tasks on the cores of this machine, in processes: FMUs with Python inside hold its lock, so threads would wait."""

import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import forkserver
from multiprocessing.context import BaseContext
from typing import Any

from orchestrator.points.executor import ATTEMPTS, Result, Task, WorkerLostError

_QUEUE_PER_WORKER = 2
"""Tasks under way for each worker; the second one waits there so that no worker does."""


_SAFE_PATH = "PYTHONSAFEPATH"


def number_of_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Processes:
    """Runs tasks in ``workers`` fresh Python processes, which are replaced where they die.

    Parameters
    ----------
    imports
        Modules that the tasks need. Where the system allows, they are imported once for all workers, from now on and
        in the background: importing takes seconds, in which the caller can prepare the tasks.
    """

    def __init__(self, workers: int, imports: Sequence[str] = ()) -> None:
        self.workers = workers
        self._context = _context(imports)
        self._pool: ProcessPoolExecutor | None = None  # starting a worker takes time

    def run(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | WorkerLostError]]:
        """See `Executor.run`."""
        waiting = deque(range(len(tasks)))
        while waiting:
            suspects = yield from self._run_together(function, tasks, waiting)
            # A dead worker takes the whole pool along and does not say which task it had. Those that were under
            # way are computed one at a time, so that only a task that really kills its worker is blamed for it.
            for index in suspects:
                yield index, self._run_alone(function, tasks[index])

    def _run_together(self, function: Callable[[Task], Result], tasks: Sequence[Task], waiting: deque[int]) -> Any:
        """Compute what is waiting; ends early, with what was under way, if a worker dies."""
        under_way: dict[Future[Result], int] = {}
        suspects: list[int] = []
        pool, whole = self._running_pool(), False
        try:
            while waiting or under_way:
                try:
                    while waiting and len(under_way) < _QUEUE_PER_WORKER * self.workers:
                        under_way[pool.submit(function, tasks[waiting[0]])] = waiting[0]
                        waiting.popleft()
                except BrokenProcessPool:
                    break
                done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    index = under_way.pop(future)
                    if isinstance(future.exception(), BrokenProcessPool):
                        suspects.append(index)
                    else:
                        yield index, future.result()
                if suspects:
                    break
            whole = not (waiting or under_way or suspects)
        finally:
            if not whole:  # a worker died, a task failed, or nobody wants the rest
                self.close()
        for future, index in under_way.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                yield index, future.result()
            else:
                suspects.append(index)
        return sorted(suspects)

    def _running_pool(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._pool = self._new_pool(self.workers)
        return self._pool

    def _new_pool(self, workers: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(workers, mp_context=self._context, initializer=_start_worker)

    def close(self) -> None:
        """See `Executor.close`."""
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.shutdown(wait=True, cancel_futures=True)

    def _run_alone(self, function: Callable[[Task], Result], task: Task) -> Result | WorkerLostError:
        for _ in range(ATTEMPTS - 1):
            pool = self._new_pool(1)
            try:
                return pool.submit(function, task).result()
            except BrokenProcessPool:
                continue
            finally:
                pool.shutdown(wait=True, cancel_futures=True)
        return WorkerLostError(
            f"its worker process died {ATTEMPTS} times; is there too little memory? Try fewer --workers, "
            "or this point alone with `gfor modes`"
        )


def _context(imports: Sequence[str]) -> BaseContext:
    """How workers start; on Linux as copies of a process that has done the imports and nothing else.

    A copy of this process itself would not be safe to use: it may have loaded FMUs and started threads. Elsewhere
    system libraries object to copies, and every worker does its imports itself.
    """
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(imports))
    # The user's folder is not on that process's path: a random.py there would be imported instead of Python's.
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        forkserver.ensure_running()
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before
    return context


def _start_worker() -> None:
    """Leave Ctrl-C to the parent, and end with it, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)

"""Tasks on the cores of this machine, in processes: FMUs with Python inside hold its lock, so threads would wait."""

import multiprocessing
import multiprocessing.util
import os
import signal
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import cache, partial
from multiprocessing import forkserver
from multiprocessing.context import BaseContext
from pathlib import Path
from types import FrameType
from typing import Any

from fmus.toolchain.temporary import leave, own_folder, remove
from orchestrator.core.interrupts import calls
from orchestrator.studies.points.lost_workers import (
    ENDED,
    Result,
    Task,
    WorkerLeftError,
    WorkerLostError,
    try_again,
)
from orchestrator.studies.points.main_guard import require_main_guard
from orchestrator.studies.points.under_way import join, tally

_QUEUE_PER_WORKER = 2
"""Number of tasks that each worker is given at once. The second task is ready when the first one ends, which keeps the
worker busy."""


_SAFE_PATH = "PYTHONSAFEPATH"

# length of a folder's path in which sockets' names are short enough: about 100 bytes may be had
_LONGEST = 60


class Processes:
    """Runs tasks in ``workers`` fresh Python processes, which are replaced where they die.

    ``imports``: modules that the tasks need. Where the system allows it, one process imports them in the background,
    once for all workers. Importing takes seconds, and the caller can prepare the tasks meanwhile."""

    def __init__(self, workers: int, imports: Sequence[str] = ()) -> None:
        require_main_guard()
        self.workers = workers
        self._context = _context(imports)
        self._pool: ProcessPoolExecutor | None = None  # starting a worker takes time
        self._at_work = False

    def run(
        self, function: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result | WorkerLostError]]:
        waiting = deque(range(len(tasks)))
        while waiting:
            suspects = yield from self._run_together(function, tasks, waiting)
            # A dead worker takes the whole pool along and does not say which task it had. Those that were under
            # way are computed one at a time, so that only a task that really kills its worker is blamed for it.
            for index in suspects:
                alone = partial(self._new_pool, 1)
                yield index, try_again(alone, partial(_computed, function), tasks[index])

    def _run_together(
        self, function: Callable[[Task], Result], tasks: Sequence[Task], waiting: deque[int]
    ) -> Any:
        """Compute the waiting tasks. If a worker dies, end early and return the tasks that were being computed."""
        under_way: dict[Future[Result], int] = {}
        suspects: list[int] = []
        self._pool = self._pool or self._new_pool(self.workers)
        pool, whole = self._pool, False
        self._at_work = True
        try:
            while waiting or under_way:
                try:
                    while waiting and len(under_way) < _QUEUE_PER_WORKER * self.workers:
                        with calls:  # a worker that is only half known could not be ended
                            under_way[pool.submit(_computed, function, tasks[waiting[0]])] = (
                                waiting[0]
                            )
                        waiting.popleft()
                except BrokenProcessPool:
                    break
                done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    index = under_way.pop(future)
                    if isinstance(future.exception(), ENDED):
                        suspects.append(index)
                    else:
                        yield index, future.result()
                if suspects:
                    break
            whole = not (waiting or under_way or suspects)
            self._at_work = not whole
        finally:
            if not whole:  # a worker died, a task failed, or nobody wants the rest
                self.close()
        for future, index in under_way.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                yield index, future.result()
            else:
                suspects.append(index)
        return sorted(suspects)

    def _new_pool(self, workers: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            workers, mp_context=self._context, initializer=_start_worker, initargs=(tally(),)
        )

    def close(self) -> None:
        pool, self._pool = self._pool, None
        if pool is not None:
            if self._at_work:
                _end_workers(pool)
            pool.shutdown(wait=True, cancel_futures=True)


def _context(imports: Sequence[str]) -> BaseContext:
    """How workers start; on Linux as copies of a process that has done the imports and nothing else.

    A copy of this process itself would not be safe to use: it may have loaded FMUs and started threads. Elsewhere
    system libraries object to copies, and every worker does its imports itself."""
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(imports))
    # The user's folder is not on that process's path: a random.py there would be imported instead of Python's.
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        _sockets_in_an_own_folder()
        forkserver.ensure_running()
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before
    return context


@cache
def _sockets_in_an_own_folder() -> None:
    """Have multiprocessing put its folder into one that is swept once this process is gone, however it ended."""
    folder, before = own_folder("sockets"), tempfile.tempdir
    if len(os.fsencode(folder)) > _LONGEST:
        remove(folder)
        return
    tempfile.tempdir = str(folder)
    try:
        multiprocessing.util.get_temp_dir()
    finally:
        tempfile.tempdir = before
    leave(folder)  # whichever of the two modules was imported first
    # it removes its own at -100
    multiprocessing.util.Finalize(None, remove, args=(folder,), exitpriority=-101)


class _Work:
    busy = leaving = own = False


def in_own_worker() -> bool:
    """Return whether this process is a worker of `Processes`: it ends with its study, so an FMU may stay open in it."""
    return _Work.own


def _end_workers(pool: ProcessPoolExecutor) -> None:
    """Have the workers leave what they are at; their FMUs end, and their temporary folders are removed.

    The workers themselves stay until the pool lets them go: one that dies under way can hold the pool up for ever."""
    for process in list((pool._processes or {}).values()):
        process.terminate()


def _computed(function: Callable[[Task], Result], task: Task) -> Result:
    """In a worker: the result of a task, unless SIGTERM came."""
    if _Work.leaving:
        raise WorkerLeftError
    _Work.busy = True
    try:
        return function(task)
    except BaseException as error:
        if _Work.leaving or isinstance(error, SystemExit | KeyboardInterrupt):
            raise WorkerLeftError from None  # all that the task had opened is closed by now
        raise
    finally:
        _Work.busy = False


def _leave(number: int, frame: FrameType | None) -> None:
    """On SIGTERM: leave the task, but no FMU in the middle of a call."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # who asks twice does not want to wait
    _Work.leaving = True
    if _Work.busy:
        calls.leave(frame)


def _start_worker(file: Path | None) -> None:
    """Ignore Ctrl-C, which the parent handles, leave a task on SIGTERM, and end when the parent ends for any reason.

    ``file``: into which parts that are done are told; None where nobody counts."""
    join(file)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    _Work.own = True
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)

"""Scenarios of a command side by side: each in a copy of this process, as many at a time as there are cores for them.

The copies are made before an FMU is loaded or anything is drawn, so that nothing is imported or prepared twice, and no
thread of ours is lost in them. A scenario's files are written by its copy; its result comes back through a pipe. Linux
alone copies a process safely; elsewhere scenarios run one after the other."""

import os
import signal
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any, cast

from fmus.toolchain import temporary
from orchestrator.core.cores import number_of_cores
from orchestrator.core.errors import CosimError, ErrorKind, RunInterruptedError
from orchestrator.core.interrupts import calls
from orchestrator.devices.sandbox.kernel_calls import die_with_parent
from orchestrator.face.cli.interrupted import is_interrupt
from orchestrator.studies.runs.run import RunResult

Outcome = RunResult | BaseException

Report = Callable[[int, int], None]  # told how many steps are done, of how many
_HELD_BACK = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)  # until all copies are made
_PATIENCE = 20.0  # how long a copy that was told to end is waited for [s]


def number_of_workers(asked: int | None, scenarios: int) -> int:
    if sys.platform != "linux" or threading.current_thread() is not threading.main_thread():
        return 1
    return min(scenarios, asked or number_of_cores())


class SideBySide:
    """Inside ``with``: ``number`` copies of this process that do ``work(index, report)``."""

    def __init__(self, number: int, work: Callable[[int, Report], Outcome]) -> None:
        self._number, self._work = number, work
        self._copies: dict[Connection, int] = {}  # the process of each, by our end of its pipe

    def __enter__(self) -> "SideBySide":
        try:
            self._make()
        except BaseException as error:  # also a signal that waited until all were made
            self.__exit__(type(error))
            raise
        return self

    def _make(self) -> None:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _HELD_BACK)
        came: list[int] = []  # signals that another thread took, which blocks none
        handlers = _note_signals(came)
        try:
            for _ in range(self._number):
                ours, theirs = Pipe()
                parent = os.getpid()
                with warnings.catch_warnings():
                    # BLAS ends its threads before a copy is made
                    warnings.simplefilter("ignore", DeprecationWarning)
                    process = os.fork()
                if not process:
                    _handle_signals(handlers)
                    for other in (ours, *self._copies):
                        other.close()
                    _serve(parent, theirs, self._work, blocked)
                theirs.close()
                self._copies[ours] = process
        finally:
            _handle_signals(handlers)
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
            for number in came:
                signal.raise_signal(number)

    def outcomes(
        self, count: int, report: Callable[[int, int, int], None]
    ) -> list[tuple[int, Outcome]]:
        """Return what came of all that were begun, in order.

        After one that failed no other is begun. Ctrl-C and SIGTERM end all that are under way, at their next step.

        ``report``: told the index, and how many of its steps are done of how many."""
        waiting, idle = list(range(count)), [*self._copies]
        under_way: dict[Connection, int] = {}
        done: dict[int, Outcome] = {}
        told = False
        while True:
            try:
                with calls:
                    while waiting and idle:
                        pipe = idle.pop(0)
                        under_way[pipe] = waiting.pop(0)
                        # a copy that died while it was idle is found below
                        with suppress(BrokenPipeError):
                            pipe.send(under_way[pipe])
                if not under_way:
                    break
                for pipe in cast("list[Connection]", wait(list(under_way))):
                    with calls:  # a message that was read in part would be lost
                        said = self._received(pipe)
                        if isinstance(said, tuple):
                            report(under_way[pipe], *said)
                            continue
                        done[under_way.pop(pipe)] = said
                        if pipe in self._copies:
                            idle.append(pipe)
                        if isinstance(said, BaseException) or said.failure is not None:
                            waiting.clear()
            except KeyboardInterrupt:
                if told:
                    raise
                told = True
                waiting.clear()
                for pipe in under_way:
                    os.kill(
                        self._copies[pipe], signal.SIGTERM if calls.terminated else signal.SIGUSR1
                    )
        if told and not any(_was_interrupted(outcome) for outcome in done.values()):
            if len(done) == count:
                raise KeyboardInterrupt  # it came when all was done but what concerns all scenarios
            done[min({*range(count)} - {*done})] = KeyboardInterrupt()
        return sorted(done.items(), key=lambda one: one[0])

    def _received(self, pipe: Connection) -> tuple[int, int] | Outcome:
        try:
            return cast("tuple[int, int] | Outcome", pipe.recv())
        except (EOFError, ConnectionResetError):
            _, status = os.waitpid(self._copies.pop(pipe), 0)
            if calls.taken:
                return KeyboardInterrupt()
            code = os.waitstatus_to_exitcode(status)
            how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
            return CosimError(
                f"its process ended {how}; is there too little memory? --workers 1 runs one scenario after the other",
                kind=ErrorKind.WORKER_LOST,
            )

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with calls:
            for pipe, process in self._copies.items():
                if kind is not None:
                    os.kill(process, signal.SIGTERM)
                pipe.close()  # who waits for work finds that there is none
            end = time.monotonic() + _PATIENCE
            for process in self._copies.values():
                while not os.waitpid(process, os.WNOHANG)[0]:
                    if time.monotonic() > end:
                        os.kill(process, signal.SIGKILL)
                    time.sleep(0.005)
            self._copies.clear()


def _note_signals(came: list[int]) -> dict[signal.Signals, Any]:
    """Let signals be noted only, and return what handled them; a thread that is not the main one handles none."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    return {one: signal.signal(one, lambda number, _: came.append(number)) for one in _HELD_BACK}


def _handle_signals(handlers: Mapping[signal.Signals, Any]) -> None:
    """Let signals be handled as before; one that no code of Python handled is left to the system."""
    for one, handler in handlers.items():
        signal.signal(one, signal.SIG_DFL if handler is None else handler)


def _was_interrupted(outcome: Outcome) -> bool:
    error = outcome.failure if isinstance(outcome, RunResult) else outcome
    return isinstance(error, RunInterruptedError | KeyboardInterrupt)


def _serve(
    parent: int,
    pipe: Connection,
    work: Callable[[int, Report], Outcome],
    mask: set[int | signal.Signals],
) -> None:
    """In a copy: do what is asked for until the pipe ends, or the original does; never return.

    Ctrl-C of a terminal, which reaches every process, is the original's to pass on, as SIGUSR1."""
    code = 1
    try:
        die_with_parent(signal.SIGKILL)
        temporary.in_a_copy()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGUSR1, calls.take)
        with calls.terminable(ending=True):
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            while os.getppid() == parent:
                index = pipe.recv()
                outcome = _outcome(index, pipe, work)
                with calls:
                    pipe.send(outcome)
    except (EOFError, BrokenPipeError, ConnectionResetError, KeyboardInterrupt):
        code = 0  # nobody wants more
    except BaseException:
        traceback.print_exc()
    finally:
        temporary.remove_own()
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code)


def _outcome(index: int, pipe: Connection, work: Callable[[int, Report], Outcome]) -> Outcome:
    def report(done: int, total: int) -> None:
        with calls:
            pipe.send((done, total))

    try:
        return work(index, report)
    except BaseException as error:
        if is_interrupt(error):
            return KeyboardInterrupt()
        raise

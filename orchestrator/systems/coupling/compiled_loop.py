"""The inner loop of the master, compiled: one call into C does many communication steps, on one thread or several.

Python starts the threads and they never run its code: they stay in C (``team.c``) until they are dismissed. One that
logs in the name of an FMU waits for Python's lock, which the caller gives away while it waits for the others. Two
threads that write to one line of the processor's cache wait for each other."""

import ctypes
import logging
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from threading import Thread
from time import perf_counter
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import DTypeLike, NDArray

from fmus.toolchain.compiler import compile_here
from orchestrator.core.cores import MOST_THREADS, number_of_cores
from orchestrator.core.interrupts import calls
from orchestrator.systems.coupling.noted_steps import NotedSteps
from orchestrator.systems.coupling.sharing import Trial, best_number, shares, worth_sharing
from orchestrator.systems.coupling.tracks import Tracks
from orchestrator.systems.coupling.turns import Turn, not_finite

LINE = 128  # bytes that a processor may fetch together: two lines of 64


def apart(count: int, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """An array of zeros, shape (count,), that shares no line with anything else."""
    size = count * np.dtype(dtype).itemsize
    memory = np.zeros(size + 2 * LINE, dtype=np.uint8)
    first = -memory.ctypes.data % LINE
    return memory[first : first + size].view(dtype)


_LOG = logging.getLogger("gfor")


class Team:
    """Threads beside the calling one; `dismiss` ends them, at the latest where Python ends."""

    def __init__(self, library: Any, members: int) -> None:
        self._memory = apart(-(-library.team_size() // 8), np.float64)
        self.address: int = self._memory.ctypes.data
        unlocked = ctypes.CDLL(library._name)
        unlocked.team_work.argtypes = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64]
        unlocked.team_work.restype = None
        threads: list[Thread] = []
        since = library.team_round(self.address)
        try:
            for k in range(1, min(members, MOST_THREADS)):
                arguments = self.address, k, since
                threads.append(
                    Thread(
                        target=unlocked.team_work,
                        args=arguments,
                        name=f"gfor step {k}",
                        daemon=True,
                    )
                )
                threads[-1].start()
        except RuntimeError as error:
            threads.pop()
            _LOG.warning(
                "%d threads were wanted, and the system starts %d: %s",
                members,
                1 + len(threads),
                error,
            )
        self.members = 1 + len(threads)
        unlock, lock = (
            ctypes.cast(function, ctypes.c_void_p)
            for function in (
                ctypes.pythonapi.PyEval_SaveThread,
                ctypes.pythonapi.PyEval_RestoreThread,
            )
        )
        library.team_form(self.address, self.members, unlock, lock)
        self.dismiss = finalize(self, _dismiss, library, self._memory, threads)


def _dismiss(library: Any, memory: Any, threads: list[Thread]) -> None:
    library.team_dismiss(memory.ctypes.data)
    for thread in threads:
        thread.join()


SOURCES = ("team.c", "inner_loop.c")  # compiled as one
_FUNCTIONS = {1: "fmi2SetReal", 2: "fmi2DoStep", 3: "fmi2GetReal"}
_NOTE = 4  # a reading of `NotedSteps`
_NOT_FINITE = -1

_LOOKED_AT = 20
"""Communication steps over which a call's time is averaged; the least average of several counts, because others use
the processor as well."""

SIDE_BY_SIDE = 8
"""Instances that step together: as many numbers as a wide register holds (``LANES`` of lanes.h)."""

FEWEST = 3
"""Instances that are sooner together than one by one."""

# communication steps after which the calls are shared out anew
_BALANCED_AT = (100, 1000, 10_000, 100_000)


class _Call(ctypes.Structure):
    _fields_ = (
        ("component", ctypes.c_void_p),
        ("set_real", ctypes.c_void_p),
        ("get_real", ctypes.c_void_p),
        ("step", ctypes.c_void_p),
        ("input_references", ctypes.c_void_p),
        ("output_references", ctypes.c_void_p),
        ("inputs", ctypes.c_void_p),
        ("outputs", ctypes.c_void_p),
        ("sources", ctypes.c_void_p),
        ("n_inputs", ctypes.c_int64),
        ("n_outputs", ctypes.c_int64),
        ("fresh", ctypes.c_void_p),
        ("spent", ctypes.c_double),
        ("tracks", ctypes.c_void_p),
        ("status", ctypes.c_int32),
        ("stage", ctypes.c_int32),
        ("stack", ctypes.c_void_p),
    )


class _Stack(ctypes.Structure):
    _fields_ = (
        ("step", ctypes.c_void_p),
        ("components", ctypes.c_void_p),
        ("calls", ctypes.c_void_p),
        ("status", ctypes.c_void_p),
        ("n", ctypes.c_int64),
    )


class _Group(ctypes.Structure):
    _fields_ = (
        ("first", ctypes.c_int64),
        ("last", ctypes.c_int64),
        ("own", ctypes.c_void_p),
        ("shared", ctypes.c_void_p),
        ("begin", ctypes.c_void_p),
        ("n_own", ctypes.c_int64),
    )


@cache
def loop_library() -> Any | None:
    try:
        # PyDLL keeps Python's lock: Python-backed FMUs would only take it back at every call.
        library = ctypes.PyDLL(
            str(compile_here(*(Path(__file__).with_name(name) for name in SOURCES)))
        )
    except (OSError, RuntimeError):
        return None
    address, integer = ctypes.c_void_p, ctypes.c_int64
    library.advance.argtypes = [
        *(address, address, integer, address, address, address, integer, integer),
        *(ctypes.c_double, address),
    ]
    library.advance_lines.argtypes = [
        *(address, address, integer, address, address, address, address),
        *(integer, integer, integer, integer, ctypes.c_double, address),
    ]
    library.team_size.restype = ctypes.c_size_t
    library.team_round.restype = integer
    library.team_round.argtypes = library.team_dismiss.argtypes = [address]
    library.team_form.argtypes = [address, integer, address, address]
    library.team_form.restype = library.team_dismiss.restype = None
    return library


class CompiledLoop:
    """Steps a system in C.

    Instances of one of our native FMUs step together, as many as a processor's registers take side by side. The first
    communication steps are done by one thread; by what each call took then, the calls of a group are shared out. Who
    does a call changes no value, nor who steps beside it. Without a number of ``threads``, as many step as make a step
    shortest."""

    def __init__(
        self,
        library: Any,
        groups: Sequence[Sequence[Turn]],
        y: NDArray[np.float64],
        tracks: Tracks,
        threads: int | None = 1,
    ) -> None:
        self._library, self._y, self._tracks = library, y, tracks
        self._place = y.ctypes.data  # asked once: NumPy makes an object for each answer
        self._exchanges = [exchange for group in groups for exchange in group]
        n = len(self._exchanges)
        self._memory = apart(n * ctypes.sizeof(_Call), np.uint8)
        self._calls = (_Call * n).from_buffer(self._memory.data)
        self._spent = self._memory.view(np.float64)[
            _Call.spent.offset // 8 :: ctypes.sizeof(_Call) // 8
        ]
        self._groups = (_Group * len(groups))()
        self._members: list[range] = []
        self._failure = (ctypes.c_int64 * 3)()
        self.completed = 0
        self.rows: NotedSteps | None = None  # that an observer takes
        self.before: NDArray[np.float64] | None = None
        first = 0
        for group, entry in zip(groups, self._groups, strict=True):
            entry.first, entry.last = first, first + len(group)
            self._members.append(range(first, first + len(group)))
            first += len(group)
        for call, exchange in zip(self._calls, self._exchanges, strict=True):
            self._fill(call, exchange)
        self._threads = threads
        self._leader = np.arange(n)  # of each call: who is done for it too
        self._stacks: list[tuple[_Stack, NDArray[Any], NDArray[Any], NDArray[Any]]] = []
        self._waiting: list[NDArray[np.float64]] = []  # outputs of stacks
        self._led: list[list[int]] = [self._stack_up(group) for group in self._members]
        self._bound = np.array([e.component.one_thread is not None for e in self._exchanges])
        self._team: Team | None = None
        self._kept: list[NDArray[Any]] = []
        self._trial = Trial() if threads is None else None
        self._done = self._looked = self._together = 0
        self._costs, self._spent_then = np.full(n, np.inf), np.zeros(n)
        shareable = threads != 1 and any(worth_sharing(group, self._bound) for group in self._led)
        self._balance_at = list(_BALANCED_AT) if shareable else []

    def _fill(self, call: _Call, exchange: Turn) -> None:
        def address(function: Any) -> int | None:
            return ctypes.cast(function, ctypes.c_void_p).value

        component = exchange.component
        call.component = component.pointer
        call.set_real, call.get_real = address(component.set_real), address(component.get_real)
        call.step = address(component.do_step)
        _, call.input_references, call.n_inputs, call.inputs = exchange.inputs.arguments
        _, call.output_references, call.n_outputs, call.outputs = exchange.outputs.arguments
        call.sources = exchange.delivered.ctypes.data
        call.tracks = self._tracks.address(exchange.window.start or 0)

    def _stack_up(self, group: range) -> list[int]:
        """Let calls of one function step together; returns the calls that are done by themselves or for others."""
        alike: dict[int, list[int]] = {}
        for call in group:
            component = self._exchanges[call].component
            if component.step_stack is not None:
                key = ctypes.cast(component.step_stack, ctypes.c_void_p).value or 0
                alike.setdefault(key, []).append(call)
        for function, of in alike.items():
            # each thread that is asked for gets its part
            size = min(SIDE_BY_SIDE, -(-len(of) // (self._threads or 1)))
            for first in range(0, len(of), size):
                calls_together = of[first : first + size]
                if len(calls_together) >= FEWEST:
                    self._stack(function, calls_together)
        return [call for call in group if self._leader[call] == call]

    def _stack(self, function: int, members: list[int]) -> None:
        components = np.array([self._calls[k].component for k in members], dtype=np.uint64)
        places, status = np.array(members, dtype=np.int64), apart(len(members), np.int32)
        stack = _Stack(
            step=function,
            components=components.ctypes.data,
            calls=places.ctypes.data,
            status=status.ctypes.data,
            n=len(members),
        )
        self._stacks.append((stack, components, places, status))
        self._waiting.append(self._fresh(members))
        self._leader[members] = members[0]
        for call in members:
            self._calls[call].stack = ctypes.addressof(stack)

    def _fresh(self, members: Sequence[int]) -> NDArray[np.float64]:
        """Let the outputs of calls wait in memory of their own, which is returned."""
        fresh = apart(sum(self._calls[call].n_outputs for call in members))
        place = fresh.ctypes.data
        for call in members:
            self._calls[call].fresh = place
            place += fresh.itemsize * self._calls[call].n_outputs
        return fresh

    def advance(self, index: int, count: int, step_size: float) -> None:
        status = 0
        self.completed = 0
        rows = None if self.rows is None else self.rows.address
        with calls:
            while self.completed < count and not status:
                part, team = self._next(count - self.completed)
                begun = perf_counter()
                status = self._library.advance(
                    ctypes.addressof(self._calls),
                    ctypes.addressof(self._groups),
                    len(self._groups),
                    None if team is None else team.address,
                    self._place,
                    rows,
                    index + self.completed,
                    part,
                    step_size,
                    ctypes.addressof(self._failure),
                )
                self.completed = self._failure[0] - index if status else self.completed + part
                if not status:
                    self._note(part, perf_counter() - begun, team)
        self._judge(status, step_size)

    def _judge(self, status: int, step_size: float) -> None:
        if status == _NOT_FINITE:
            outputs = self._exchanges[self._failure[1]].outputs
            raise not_finite(outputs, self._failure[2], (self._failure[0] + 1) * step_size)
        done, place, stage = self._failure
        if status and stage == _NOTE and self.rows is not None:
            self.rows.component(place).check(status, "fmi2GetReal", done * step_size)
        elif status:
            component = self._exchanges[place].component
            component.check(status, _FUNCTIONS[stage], done * step_size)

    def _next(self, count: int) -> tuple[int, Team | None]:
        """How many communication steps are next, at most ``count``, and who does them; None is the caller alone."""
        if self._team is None:
            return (
                min(count, _LOOKED_AT)
                if self._done < _BALANCED_AT[0] and self._balance_at
                else count
            ), None
        if self._balance_at:
            count = min(count, self._balance_at[0] - self._done)
        if self._trial is None:
            return count, self._team
        return min(count, self._trial.most), self._team if self._trial.together else None

    def _note(self, steps: int, seconds: float, team: Team | None) -> None:
        """Note what calls took, and share them out when it is time."""
        self._done += steps
        self._together += steps if team is not None else 0
        if self._team is not None and self._trial is not None:
            self._trial.took(steps, seconds)
        if not self._balance_at:
            return
        if self._done >= self._looked + _LOOKED_AT:
            averages = (self._spent - self._spent_then) / (self._done - self._looked)
            led = np.bincount(self._leader, averages, len(averages))
            np.minimum(self._costs, led, out=self._costs)
            self._looked, self._spent_then = self._done, self._spent.copy()
        if self._done < self._balance_at[0]:
            return
        del self._balance_at[0]
        self._share()
        self._costs[:] = np.inf

    def _share(self) -> None:
        wanted = self._threads
        if wanted is None:
            wanted = best_number(self._led, self._bound, self._costs, number_of_cores())
        if self._team is None and wanted > 1:
            self._team = Team(self._library, wanted)
        members = 1 if self._team is None else self._team.members
        self._kept = []
        for group, entry in zip(self._led, self._groups, strict=True):
            entry.begin = None
            if members > 1 and worth_sharing(group, self._bound):
                self._share_group(group, entry, members)

    def _share_group(self, group: list[int], entry: _Group, members: int) -> None:
        found = shares(group, self._bound, self._costs, members)
        own, shared = (np.array(part, dtype=np.int64) for part in (found.own, sum(found.of, ())))
        begin = np.cumsum([0, *map(len, found.of)])
        entry.own, entry.shared, entry.begin = (
            own.ctypes.data,
            shared.ctypes.data,
            begin.ctypes.data,
        )
        entry.n_own = len(own)
        self._kept += [own, shared, begin]
        for part in (found.own, *found.of):
            self._kept.append(self._fresh([call for call in part if not self._calls[call].stack]))

    def seconds(self) -> list[float]:
        seconds: list[float] = self._spent.tolist()
        return seconds

    @property
    def threads(self) -> int:
        return 1 if self._team is None or 2 * self._together < self._done else self._team.members

    def close(self) -> None:
        if self._team is not None:
            self._team.dismiss()

"""The process of a foreign FMU that is checked, seen from outside: it is asked for measurements, never for a verdict.

What comes from it lies in memory that the FMU's code can write. So it is taken for what the FMU says, of the form that
was asked for, and nothing else in this process is in the FMU's reach."""

from collections.abc import Callable, Sequence
from ctypes import c_uint, memmove
from dataclasses import asdict
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import ComponentError, InputError
from orchestrator.devices.acceptance.linear_network import LinearNetwork
from orchestrator.devices.acceptance.shifted_clock import for_shifts
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import FmuDescription, runs_under_wine
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.devices.fmi.refused_calls import FATAL, refusal
from orchestrator.devices.fmi.remote_calls import Form, RemoteCalls
from orchestrator.devices.sandbox import answer_forms
from orchestrator.devices.sandbox.foreign_process import ConfinedProcess
from orchestrator.devices.sandbox.mailbox import (
    GET,
    MOST,
    ROOM,
    RUN,
    SET,
    STEP,
    TALK,
    unlocked_library,
)
from orchestrator.devices.sandbox.process_end import ProcessFault
from orchestrator.devices.sandbox.protections_in_force import Protection
from orchestrator.devices.sandbox.resource_limits import TO_BEGIN, Limits, crowded

_STAGES = {SET: "fmi2SetReal", STEP: "fmi2DoStep", GET: "fmi2GetReal"}
_GRACE = 1.0  # time [s] in which what an instance started may end after it
_SHOWN = 3  # processes that an error names
_SLOW = 5e-3  # time [s] that a step may take of an FMU that is slow and does not hang
_LOOK = 0.05  # time [s] after which it is looked whether the process is still there


class ProcessEndedError(Exception):
    """The FMU's process is gone, or was given up; no error of the FMU's, so no check takes it for a refusal."""

    def __init__(self, fault: ProcessFault, how: str) -> None:
        self.fault, self.how = fault, how
        super().__init__(f"{fault}: {how}")


class FmuProcess:
    """A process with instances of one FMU.

    ``clock_shift``: by how many seconds date and time of day are later than they are.
    ``deadline``: `time.monotonic` after which no answer is waited for.
    ``protections``: What keeps it from the rest of the machine."""

    def __init__(
        self, description: FmuDescription, directory: Path, limits: Limits, clock_shift: int = 0
    ) -> None:
        self.description, self.limits = description, limits
        self.deadline = inf
        self.time = 0.0
        self.protections: tuple[Protection, ...] = ()
        self._ended: ProcessEndedError | None = None
        self._interrupted: BaseException | None = None
        self._number, self._patience, self._instances = 0, TO_BEGIN, 0
        self._library = unlocked_library()
        fmu = description.path.resolve()
        port = asdict(description.port) if isinstance(description, BoundDescription) else None
        request = {
            "fmu": str(fmu),
            "port": port,
            "directory": str(directory),
            "clock_shift": clock_shift,
        }
        self._process = ConfinedProcess(
            "orchestrator.devices.acceptance.worker",
            request,
            [fmu, directory],
            limits,
            windows=runs_under_wine(description),
            variables=for_shifts() if clock_shift else None,
        )
        try:
            self.box = self._process.box
            self._into, self._out = (self.box.array(which, np.uint32, MOST) for which in (0, 1))
            self._room = self.box.array(2, np.float64, ROOM)
            self._begin()
        except BaseException:
            self.close()
            raise

    def _begin(self) -> None:
        try:
            self.protections = self.typed(
                answer_forms.protections, self.talk("the beginning of its process", -1, "begin")
            )
        except ProcessEndedError as error:  # the FMU is not loaded yet
            raise InputError(f"the FMU's process did not start: {error.how}") from error
        self._patience = self.limits.seconds

    @property
    def alive(self) -> bool:
        return self._ended is None

    def talk(self, call: str, instance: int, command: str, *arguments: Any) -> Any:
        """Have something done that needs more than numbers."""
        if self._ended is not None:
            raise self._ended
        self.box.clear_log()
        self.box.write_text([instance, command, *arguments])
        self._ask(TALK, call)
        try:
            return answer_forms.content_of(self.box.read_text(), "fmu")
        except ValueError as error:
            raise self._tampered(f"{error}") from error

    def run(
        self,
        instance: int,
        into: NDArray[np.uint32],
        rows: Numbers,
        out: NDArray[np.uint32],
        steps: int = 0,
        time: float = 0.0,
        step_size: float = 0.0,
        network: LinearNetwork | None = None,
    ) -> tuple[int, int, int, Numbers]:
        """Set inputs, step and read, as often as asked.

        ``into``, ``out``: Value references that are set before a step, and read after it.
        ``rows``: Their values, shape (n, len(into)): one row a step, and none for the steps after the last row.
        ``steps``: How many; with 0 the first row is set and one row read, without a step.
        ``time``: At which the first step starts [s].
        ``step_size``: Communication step [s].
        ``network``: What the instance stands at, with one row that stays; its state moves on.

        Returns of the call that was refused, or 0 or 1; what that call is; how many steps were finished; what was read,
        shape (steps, len(out)), or one row without a step."""
        if self._ended is not None:
            raise self._ended
        if max(len(into), len(out)) > MOST:
            raise InputError(
                f"{max(len(into), len(out))} variables cannot be exchanged at once; {MOST} can"
            )
        head, asked = self.box.head, self.box.run
        length, values = max(1, steps), np.empty((max(1, steps), len(out)))
        beside = np.empty(0) if network is None else network.numbers
        chunk = max(1, (ROOM - beside.size) // max(1, len(into) + len(out)))
        asked.n_network = 0 if network is None else len(network.x)
        for begin in range(0, length, chunk):
            some = np.ascontiguousarray(rows if network else rows[begin : begin + chunk])
            count = min(chunk, length - begin)
            asked.instance, asked.n_steps, asked.n_rows = instance, min(count, steps), len(some)
            asked.n_in, asked.n_out = len(into), len(out)
            head.time, head.step = time + begin * step_size, step_size
            self._into[: len(into)], self._out[: len(out)] = into, out
            self._room[: some.size] = some.ravel()
            behind = some.size + max(1, min(count, steps)) * len(out)
            if network is not None:
                self._room[behind : behind + beside.size] = network.numbers
            self.time = head.time
            asked_at = monotonic()
            status = self._ask(RUN, "")
            self.deadline += min(monotonic() - asked_at, _SLOW * min(count, steps))
            done = min(max(0, asked.done), count)
            self.time = time + (begin + done) * step_size
            read = self._room[some.size : some.size + count * len(out)]
            values[begin : begin + count] = read.reshape(count, len(out))
            if network is not None:
                network.x = self._room[behind : behind + len(network.x)].copy()
            if status > 1:
                return status, asked.stage, begin + done, values
        return status, 0, length, values

    def number(self, call: str, instance: int, command: str, *arguments: Any) -> int:
        """Talk, and take a whole number alone for an answer."""
        return self.typed(answer_forms.number, self.talk(call, instance, command, *arguments))

    def typed(self, form: Callable[..., Form], answer: Any, *wanted: Any) -> Form:
        try:
            return form(answer, *wanted)
        except answer_forms.NotAnAnswerError as error:
            raise self._tampered(f"{error}") from error

    def _ask(self, kind: int, call: str) -> int:
        """Ask and wait; the status, or an error that says how the process ended.

        After an interrupt nothing more is asked: the answer to the question before would be taken for one that nobody
        asked for."""
        if self._interrupted is not None:
            raise self._interrupted
        try:
            return self._answer(kind, call)
        except (KeyboardInterrupt, SystemExit) as interrupt:
            self._interrupted = interrupt
            raise

    def _answer(self, kind: int, call: str) -> int:
        self._number += 1
        box, wait, begin, steps = (
            self.box,
            self._library.mailbox_wait,
            monotonic(),
            self.box.head.steps,
        )
        self._library.mailbox_post(box.address, kind, self._number)
        while not (answered := wait(box.address, self._number, _LOOK)):
            now = monotonic()
            if not self._process.running:
                answered = wait(box.address, self._number, 0.0)
                if answered:
                    break  # with its last breath
                raise self._died(call)
            if box.head.steps != steps:
                steps, begin = box.head.steps, now
            if now - begin > self._patience and now - begin > (
                allowed := self._patience * crowded()
            ):
                raise self._given_up(f"no answer within {allowed:.3g} s in {self._where(call)}")
            if now > self.deadline:
                raise self._given_up(f"it takes too long, last in {self._where(call)}")
        if answered < 0:
            raise self._tampered("an answer that was not asked for")
        return int(box.head.status)

    def _where(self, call: str) -> str:
        call = call or _STAGES.get(self.box.run.stage, "fmi2DoStep")
        time = self.time + (
            max(0, self.box.run.done) * self.box.head.step if call == "fmi2DoStep" else 0.0
        )
        return f"{call}, at t = {time:.6g} s"

    def _tampered(self, seen: str) -> ProcessEndedError:
        return self._end(
            ProcessFault.TAMPERING, f"it wrote into the memory between the processes: {seen}"
        )

    def _given_up(self, how: str) -> ProcessEndedError:
        return self._end(ProcessFault.HANG, how)

    def _died(self, call: str) -> ProcessEndedError:
        fault, how = self._process.fault()
        said = "" if fault is ProcessFault.OUTPUT else self._process.last_words()
        return self._end(
            fault, f"{how} in {self._where(call)}{f'; it wrote: {said}' if said else ''}"
        )

    def _end(self, fault: ProcessFault, how: str) -> ProcessEndedError:
        self._process.end()
        self._ended = ProcessEndedError(fault, how)
        return self._ended

    def opened(self, name: str) -> int:
        """The number of a new instance."""
        number = self.number("fmi2Instantiate", -1, "open", name)
        self._instances += 1
        return number

    def freed(self) -> None:
        """Look what instances leave behind, once none is open; what still runs then is the FMU's fault.

        Under Wine it is not looked: Windows's own programs stay."""
        self._instances -= 1
        if self._instances or not self.alive or runs_under_wine(self.description):
            return
        left = self._process.left_behind(_GRACE)
        if left:
            more = f" and {len(left) - _SHOWN} more" if len(left) > _SHOWN else ""
            raise self._end(
                ProcessFault.LEFT,
                f"after its last instance was freed, {', '.join(left[:_SHOWN])}{more} went on",
            )

    def close(self) -> None:
        self._process.close()
        self._ended = self._ended or ProcessEndedError(ProcessFault.EXIT, "its process was closed")


class HostedComponent(RemoteCalls):
    """An instance in an `FmuProcess`, used as any other; NaN and infinite values are passed on."""

    def __init__(self, name: str, process: FmuProcess) -> None:
        self.name, self.description, self._process = name, process.description, process
        self._open = False
        self._lost = False
        self._box = process.box
        self.pointer = self.number = process.opened(name)
        self._open = True
        functions: Any = (self._set_real, self._get_real, self._do_step)
        self.set_real, self.get_real, self.do_step = functions

    def check(self, status: int, call: str, time: float | None = None) -> None:
        if status > 1:
            self._lost = self._lost or status == FATAL
            raise refusal(self, self._texts, status, call, time)

    def _remote(self, call: str, command: str, *arguments: Any) -> Any:
        try:
            return self._process.talk(call, self.number, command, *arguments)
        except ComponentError as error:
            raise ComponentError(self.name, error.call, error.status, error.log) from error

    def _typed(self, form: Callable[..., Form], answer: Any, *wanted: Any) -> Form:
        return self._process.typed(form, answer, *wanted)

    def run(
        self,
        into: RealBatch,
        rows: Numbers,
        out: RealBatch,
        steps: int,
        time: float,
        step_size: float,
        network: LinearNetwork | None = None,
    ) -> Numbers:
        """Step several times; rows of inputs before each, what was read after each.

        ``into`` and ``out``: variables that are set before a step, and read after it.
        ``rows``: values of the inputs, shape (n, inputs): one row a step; after the last row they stay.
        ``steps``: how many; with 0 the first row is set and one row read, without a step.
        ``time``: at which the first step starts [s].
        ``step_size``: communication step [s].
        ``network``: what it stands at, with one row that stays; its state moves on."""
        status, stage, done, values = self._process.run(
            self.number,
            _references(into),
            rows,
            _references(out),
            steps=steps,
            time=time,
            step_size=step_size,
            network=network,
        )
        if status > 1:
            self.check(status, _STAGES.get(stage, "fmi2DoStep"), time + done * step_size)
        return values

    def _set_real(self, _pointer: int, references: int, count: int, values: int) -> int:
        row = np.empty((1, count))
        memmove(row.ctypes.data, values, row.nbytes)
        return self._process.run(self.number, _at(references, count), row, _NONE)[0]

    def _get_real(self, _pointer: int, references: int, count: int, values: int) -> int:
        status, _, _, found = self._process.run(self.number, _NONE, _EMPTY, _at(references, count))
        memmove(values, found.ctypes.data, found.nbytes)
        return status

    def _do_step(self, _pointer: int, time: float, step_size: float, _no_set_state: int) -> int:
        return self._process.run(
            self.number, _NONE, _EMPTY, _NONE, steps=1, time=time, step_size=step_size
        )[0]

    def jacobian(self, unknowns: Sequence[str], knowns: Sequence[str]) -> NoReturn:
        raise ComponentError(
            self.name,
            "fmi2GetDirectionalDerivative",
            "nothing",
            "the acceptance tests ask no FMU for derivatives",
        )

    def free_state(self, state: Any) -> None:
        if self._process.alive:
            super().free_state(state)

    def close(self) -> None:
        """Terminate and free the instance; its process goes on."""
        if self._open and self._process.alive:
            self._open = False
            self._remote("fmi2FreeInstance", "close", self._lost)
            if not self._lost:
                self._process.freed()


_NONE = np.empty(0, np.uint32)
_EMPTY = np.empty((0, 0))


def _at(address: int, count: int) -> NDArray[np.uint32]:
    if not count:
        return _NONE
    numbers: Any = (c_uint * count).from_address(address)
    return np.frombuffer(numbers, np.uint32)


def _references(batch: RealBatch) -> NDArray[np.uint32]:
    return _at(batch.arguments[1], len(batch.names))

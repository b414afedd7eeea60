"""An FMU in a process of its own, called as if it were in this one.

A crash, a hang, an exit or a flood in it becomes one `ComponentError`; what was computed until then stays. Values pass
through shared memory (`mailbox.c`), one exchange for a communication step, or for many of a known input."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ctypes import addressof, c_double, c_int, c_size_t, c_void_p  # isort: skip

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.removal import remove_tree
from orchestrator.core.errors import ComponentError, ErrorKind, InputError, NotFiniteError
from orchestrator.core.interrupts import calls
from orchestrator.devices.fmi.archive import extract
from orchestrator.devices.fmi.description import FmuDescription, runs_under_wine
from orchestrator.devices.fmi.refused_calls import refusal
from orchestrator.devices.fmi.remote_calls import Form, RemoteCalls
from orchestrator.devices.sandbox.answer_forms import (
    NotAnAnswerError,
    content_of,
    matrix,
    protections,
)
from orchestrator.devices.sandbox.foreign_process import ConfinedProcess
from orchestrator.devices.sandbox.mailbox import DIED, HUNG, INTERRUPTED, NOT_A_NUMBER, TAMPERED
from orchestrator.devices.sandbox.protections_in_force import Protection
from orchestrator.devices.sandbox.resource_limits import TO_BEGIN, Limits

_TO_END = 5.0  # time for an FMU to free its instance [s]


class IsolatedComponent(RemoteCalls):
    def __init__(
        self,
        name: str,
        description: FmuDescription,
        directory: Path | None = None,
        limits: Limits | None = None,
    ) -> None:
        self.name, self.description, self.limits = name, description, limits or Limits()
        self._process: ConfinedProcess | None = None
        self._end: str | None = None
        self._end_kind = ErrorKind.FMU
        self._own_directory = extract(description.path) if directory is None else None
        self.protections: tuple[Protection, ...] = ()
        calls.watch()
        try:
            self._start(directory or self._own_directory or Path())
            self._remote("fmi2Instantiate", "instantiate")
        except BaseException:
            self.close()
            raise
        self.pointer = addressof(self._box.client)
        self.set_real = self._box.function("client_set_real", c_void_p, c_size_t, c_void_p)
        self.get_real = self._box.function("client_get_real", c_void_p, c_size_t, c_void_p)
        self.do_step = self._box.function("client_do_step", c_double, c_double, c_int)
        self.many_steps = self._box.function("client_many_steps", c_void_p, c_void_p)

    def _start(self, directory: Path) -> None:
        fmu = self.description.path.resolve()
        request = {
            "fmu": str(fmu),
            "name": self.name,
            "guid": self.description.guid,
            "directory": str(directory),
        }
        worker = "orchestrator.devices.fmi.isolated_component_worker"
        self._process = ConfinedProcess(
            worker,
            request,
            [fmu, directory],
            self.limits,
            windows=runs_under_wine(self.description),
        )
        self._box = self._process.box
        self._box.client.patience = TO_BEGIN
        self.protections = protections(self._remote("the beginning of its process", "begin"))
        self._box.client.patience = self.limits.seconds

    @property
    def process_group(self) -> int:
        """Number of the group of processes that the FMU runs in."""
        assert self._process is not None
        return self._process.group

    def check(self, status: int, call: str, time: float | None = None) -> None:
        if status <= 1:
            return
        if status == NOT_A_NUMBER:
            bad = self._box.client.bad_reference
            names = [
                n
                for n, v in self.description.variables.items()
                if v.reference == bad and v.type == "Real"
            ]
            raise NotFiniteError(self.name, names[0] if names else "a variable", None, time)
        if status == INTERRUPTED:  # it is still at work on the question
            self._give_up("interrupted: its process was ended")
            raise KeyboardInterrupt
        if status in (DIED, HUNG, TAMPERED):
            ended = self._how_it_ended(status)
            raise ComponentError(self.name, call, ended, self._last_words(), time, self._end_kind)
        raise refusal(self, self._texts, status, call, time)

    def _how_it_ended(self, status: int) -> str:
        """Crash, hang, exit, flood or tampering, in words; the process is ended if it is still there."""
        if self._end is not None:
            return self._end
        assert self._process is not None
        if status == HUNG:
            self._end_kind = ErrorKind.HANG
            return self._give_up(
                f"hang: no answer within {self._box.client.patience:g} s; its process was ended"
            )
        if status == TAMPERED:
            return self._give_up(
                "tampering: an answer that no call of FMI gives; its process was ended"
            )
        fault, how = self._process.fault()
        self._end = f"{fault}: {how}{' in one step' if how.endswith(' log messages') else ''}"
        return self._end

    def _give_up(self, why: str) -> str:
        if self._process is not None:
            self._process.end()
        self._end = why
        return why

    def _last_words(self) -> str:
        """Its newest log messages, or the end of what it wrote."""
        assert self._process is not None
        return "; ".join(self._texts()) or self._process.last_words()

    def _remote(self, call: str, command: str, *arguments: Any) -> Any:
        if self._end is not None:
            raise ComponentError(self.name, call, self._end, "", kind=self._end_kind)
        self._box.clear_log()
        self._box.write_text([command, *arguments])
        with calls:
            self.check(self._box.question(), call)
        try:
            return content_of(self._box.read_text(), self.name)
        except ValueError as error:
            raise self._tampered(call, error) from None

    def _typed(self, form: Callable[..., Form], answer: Any, *wanted: Any) -> Form:
        try:
            return form(answer, *wanted)
        except NotAnAnswerError as error:
            raise self._tampered("an answer", error) from None

    def _tampered(self, call: str, error: ValueError) -> ComponentError:
        why = self._give_up("tampering: its process was ended")
        return ComponentError(
            self.name, call, why, f"it wrote into the memory between the processes: {error}"
        )

    def jacobian(self, unknowns: Sequence[str], knowns: Sequence[str]) -> NDArray[np.float64]:
        found = self._remote(
            "fmi2GetDirectionalDerivative", "jacobian", list(unknowns), list(knowns)
        )
        return self._typed(matrix, found, len(unknowns), len(knowns))

    @property
    def renewable(self) -> bool:
        return not runs_under_wine(self.description)

    def renew(self) -> None:
        self._box.client.patience = min(self.limits.seconds, _TO_END)
        self._remote("fmi2FreeInstance", "release")
        self._box.client.patience = self.limits.seconds
        self._remote("fmi2Instantiate", "instantiate")

    def close(self) -> None:
        process = self._process
        if process is not None and self._end is None and process.running:
            self._box.client.patience = min(self._box.client.patience, _TO_END)
            # an FMU that failed may not end by itself
            with suppress(ComponentError, InputError, ValueError):
                self._remote("fmi2Terminate", "close")
                process.wait(_TO_END)
        self._end = self._end or "closed"
        if process is not None:
            process.close()
        if self._own_directory is not None:
            remove_tree(self._own_directory)
            self._own_directory = None

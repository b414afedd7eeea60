"""An FMU in a process of its own, called as if it were in this one.

A crash, a hang, an exit or a flood in it becomes one `ComponentError`; what was computed until then stays. Values pass
through shared memory (`mailbox.c`), one exchange for a communication step.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from shutil import rmtree
from typing import Any

from ctypes import c_double, c_int, c_size_t, c_void_p  # isort: skip

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import ComponentError, InputError, NotFiniteError, UnsupportedFmuError
from orchestrator.fmi.archive import extract
from orchestrator.fmi.component import Derived, RealBatch
from orchestrator.fmi.description import FmuDescription
from orchestrator.fmi.interrupts import calls
from orchestrator.fmi.limits import TO_BEGIN, Limits
from orchestrator.fmi.mailbox import DIED, HUNG, INTERRUPTED, NOT_A_NUMBER, Mailbox
from orchestrator.fmi.messages import FLOODED, texts
from orchestrator.fmi.process_end import fault_of_exit, last_line
from orchestrator.fmi.refusal import check_log, refusal
from orchestrator.fmi.remote_calls import RemoteCalls


class IsolatedComponent(RemoteCalls, Derived):
    """An instance of an FMU in a process of its own.

    Parameters
    ----------
    name, description, directory
        As `LoadedComponent`.
    limits
        What it may take.
    """

    def __init__(
        self, name: str, description: FmuDescription, directory: Path | None = None, limits: Limits | None = None
    ) -> None:
        self.name, self.description, self.limits = name, description, limits or Limits()
        self._process: subprocess.Popen[bytes] | None = None
        self._end: str | None = None
        self._own_directory = extract(description.path) if directory is None else None
        calls.watch()
        self._folder = Path(tempfile.mkdtemp(prefix="gfor_isolated_"))
        try:
            self._box = Mailbox(self._folder / "mailbox", create=True)
            self._start(directory or self._own_directory or Path())
            self._remote("fmi2Instantiate", "instantiate")
        except BaseException:
            self.close()
            raise
        self.pointer = self._box.address
        self.set_real = self._box.function("client_set_real", c_void_p, c_size_t, c_void_p)
        self.get_real = self._box.function("client_get_real", c_void_p, c_size_t, c_void_p)
        self.do_step = self._box.function("client_do_step", c_double, c_double, c_int)

    def _start(self, directory: Path) -> None:
        request = {
            "fmu": str(self.description.path.resolve()),
            "name": self.name,
            "guid": self.description.guid,
            "directory": str(directory),
            "folder": str(self._folder),
            "limits": asdict(self.limits),
            "parent": os.getpid(),
        }
        work = self._folder / "work"
        work.mkdir()
        with (work / "output").open("wb") as output:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "orchestrator.fmi.isolation_worker", json.dumps(request)],
                stdin=subprocess.DEVNULL, stdout=output, stderr=output, start_new_session=True,
            )  # fmt: skip
        handle = getattr(self._process, "_handle", None)  # Windows
        self._box.head.peer = self._process.pid if handle is None else int(handle)
        self._box.head.patience = TO_BEGIN
        self._remote("the beginning of its process", "begin")
        self._box.head.patience = self.limits.seconds

    # -- errors ----------------------------------------------------------------------------------

    def check(self, status: int, call: str, time: float | None = None) -> None:
        if status <= 1:
            return
        if status == NOT_A_NUMBER:
            bad = self._box.head.bad_reference
            names = [n for n, v in self.description.variables.items() if v.reference == bad and v.type == "Real"]
            raise NotFiniteError(self.name, names[0] if names else "a variable", None, time)
        if status == INTERRUPTED:  # it is still at work on the question
            self._kill()
            self._end = "interrupted: its process was ended"
            raise KeyboardInterrupt
        if status in (DIED, HUNG):
            raise ComponentError(self.name, call, self._how_it_ended(status), self._last_words(), time)
        raise refusal(self, self._texts, status, call, time)

    def _texts(self, least: int = 0) -> list[str]:
        return texts(self._box.read_log(), least)

    def progress_of_step(self) -> tuple[bool, float | None]:
        ended, reached = self._remote("fmi2GetBooleanStatus", "progress_of_step")
        return ended, reached

    def _how_it_ended(self, status: int) -> str:
        """Crash, hang, exit or flood, in words; the process is ended if it is still there."""
        if self._end is not None:
            return self._end
        process = self._process
        assert process is not None
        if status == HUNG:
            self._kill()
            self._end = f"hang: no answer within {self._box.head.patience:g} s; its process was ended"
            return self._end
        code = process.wait()
        fault, how = fault_of_exit(code, self.limits)
        self._end = f"{fault}: {how}{' in one step' if code == FLOODED else ''}"
        return self._end

    def _last_words(self) -> str:
        """Its newest log messages, or the end of what it wrote."""
        if texts := self._texts():
            return "; ".join(texts)
        return last_line(self._folder / "work" / "output")

    # -- conversation ----------------------------------------------------------------------------

    def _remote(self, call: str, command: str, *arguments: Any) -> Any:
        """Have something done in the other process that needs more than numbers."""
        if self._end is not None:
            raise ComponentError(self.name, call, self._end, "")
        self._box.clear_log()
        self._box.write_text([command, *arguments])
        with calls:
            self.check(self._box.library.mailbox_talk(self._box.address), call)
        answer = self._box.read_text()
        if "unsupported" in answer:
            raise UnsupportedFmuError(*answer["unsupported"])
        if "input_error" in answer:
            raise InputError(answer["input_error"])
        if "component_error" in answer:
            at, how, log = answer["component_error"]
            raise ComponentError(self.name, at, how, log)
        return answer.get("result")

    def read(self, batch: RealBatch) -> None:
        self._box.clear_log()
        batch.read()
        check_log(self, self._texts, "fmi2GetReal")

    def values(self, names: Iterable[str]) -> dict[str, float | bool]:
        return dict(self._remote("reading", "values", list(names)))

    def jacobian(self, unknowns: Sequence[str], knowns: Sequence[str]) -> NDArray[np.float64]:
        found = self._remote("fmi2GetDirectionalDerivative", "jacobian", list(unknowns), list(knowns))
        return np.array(found).reshape(len(unknowns), len(knowns))

    def save_state(self) -> Any:
        return self._remote("fmi2GetFMUstate", "save_state")

    def restore_state(self, state: Any) -> None:
        self._remote("fmi2SetFMUstate", "restore_state", state)

    def free_state(self, state: Any) -> None:
        self._remote("fmi2FreeFMUstate", "free_state", state)

    def serialize_state(self, state: Any) -> bytes:
        return bytes.fromhex(self._remote("fmi2SerializeFMUstate", "serialize_state", state))

    def deserialize_state(self, content: bytes) -> Any:
        return self._remote("fmi2DeSerializeFMUstate", "deserialize_state", content.hex())

    # -- the end ---------------------------------------------------------------------------------

    def _kill(self) -> None:
        if self._process is not None:
            if self._process.poll() is None:
                self._process.kill()
            self._process.wait()

    def close(self) -> None:
        """End the process and remove what was written for it."""
        if self._process is not None and self._end is None and self._process.poll() is None:
            self._box.head.patience = min(self._box.head.patience, 5.0)
            try:
                self._remote("fmi2Terminate", "close")
                self._process.wait(5.0)
            except (ComponentError, InputError, ValueError, subprocess.TimeoutExpired):
                pass  # an FMU that failed may not end by itself
        self._kill()
        self._end = self._end or "closed"
        rmtree(self._folder, ignore_errors=True)
        if self._own_directory is not None:
            rmtree(self._own_directory, ignore_errors=True)
            self._own_directory = None

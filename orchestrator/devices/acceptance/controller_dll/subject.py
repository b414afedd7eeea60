"""The controller DLL under test: its process, its instances, and the run with which others are compared."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path

from fmus.vendor_dll.answer_file import ForeignAnswerError, checked_interface
from fmus.vendor_dll.fmu import places
from fmus.vendor_dll.interface import DllInterface
from fmus.vendor_dll.state_trial import LARGEST, SAMPLES
from orchestrator.devices.acceptance.controller_dll.file_head import FileHead, read_head
from orchestrator.devices.acceptance.controller_dll.host import (
    Heard,
    Instance,
    Placement,
    Session,
)
from orchestrator.devices.sandbox.dll_process import DllProcess

_STEP = 1e-4  # between two samples of a DLL that declares no sample time [s]


class ErrorInRunError(ValueError):
    """A DLL ends a plain run with an error of its own."""


class DllSubject:
    def __init__(
        self, path: Path, texts: Mapping[str, str] | None = None, seconds: float = 30.0
    ) -> None:
        self.path, self.texts, self._seconds = path.absolute(), dict(texts or {}), seconds
        self.head: FileHead = read_head(path)
        self.windows = self.head.kind == "PE"
        self.heard: list[Heard] = []  # every call of every run, for what is said of all of them
        self.loaded: Callable[[], DllProcess] = self._loaded
        self._process: DllProcess | None = None

    def _loaded(self) -> DllProcess:
        return DllProcess(self.path, self.texts, self._seconds)

    def process(self) -> DllProcess:
        """Its process; a new one where it has ended the last one."""
        if self._process is None or not self._process.alive:
            self._process = self._loaded()
        return self._process

    @contextmanager
    def other_process(self) -> Iterator[DllProcess]:
        """Another process with the same DLL, beside the first."""
        process = self._loaded()
        try:
            yield process
        finally:
            process.close()

    def close(self) -> None:
        if self._process is not None:
            self._process.close()

    @cached_property
    def interface(self) -> DllInterface:
        """Its declarations.

        Raises
        ------
        ValueError
            If Model_GetInfo gives what has not the interface's form.
        """
        (found,) = self.process().do([["interface"]])
        try:
            interface = DllInterface.from_json(checked_interface(json.loads(json.dumps(found))))
        except ForeignAnswerError as error:
            raise ValueError(str(error)) from error
        self._name_files(interface)
        return interface

    def _name_files(self, interface: DllInterface) -> None:
        """Let it read the files that its text parameters name, from the next process on."""
        if interface.faults():
            return
        found = places(interface, self.texts, self.path, self.path.parent)
        named = {name: str(file) for name, file in found.items() if file.is_file()}
        if named.items() - self.texts.items():
            self.texts |= named
            self.close()

    @property
    def _seen(self) -> dict[str, str]:
        """Text parameters as the DLL is given them: a file's path is another one under Wine."""
        if not self.windows:
            return self.texts
        return {
            name: f"Z:{text}".replace("/", "\\") if Path(text).is_absolute() else text
            for name, text in self.texts.items()
        }

    @property
    def step(self) -> float:
        return self.interface.sample_time if self.interface.sample_time > 0 else _STEP

    @cached_property
    def largest(self) -> float:
        """Size of the moving inputs with which it runs without an error of its own.

        Raises
        ------
        ErrorInRunError
            If it ends with an error at each of them.
        """
        said = ""
        for largest in (*LARGEST, 0.0):
            session, _ = self.begin(None, SAMPLES, self.instance(largest=largest))
            bad = next((heard for heard in self.play(session) if heard.code == 2), None)
            if bad is None:
                return largest
            said = said or f"Model_{bad.call} at {bad.time:g} s: {bad.text or '(no message)'}"
        raise ErrorInRunError(said)

    def instance(
        self,
        process: DllProcess | None = None,
        placement: Placement | None = None,
        *,
        phase: int = 0,
        largest: float | None = None,
    ) -> Instance:
        size = self.largest if largest is None else largest
        where = process or self.process()
        return Instance(where, self.interface, self._seen, placement or Placement(), size, phase)

    def session(self, process: DllProcess | None = None) -> Session:
        return Session(process or self.process(), self.interface, self.step)

    def begin(
        self, process: DllProcess | None, samples: int = 0, instance: Instance | None = None
    ) -> tuple[Session, Instance]:
        """Queue the first calls of an instance and its first samples; a plain instance where none is given."""
        session = self.session(process)
        one = self.instance(process) if instance is None else instance
        session.start(one)
        session.samples(one, 1, samples)
        return session, one

    def play(self, session: Session) -> list[Heard]:
        """Make a session's calls, and note them."""
        found = session.play()
        self.heard += found
        return found

    def run(
        self,
        process: DllProcess | None = None,
        placement: Placement | None = None,
        phase: int = 0,
    ) -> list[Heard]:
        """A plain run of one instance from its first call on, and its end."""
        session, one = self.begin(process, SAMPLES, self.instance(process, placement, phase=phase))
        session.call(one, "Terminate", SAMPLES * self.step)
        return self.play(session)

    @cached_property
    def reference(self) -> list[Heard]:
        """The plain run with which others are compared, in a process that did nothing before."""
        with self.other_process() as process:
            return self.run(process)

    @cached_property
    def reference_of_another(self) -> list[Heard]:
        """The same of an instance with other inputs."""
        with self.other_process() as process:
            return self.run(process, phase=5)


def differs(heard: list[Heard], reference: list[Heard]) -> Heard | None:
    """The first call whose answer is another one than in the reference."""
    pairs = zip(heard, reference, strict=True)
    return next((one for one, other in pairs if one.answer != other.answer), None)

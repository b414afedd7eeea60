"""An FMU in this process: calls of FMI 2.0 on preallocated arguments, with the FMU's own words in every error."""

import ctypes
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from math import isfinite
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from fmus.toolchain.removal import remove_tree
from orchestrator.core.errors import ComponentError, FmuFileError, InputError, UnsupportedFmuError
from orchestrator.core.interrupts import calls
from orchestrator.devices.fmi.archive import MODEL_DESCRIPTION
from orchestrator.devices.fmi.binary import (
    FMU2Tolerant,
    absent_functions,
    binary_path,
    in_words_of_2,
    load,
    unload,
)
from orchestrator.devices.fmi.brought_modules import brought_by
from orchestrator.devices.fmi.component import Derived, RealBatch
from orchestrator.devices.fmi.description import FmuDescription, runs_under_wine
from orchestrator.devices.fmi.fmi3 import Fmi3Library, adapter_path
from orchestrator.devices.fmi.interpreter_turn import turn
from orchestrator.devices.fmi.messages import Messages, callbacks_for, texts
from orchestrator.devices.fmi.refused_calls import FATAL, check_log, in_its_words, refusal
from orchestrator.devices.fmi.unpacked import extract_with_code
from orchestrator.devices.sandbox.compiled_programs import proxy_path
from orchestrator.devices.sandbox.wine import NoWineError
from orchestrator.devices.sandbox.wine_program import WineProgram

# why one thread alone steps an FMU: Python's lock lets one thread run at a time
PYTHON_BACKED = "Python-backed"
# kinds of ``fmi2Get…Status``, as fmi2StatusKind numbers them
_LAST_SUCCESSFUL_TIME = 2
_TERMINATED = 3


@lru_cache(maxsize=64)
def _identity_in(path: Path, version: int) -> str:
    """The guid of an FMI 2.0 description or the token of an FMI 3.0 one; ``version`` keeps newer contents apart.

    A network may have hundreds of instances of one FMU."""
    with path.open("rb") as file:
        # the rest of it takes milliseconds
        root = next(ElementTree.iterparse(file, events=("start",)))[1]
    return root.get("guid") or root.get("instantiationToken") or ""


class LoadedComponent(Derived):
    """An instance of an FMU that is loaded into this process; always released, also after an error.

    ``lost``: Whether it said ``fmi2Fatal``: no call is allowed any more."""

    def __init__(
        self,
        name: str,
        description: FmuDescription,
        directory: Path | None = None,
        *,
        ours: bool = False,
    ) -> None:
        self.name, self._ours = name, ours
        self.description = description
        self.lost = False
        self._messages = Messages()
        self._own_directory = None if directory else extract_with_code(description.path)
        self._brought = brought_by(Path(directory or self._own_directory or "") / "resources")
        self._callbacks = callbacks_for(self._messages)
        self._fmu: Any = None
        self._wine: WineProgram | None = None
        self._initialised = False
        calls.watch()
        try:
            self._fmu = self._loaded(Path(directory or self._own_directory or ""))
            with turn, calls, self._brought.loading():
                self._fmu.instantiate(callbacks=self._callbacks, loggingOn=True)
        except UnsupportedFmuError:
            self.close()
            raise
        except Exception as error:  # fmpy raises a bare Exception here
            said = "; ".join(self._texts()) or str(error)
            self.close()
            raise ComponentError(
                name, in_its_words(description, "fmi2Instantiate"), "no instance", said
            ) from error
        self.pointer = self._fmu.component
        self.pointer = (
            self.pointer.value if isinstance(self.pointer, ctypes.c_void_p) else self.pointer
        )
        self._bind_functions()

    def _loaded(self, directory: Path) -> Any:
        """Load the binary; that of an FMU of FMI 3.0 goes behind an adapter."""
        self._compare_guid(directory)
        newer = self.description.fmi_version == "3.0"
        if runs_under_wine(self.description):
            return self._under_wine(directory)
        library = load(self.description, directory)
        missing, spare = absent_functions(self.description, library)
        if missing:
            raise FmuFileError(
                f"{self.description.path}: its binary has no function {missing[0]}, which an FMU that declares what it "
                "does must have; export it again"
            )
        if newer:
            self._behind = Fmi3Library(self.description, directory, library)
        fmu = FMU2Tolerant(
            in_words_of_2(set(spare)) if newer else set(spare),
            self._refuse_absent,
            guid=self.description.guid,
            unzipDirectory=str(directory),
            modelIdentifier=self.description.model_identifier,
            instanceName=self.name,
            libraryPath=str(adapter_path()) if newer else None,
        )
        if newer:
            self._behind.prepare(fmu.dll)
        else:
            unload(library)  # it is open a second time in FMPy's object, which gives it back
        return fmu

    def _under_wine(self, directory: Path) -> Any:
        """Functions that ask a program under Wine, which loads the binary for Windows."""
        try:
            self._wine = WineProgram(binary_path(self.description, directory))
        except (NoWineError, ValueError) as error:
            raise FmuFileError(
                f"{self.description.path}: its binary for Windows: {error}"
            ) from error
        self._wine.attach()
        return FMU2Tolerant(
            set(),
            self._refuse_absent,
            guid=self.description.guid,
            unzipDirectory=str(directory),
            modelIdentifier=self.description.model_identifier,
            instanceName=self.name,
            libraryPath=str(proxy_path()),
        )

    def _refuse_absent(self, call: str) -> None:
        call = in_its_words(self.description, call)
        raise ComponentError(
            self.name,
            call,
            "nothing",
            "its binary has no such function, and its file declares no need",
        )

    def _compare_guid(self, directory: Path) -> None:
        """Refuse another FMU than was described; not every binary checks that itself."""
        path = directory / MODEL_DESCRIPTION
        if self.description.guid not in _identity_in(path, path.stat().st_mtime_ns):
            raise InputError(
                f"the guid {self.description.guid} is not that of the FMU; read its description again"
            )

    def _bind_functions(self) -> None:
        """Function pointers with fixed prototypes: no per-call conversion, unlike fmpy's wrappers."""
        library = self._fmu.dll
        address, size, real, flag = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_int
        prototype = ctypes.CFUNCTYPE(ctypes.c_int, address, address, size, address)
        self.set_real = prototype(("fmi2SetReal", library))
        self.get_real = prototype(("fmi2GetReal", library))
        self.set_state = None
        if (
            self._ours and self.description.can_save_state
        ):  # thousands of calls where FMUs are perturbed
            two = ctypes.CFUNCTYPE(ctypes.c_int, address, address)
            self.set_state = two(("fmi2SetFMUstate", library))
        self.do_step = ctypes.CFUNCTYPE(ctypes.c_int, address, real, real, flag)(
            ("fmi2DoStep", library)
        )
        if self._ours and self.one_thread is None:
            # another's library may have a function of this name that does something else
            self.step_stack = getattr(library, "gfor_step_stack", None)

    @property
    def one_thread(self) -> str | None:
        if self.description.needs_tool:
            return PYTHON_BACKED
        return None if self._ours else "an FMU of others, whose instances may share data"

    def _texts(self, least: int = 0) -> list[str]:
        return texts(self._messages, least)

    def check(self, status: int, call: str, time: float | None = None) -> None:
        if status > 1:
            self.lost = self.lost or status == FATAL
            raise refusal(self, self._texts, status, call, time)

    def progress_of_step(self) -> tuple[bool, float | None]:
        flag, number = ctypes.c_int(0), ctypes.c_double(0.0)
        ended = self._ask_status("fmi2GetBooleanStatus", _TERMINATED, flag) and bool(flag.value)
        reached = self._ask_status("fmi2GetRealStatus", _LAST_SUCCESSFUL_TIME, number)
        return ended, number.value if reached and isfinite(number.value) else None

    def _ask_status(self, function: str, kind: int, answer: Any) -> bool:
        try:
            with calls:
                getattr(self._fmu, function)(self._fmu.component, kind, ctypes.byref(answer))
        except (FMICallException, ComponentError):
            return False
        return True

    def _call(self, call: str, function: Any, *arguments: Any) -> Any:
        """Call through fmpy; raise if the FMU logs an error, even where it returns OK."""
        self._messages.clear()
        try:
            with calls:
                result = function(*arguments)
        except FMICallException as error:
            self.check(error.status, call)
            raise ComponentError(self.name, call, str(error), "; ".join(self._texts())) from error
        check_log(self.name, self._texts, call)
        return result

    def setup(self, start_time: float, stop_time: float | None) -> None:
        self._call(
            "fmi2SetupExperiment",
            lambda: self._fmu.setupExperiment(startTime=start_time, stopTime=stop_time),
        )

    def enter_initialization_mode(self) -> None:
        self._call("fmi2EnterInitializationMode", self._fmu.enterInitializationMode)

    def exit_initialization_mode(self) -> None:
        self._call("fmi2ExitInitializationMode", self._fmu.exitInitializationMode)
        self._initialised = True

    def reset(self) -> None:
        self._call("fmi2Reset", self._fmu.reset)
        self._initialised = False

    def close(self) -> None:
        fmu, self._fmu = self._fmu, None
        if fmu is not None and fmu.component is not None and not self.lost:
            with turn, calls:
                try:
                    if self._initialised:
                        fmu.terminate()
                except FMICallException:
                    pass  # an FMU that failed may refuse to terminate; it is freed all the same
                fmu.freeInstance()
            with turn:
                self._brought.close()
        if self._wine is not None:
            self._wine.close()
            self._wine = None
        if self._own_directory is not None:
            remove_tree(self._own_directory)
            self._own_directory = None

    def set(self, values: Mapping[str, float | bool]) -> None:
        for name, value in values.items():
            variable = self.description.variables.get(name)
            if variable is None:
                raise InputError(
                    f"component {self.name!r} has no variable {name!r}; `gfor fmu info` lists them"
                )
            setters = {
                "Real": (self._fmu.setReal, float),
                "Integer": (self._fmu.setInteger, int),
                "Enumeration": (self._fmu.setInteger, int),
                "Boolean": (self._fmu.setBoolean, bool),
            }
            if variable.type not in setters:
                raise InputError(
                    f"component {self.name!r}: variable {name!r} is of type {variable.type}, which cannot be set here"
                )
            setter, convert = setters[variable.type]
            if convert is int and value != int(value):
                raise InputError(
                    f"component {self.name!r}: {name} = {value:g}; it must be a whole number"
                )
            self._call(f"setting {name} = {value}", setter, [variable.reference], [convert(value)])

    def read(self, batch: RealBatch) -> None:
        self._call("fmi2GetReal", batch.read)

    def values(self, names: Iterable[str]) -> dict[str, float | bool]:
        getters = {"Real": self._fmu.getReal, "Boolean": self._fmu.getBoolean}
        found: dict[str, float | bool] = {}
        for name in names:
            variable = self.description.variables[name]
            getter = getters.get(variable.type, self._fmu.getInteger)
            (value,) = self._call(f"reading {name}", getter, [variable.reference])
            found[name] = bool(value) if variable.type == "Boolean" else float(value)
        return found

    def jacobian(self, unknowns: Sequence[str], knowns: Sequence[str]) -> NDArray[np.float64]:
        variables = self.description.variables
        rows = [variables[name].reference for name in unknowns]
        columns = [
            self._call(
                "fmi2GetDirectionalDerivative",
                self._fmu.getDirectionalDerivative,
                rows,
                [reference],
                [1.0],
            )
            for reference in (variables[name].reference for name in knowns)
        ]
        return np.array(columns).reshape(len(knowns), len(unknowns)).T

    def save_state(self) -> Any:
        return self._call("fmi2GetFMUstate", self._fmu.getFMUState)

    def restore_state(self, state: Any) -> None:
        if self.set_state is None:
            self._call("fmi2SetFMUstate", self._fmu.setFMUState, state)
            return
        self._messages.clear()
        with calls:
            status = self.set_state(self.pointer, state)
        self.check(status, "fmi2SetFMUstate")
        check_log(self.name, self._texts, "fmi2SetFMUstate")

    def free_state(self, state: Any) -> None:
        self._call("fmi2FreeFMUstate", self._fmu.freeFMUState, state)

    def serialize_state(self, state: Any) -> bytes:
        return bytes(self._call("fmi2SerializeFMUstate", self._fmu.serializeFMUState, state))

    def deserialize_state(self, content: bytes) -> Any:
        return self._call("fmi2DeSerializeFMUstate", self._fmu.deSerializeFMUstate, content)

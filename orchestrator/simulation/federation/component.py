"""A component that is a federate, as the master sees it.

Until the run begins, a federate of ours is its FMU in this process, so that it is initialised and linearised as any
other; then its state goes to the federate. A foreign federate is only what it publishes."""

import base64
import ctypes
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import ComponentError, InputError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.component import Component, Derived, RealBatch
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.simulation.federation.layout import Part

_FAILED = 3  # status of a call that did not succeed, as fmi2Error
_LONGEST_LOG = 20_000  # calls of an initialisation that are kept


class Exchanges(Protocol):
    def begin_step(self, name: str, time: float, inputs: Sequence[float]) -> None:
        """A component's inputs for the step from a time [s]; the step begins when its whole slot has them."""

    def outputs(self, name: str) -> Sequence[float]:
        """A component's outputs after its step, in the order in which it publishes them."""

    def command(self, name: str, command: str, *arguments: Any) -> Any:
        """Have a federate of ours do something that takes no time of HELICS."""


class FederatedComponent(Derived):
    """One component of a federation.

    ``description``: of the FMU; of a foreign federate only what it publishes and takes.
    ``inner``: the FMU in this process until `hand_over`; None of a foreign federate.
    ``published``: outputs that the federate publishes, in this order."""

    def __init__(
        self,
        part: Part,
        description: FmuDescription,
        inner: Component | None,
        exchanges: Exchanges,
        published: Sequence[str],
    ) -> None:
        self.name, self.description, self.inner, self._part = part.name, description, inner, part
        self._exchanges, variables = exchanges, description.variables
        self._published = [variables[v].reference for v in published]
        self._known: dict[int, float] = {}
        self._inputs = {variables[v].reference: variables[v].start_number for v in part.inputs}
        self._changed: set[int] = set()
        self._log: list[list[Any]] = []
        self._touched = False
        self._error: BaseException | None = None
        self._remote = inner is None
        address, size, real, flag = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_int
        exchange = ctypes.PYFUNCTYPE(ctypes.c_int, address, address, size, address)
        step = ctypes.PYFUNCTYPE(ctypes.c_int, address, real, real, flag)
        self._place = ctypes.c_int(0)
        self.pointer = ctypes.addressof(self._place)
        self.set_real = exchange(self._guarded(self._set_real))
        self.get_real = exchange(self._guarded(self._get_real))
        self.do_step = step(self._guarded(self._do_step))

    def _guarded(self, function: Callable[..., int]) -> Callable[..., int]:
        """A function for C, which no exception may leave; `check` raises it."""

        def call(*arguments: Any) -> int:
            try:
                return function(*arguments)
            except BaseException as error:  # also Ctrl-C
                self._error = error
                return _FAILED

        return call

    def _set_real(self, _pointer: int, references: int, n: int, values: int) -> int:
        numbers = (ctypes.c_double * n).from_address(values)[:]
        which = (ctypes.c_uint * n).from_address(references)[:]
        if not self._remote:
            assert self.inner is not None
            self._note("set_real", which, numbers)
            return int(self.inner.set_real(self.inner.pointer, references, n, values))
        self._inputs.update(zip(which, numbers, strict=True))
        self._changed.update(which)
        return 0

    def _get_real(self, _pointer: int, references: int, n: int, values: int) -> int:
        which = (ctypes.c_uint * n).from_address(references)[:]
        if not self._remote:
            assert self.inner is not None
            self._note("get_real", which, [0.0] * n)
            return int(self.inner.get_real(self.inner.pointer, references, n, values))
        (ctypes.c_double * n).from_address(values)[:] = list(self._current(which))
        return 0

    def _current(self, references: Sequence[int]) -> Sequence[float]:
        if self._published and not self._known:
            self._known = dict(
                zip(self._published, self._exchanges.outputs(self.name), strict=True)
            )
        known = self._known
        if self.inner is None:
            missing = [r for r in references if r not in known and r not in self._inputs]
            if missing:
                raise ComponentError(
                    self.name, "reading", "nothing", f"reference {missing[0]} is not published"
                )
            return [known[r] if r in known else self._inputs[r] for r in references]
        if not self._changed and all(r in known for r in references):
            return [known[r] for r in references]
        values = [[r, self._inputs[r]] for r in self._changed]
        found: list[float] = self._exchanges.command(self.name, "get", list(references), values)
        self._changed.clear()
        return found

    def _do_step(self, _pointer: int, time: float, _size: float, _flag: int) -> int:
        if not self._remote:
            assert self.inner is not None
            self._touched = True
            return int(self.inner.do_step(self.inner.pointer, time, _size, _flag))
        variables = self.description.variables
        self._exchanges.begin_step(
            self.name, time, [self._inputs[variables[v].reference] for v in self._part.inputs]
        )
        self._known = {}
        self._changed.clear()
        return 0

    def check(self, status: int, call: str, time: float | None = None) -> None:
        error, self._error = self._error, None
        if isinstance(error, ComponentError) and error.time is None:
            raise ComponentError(
                error.component, error.call, error.status, error.log, time
            ) from None
        if error is not None:
            raise error
        if self.inner is not None and not self._remote:
            self.inner.check(status, call, time)

    def progress_of_step(self) -> tuple[bool, float | None]:
        return (
            (False, None) if self._remote or self.inner is None else self.inner.progress_of_step()
        )

    @property
    def is_foreign(self) -> bool:
        return self.inner is None

    def hand_over(self) -> None:
        if self.inner is None or self._remote:
            return
        inner = self.inner
        names = [v for v in self._part.outputs if v in self.description.outputs]
        before = RealBatch(inner, names)
        expected = before.read().copy()
        self._exchanges.command(self.name, "replay", self._log)
        if self._touched:
            if not self.description.can_serialize_state:
                raise InputError(
                    f"component {self.name!r}: it was linearised here, and its FMU cannot serialise its state "
                    "(canSerializeFMUstate), so that its federate cannot be brought there; leave it to the local master"
                )
            state = inner.save_state()
            content = base64.b64encode(inner.serialize_state(state)).decode()
            inner.free_state(state)
            self._exchanges.command(self.name, "state", content)
        self._remote, self._log = True, []
        references = [self.description.variables[v].reference for v in names]
        found = np.array(self._exchanges.command(self.name, "get", references, []))
        if not np.allclose(found, expected, rtol=1e-9, atol=1e-9):
            worst = int(np.argmax(np.abs(found - expected)))
            raise InputError(
                f"component {self.name!r}: at the start its federate gives {names[worst]} = {found[worst]:.10g}, the "
                f"same FMU here {expected[worst]:.10g}; install the same version of gfor-cosim on both machines"
            )
        self._known = dict(zip(references, found.tolist(), strict=True))
        inner.close()

    def _note(self, call: str, *arguments: Any) -> None:
        if not self._touched:
            self._log.append([call, *arguments])
            self._touched = len(self._log) > _LONGEST_LOG

    def _local(self, call: str, *arguments: Any, kept: bool = True) -> Any:
        if self.inner is None or self._remote:
            self._refuse(call)
        if kept:
            self._note(call, *arguments)
        else:
            self._touched = True
        return getattr(self.inner, call)(*arguments)

    def _refuse(self, call: str) -> NoReturn:
        kind = (
            "a foreign federate has no FMU here"
            if self.inner is None
            else "it runs in its federate"
        )
        raise ComponentError(self.name, call, "nothing", kind)

    def setup(self, start_time: float, stop_time: float | None) -> None:
        if self.inner is not None:
            self._local("setup", start_time, stop_time)

    def enter_initialization_mode(self) -> None:
        if self.inner is not None:
            self._local("enter_initialization_mode")

    def exit_initialization_mode(self) -> None:
        if self.inner is not None:
            self._local("exit_initialization_mode")

    def reset(self) -> None:
        self._local("reset")

    def close(self) -> None:
        if self.inner is not None and not self._remote:
            self.inner.close()

    def set(self, values: Mapping[str, float | bool]) -> None:
        if self.inner is not None and not self._remote:
            self._local("set", dict(values))
        elif self.inner is not None:
            self._exchanges.command(self.name, "set", dict(values))
            self._known = {}
            self._changed.update(self._inputs)
        elif other := [
            name for name, value in values.items() if self._part.start.get(name) != float(value)
        ]:
            raise InputError(
                f"component {self.name!r} is a foreign federate, which takes no {other[0]!r} while it runs"
            )

    def read(self, batch: RealBatch) -> None:
        if self.inner is not None and not self._remote:
            self.inner.read(RealBatch(self.inner, batch.names, batch.values))
        else:
            batch.read()

    def values(self, names: Iterable[str]) -> dict[str, float | bool]:
        if self.inner is not None and not self._remote:
            return self.inner.values(names)
        if self.inner is not None:
            return dict(self._exchanges.command(self.name, "values", list(names)))
        return dict(self.get(names))

    def jacobian(self, unknowns: Sequence[str], knowns: Sequence[str]) -> NDArray[np.float64]:
        found: NDArray[np.float64] = self._local("jacobian", unknowns, knowns, kept=False)
        return found

    def save_state(self) -> Any:
        return self._local("save_state", kept=False)

    def restore_state(self, state: Any) -> None:
        self._local("restore_state", state, kept=False)

    def free_state(self, state: Any) -> None:
        self._local("free_state", state, kept=False)

    def serialize_state(self, state: Any) -> bytes:
        return bytes(self._local("serialize_state", state, kept=False))

    def deserialize_state(self, content: bytes) -> Any:
        return self._local("deserialize_state", content, kept=False)


def obstacle_of(component: Component) -> str | None:
    """Why a federate keeps a system from being linearised; None if it does not, or is none."""
    if not isinstance(component, FederatedComponent):
        return None
    if component.is_foreign:
        return f"component {component.name!r} is a foreign federate, which is no FMU that could be perturbed"
    if not component.description.can_serialize_state:
        return (
            f"component {component.name!r}: its FMU cannot serialise its state "
            "(canSerializeFMUstate), so its federate could not be brought to the "
            "operating point; compute the modes without " + Option.ENGINE_HELICS
        )
    return None

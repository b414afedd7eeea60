"""Calls that every running FMU offers, wherever it runs, and its Real variables in batches.

An instance is loaded into this process (`loaded_component`), runs in one of its own (`isolated_component`) or stands
behind a binding (`bound_component`); the acceptance tests have a fourth kind. They share this form and no data."""

import ctypes
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.closing import Closing
from orchestrator.core.errors import InputError
from orchestrator.core.interrupts import calls
from orchestrator.devices.fmi.description import FmuDescription


class Component(Protocol):
    name: str  # name of the instance, used in errors and results
    pointer: Any  # first argument of the three functions below [address]
    # set_real, get_real, do_step: as fmi2SetReal, fmi2GetReal and fmi2DoStep, callable from C; they return a status
    set_real: Any
    get_real: Any
    do_step: Any
    # as fmi2SetFMUstate, callable from C; None where only `restore_state` restores
    set_state: Any
    # as ``many_steps`` of many_steps.h, callable from C; None where each step is a call of its own
    many_steps: Any
    # as ``gfor_step_stack`` of our native FMUs' stack.c, callable from C; None where each instance steps by itself
    step_stack: Any

    def takes_many(self, steps: ctypes.Structure) -> bool:
        """Return whether ``many_steps`` makes these steps."""

    @property
    def held_states(self) -> tuple[str, ...]:
        """States that `hold` leaves out."""

    @property
    def description(self) -> FmuDescription:
        """The FMU."""

    @property
    def one_thread(self) -> str | None:
        """Why only one thread may step it, in words; None where any thread may, beside its partners."""

    def check(self, status: int, call: str, time: float | None = None) -> None:
        """Raise unless a call's status is OK or Warning."""

    def progress_of_step(self) -> tuple[bool, float | None]:
        """After a step that was refused: whether the FMU ended its simulation by itself, and how far it came [s]."""

    def setup(self, start_time: float, stop_time: float | None) -> None:
        """Tell the times between which it is to run [s]."""

    def enter_initialization_mode(self) -> None:
        """From here on, start values can be given."""

    def exit_initialization_mode(self) -> None:
        """Compute the initial values; from here on it can step."""

    def hold(self, states: Sequence[str]) -> None:
        """Leave states out of the description of this instance, so that linear models have all but these."""

    def step(self, time: float, step_size: float) -> None:
        """One communication step [s]."""

    def reset(self) -> None:
        """Back to where it was after instantiation."""

    @property
    def renewable(self) -> bool:
        """Return whether `renew` makes a new instance, as it does in a process of its own."""

    def renew(self) -> None:
        """Free the instance and its library, and make a new one in the same process."""

    def close(self) -> None:
        """Terminate and free the instance, and remove what was made for it."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...

    def set(self, values: Mapping[str, float | bool]) -> None:
        """Set variables of any numeric type by name."""

    def read(self, batch: "RealBatch") -> None:
        """Read a batch; raise if the FMU logged an error, as it may after new parameters."""

    def get(self, names: Iterable[str]) -> dict[str, float]:
        """Read Real variables by name."""

    def values(self, names: Iterable[str]) -> dict[str, float | bool]:
        """Read variables of any numeric type by name; slower than `get`."""

    def jacobian(self, unknowns: Sequence[str], knowns: Sequence[str]) -> NDArray[np.float64]:
        """Partial derivatives of Real variables by others, from the FMU's own directional derivatives.

        Returns shape (unknowns, knowns)."""

    def save_state(self) -> Any:
        """A handle to a copy of the FMU's whole state; give it back to `restore_state`, then `free_state`."""

    def restore_state(self, state: Any) -> None:
        """Go back to a saved state."""

    def free_state(self, state: Any) -> None:
        """Forget a saved state."""

    def serialize_state(self, state: Any) -> bytes:
        """A saved state as bytes."""

    def deserialize_state(self, content: bytes) -> Any:
        """A handle to a state made from bytes; give it to `restore_state`, then to `free_state`."""


class Derived(Closing):
    """Methods of a component that use its other methods alone."""

    held_states: tuple[str, ...] = ()
    many_steps: Any = None
    step_stack: Any = None
    set_state: Any = None

    def takes_many(self, steps: ctypes.Structure) -> bool:
        return self.many_steps is not None

    @property
    def one_thread(self) -> str | None:
        return "in a process of its own"

    @property
    def renewable(self) -> bool:
        return False

    def renew(self: Component) -> None:
        raise InputError(f"component {self.name!r} is opened anew instead of being renewed")

    def hold(self: Component, states: Sequence[str]) -> None:
        whole: FmuDescription = vars(self).setdefault("_with_all_states", self.description)
        names, rates = whole.states, whole.rates
        kept = [k for k, name in enumerate(names) if name not in states]
        vars(self)["held_states"] = tuple(states)
        if len(rates) == len(names):
            rates = tuple(rates[k] for k in kept)
        states = tuple(names[k] for k in kept)
        vars(self)["description"] = replace(whole, states=states, rates=rates)

    def step(self: Component, time: float, step_size: float) -> None:
        with calls:
            self.check(self.do_step(self.pointer, time, step_size, 1), "fmi2DoStep", time)

    def get(self: Component, names: Iterable[str]) -> dict[str, float]:
        batch = RealBatch(self, tuple(names))
        return dict(zip(batch.names, batch.read().tolist(), strict=True))


def address_of(numbers: NDArray[Any]) -> int:
    """Return where an array's numbers begin. NumPy's ``ctypes.data`` says the same, and imports a module each time."""
    address: int = numbers.__array_interface__["data"][0]
    return address


class RealBatch:
    """Real variables of one component that are read or written together, without any copying.

    ``values``: Array of shape (n,), the caller's to read or fill."""

    def __init__(
        self, component: Component, names: Sequence[str], values: NDArray[np.float64] | None = None
    ) -> None:
        variables = component.description.variables
        self.names = tuple(names)
        unknown = [name for name in self.names if name not in variables]
        if unknown:
            raise InputError(
                f"component {component.name!r} has no variable {', '.join(map(repr, unknown))}; `gfor fmu info` lists "
                "them"
            )
        self.values = np.zeros(len(self.names)) if values is None else values
        self._references = (ctypes.c_uint * len(self.names))(
            *[variables[n].reference for n in self.names]
        )
        self.arguments = (
            component.pointer,
            ctypes.addressof(self._references),
            len(self.names),
            address_of(self.values),
        )
        self.component = component

    def read(self) -> NDArray[np.float64]:
        if self.names:
            with calls:
                self.component.check(self.component.get_real(*self.arguments), "fmi2GetReal")
        return self.values

    def write(self) -> None:
        if self.names:
            with calls:
                self.component.check(self.component.set_real(*self.arguments), "fmi2SetReal")

    def write_one(self, place: int) -> None:
        """Write one of the values alone, by its place in ``names``."""
        pointer, references, _, values = self.arguments
        only = (
            pointer,
            references + place * ctypes.sizeof(ctypes.c_uint),
            1,
            values + place * self.values.itemsize,
        )
        with calls:
            self.component.check(self.component.set_real(*only), "fmi2SetReal")

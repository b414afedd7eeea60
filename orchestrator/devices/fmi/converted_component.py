"""An FMU whose connected variables are converted on their way: to another unit, or between numbers and whole numbers.

The master couples numbers. A `ConvertedDescription` shows a connected variable as the number that its connection
carries, and the component behind it hands over what the FMU itself takes."""

import ctypes
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NoReturn, Self

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.component import Component, Derived, RealBatch
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo

_FAILED = 3  # fmi2Error
_HALF = 0.5  # from here on a number is true, so that a small perturbation turns no switch
WHOLE = ("Integer", "Enumeration", "Boolean")
"""Types that a connection carries as a number, and that are no Real."""


@dataclass(frozen=True)
class Conversion:
    """The FMU's own value as ``factor·x + offset``, for a number x in ``unit`` on the connection."""

    factor: float = 1.0
    offset: float = 0.0
    unit: str = ""

    def own(self, value: float) -> float:
        """A number of the connection, in the FMU's own unit."""
        return self.factor * value + self.offset

    def on_connection(self, value: float) -> float:
        """A value of the FMU, as the number that the connection carries."""
        return (value - self.offset) / self.factor


@dataclass(frozen=True, kw_only=True)
class ConvertedDescription(FmuDescription):
    """An FMU, described with the numbers that its connections carry.

    ``conversions``: of every variable that is shown otherwise than the FMU has it."""

    inner: FmuDescription
    conversions: Mapping[str, Conversion]

    @classmethod
    def of(cls, described: FmuDescription, variable: str, conversion: Conversion) -> Self:
        """The description with one more variable converted."""
        known: dict[str, Conversion] = {}
        if isinstance(described, ConvertedDescription):
            known, described = dict(described.conversions), described.inner
        conversions = {**known, variable: conversion}
        variables = {
            name: _as_carried(info, number, conversions.get(name))
            for number, (name, info) in enumerate(described.variables.items())
        }
        shared = {f.name: getattr(described, f.name) for f in fields(FmuDescription)}
        shared |= {"variables": variables, "gives_directional_derivatives": False}
        return cls(**shared, inner=described, conversions=conversions)


def native(description: FmuDescription) -> FmuDescription:
    """The FMU as its file describes it."""
    return description.inner if isinstance(description, ConvertedDescription) else description


def _as_carried(info: VariableInfo, number: int, conversion: Conversion | None) -> VariableInfo:
    """A variable under a reference of its own: those of the FMU are counted by type."""
    if conversion is None:
        return replace(info, reference=number)
    numbers = (
        None if value is None or isinstance(value, str) else conversion.on_connection(float(value))
        for value in (info.start, info.minimum, info.maximum)
    )
    start, minimum, maximum = numbers
    if conversion.factor < 0:
        minimum, maximum = maximum, minimum
    return replace(
        info,
        reference=number,
        type="Real",
        unit=conversion.unit,
        start=start,
        minimum=minimum,
        maximum=maximum,
        usual=None,
    )


@dataclass(frozen=True)
class _Parts:
    """A batch of variables, by how they are handed over; places are those in the batch."""

    reals: NDArray[np.int64]
    factors: NDArray[np.float64]
    offsets: NDArray[np.float64]
    batch: RealBatch
    whole: Sequence[tuple[int, str, str]]  # place, name and type of each variable that is no Real


class ConvertedComponent(Derived):
    """A running FMU behind the conversions of its connections."""

    def __init__(self, inner: Component, description: ConvertedDescription) -> None:
        self.name, self.inner, self.description = inner.name, inner, description
        self.pointer, self.do_step = inner.pointer, inner.do_step
        self._names = list(description.variables)
        self._parts: dict[bytes, _Parts] = {}
        self._error: BaseException | None = None
        address, size = ctypes.c_void_p, ctypes.c_size_t
        exchange = ctypes.CFUNCTYPE(ctypes.c_int, address, address, size, address)
        self.set_real = exchange(self._guarded(self._write))
        self.get_real = exchange(self._guarded(self._read))

    def _guarded(self, function: Callable[[_Parts, NDArray[np.float64]], int]) -> Any:
        """A function for C, which no exception may leave; `check` raises it."""

        def call(_pointer: int, references: int, n: int, values: int) -> int:
            if not n:
                return 0
            try:
                numbers = np.ctypeslib.as_array((ctypes.c_double * n).from_address(values))
                return function(self._apart(references, n), numbers)
            except BaseException as error:  # also Ctrl-C
                self._error = error
                return _FAILED

        return call

    def _apart(self, references: int, n: int) -> _Parts:
        key = ctypes.string_at(references, n * ctypes.sizeof(ctypes.c_uint))
        if key not in self._parts:
            names = [self._names[r] for r in np.frombuffer(key, dtype=np.uintc)]
            own = self.description.inner.variables
            kinds = [own[name].type for name in names]
            reals = [k for k, kind in enumerate(kinds) if kind == "Real"]
            whole = [(k, names[k], kind) for k, kind in enumerate(kinds) if kind != "Real"]
            ways = [self.description.conversions.get(names[k], Conversion()) for k in reals]
            factors = np.array([way.factor for way in ways])
            offsets = np.array([way.offset for way in ways])
            batch = RealBatch(self.inner, [names[k] for k in reals])
            places = np.array(reals, dtype=np.int64)
            self._parts[key] = _Parts(places, factors, offsets, batch, whole)
        return self._parts[key]

    def _write(self, parts: _Parts, numbers: NDArray[np.float64]) -> int:
        if len(parts.reals):
            parts.batch.values[:] = parts.factors * numbers[parts.reals] + parts.offsets
            status = int(self.inner.set_real(*parts.batch.arguments))
            if status > 1:
                return status
        whole = {name: _whole(self.name, name, kind, numbers[k]) for k, name, kind in parts.whole}
        if whole:
            self.inner.set(whole)
        return 0

    def _read(self, parts: _Parts, numbers: NDArray[np.float64]) -> int:
        if len(parts.reals):
            status = int(self.inner.get_real(*parts.batch.arguments))
            if status > 1:
                return status
            numbers[parts.reals] = (parts.batch.values - parts.offsets) / parts.factors
        if parts.whole:
            values = self.inner.values([name for _, name, _ in parts.whole])
            for k, name, _ in parts.whole:
                numbers[k] = float(values[name])
        return 0

    @property
    def one_thread(self) -> str | None:
        return "its connections are converted in Python, one at a time"

    def check(self, status: int, call: str, time: float | None = None) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error
        self.inner.check(status, call, time)

    def progress_of_step(self) -> tuple[bool, float | None]:
        return self.inner.progress_of_step()

    def setup(self, start_time: float, stop_time: float | None) -> None:
        self.inner.setup(start_time, stop_time)

    def enter_initialization_mode(self) -> None:
        self.inner.enter_initialization_mode()

    def exit_initialization_mode(self) -> None:
        self.inner.exit_initialization_mode()

    def reset(self) -> None:
        self.inner.reset()

    def close(self) -> None:
        self.inner.close()

    def set(self, values: Mapping[str, float | bool]) -> None:
        own = self.description.inner.variables
        ways = self.description.conversions
        given: dict[str, float | bool] = {}
        for name, value in values.items():
            if name not in ways:
                given[name] = value
            elif own[name].type == "Real":
                given[name] = ways[name].own(value)
            else:
                given[name] = _whole(self.name, name, own[name].type, value)
        self.inner.set(given)

    def read(self, batch: RealBatch) -> None:
        batch.read()

    def values(self, names: Iterable[str]) -> dict[str, float | bool]:
        ways = self.description.conversions
        found = self.inner.values(names)
        return {
            name: ways[name].on_connection(float(value)) if name in ways else value
            for name, value in found.items()
        }

    def jacobian(self, unknowns: Sequence[str], knowns: Sequence[str]) -> NoReturn:
        """Refuse: the FMU's derivatives are in its own units."""
        raise ComponentError(
            self.name,
            "fmi2GetDirectionalDerivative",
            "nothing",
            "behind conversions an FMU gives no directional derivatives; linearise by perturbation",
        )

    def save_state(self) -> Any:
        return self.inner.save_state()

    def restore_state(self, state: Any) -> None:
        self.inner.restore_state(state)

    def free_state(self, state: Any) -> None:
        self.inner.free_state(state)

    def serialize_state(self, state: Any) -> bytes:
        return self.inner.serialize_state(state)

    def deserialize_state(self, content: bytes) -> Any:
        return self.inner.deserialize_state(content)


def _whole(component: str, name: str, kind: str, value: float) -> float | bool:
    """The nearest whole number, or the switch, that a number on a connection stands for."""
    if not np.isfinite(value):
        raise ComponentError(
            component, f"setting {name}", "nothing", f"its connection carries {value}, no number"
        )
    return bool(value > _HALF) if kind == "Boolean" else round(value)

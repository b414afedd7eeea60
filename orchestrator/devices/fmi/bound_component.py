"""A running FMU behind our port: its variables are converted in C, between the master and the FMU.

The converted component has the same three functions as any other, so the compiled loop needs to know nothing of
bindings, and components without one lose no time."""

import ctypes
import struct
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

from fmus.toolchain.compiler import compile_here
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.errors import ComponentError, InputError, NotFiniteError
from orchestrator.core.interrupts import calls
from orchestrator.devices.fmi.component import Component, Derived, RealBatch
from orchestrator.devices.fmi.port_mapping import (
    PORT,
    START,
    BoundDescription,
    PhasorMap,
    SignalMap,
)

_SOURCE = Path(__file__).with_name("port_adapter.c")


class _Other(ctypes.Structure):
    _fields_ = (
        ("factor", ctypes.c_double),
        ("offset", ctypes.c_double),
        ("reference", ctypes.c_uint),
        ("unused", ctypes.c_uint),
    )


class _Port(ctypes.Structure):
    _fields_ = (
        ("form", ctypes.c_int64),
        ("matrix", ctypes.c_double * 4),
        ("angle_factor", ctypes.c_double),
        ("moment", ctypes.c_double),
        ("references", ctypes.c_uint * 4),
    )


class _Adapter(ctypes.Structure):
    _fields_ = (
        ("component", ctypes.c_void_p),
        ("set_real", ctypes.c_void_p),
        ("get_real", ctypes.c_void_p),
        ("step", ctypes.c_void_p),
        ("steps", ctypes.c_void_p),
        ("others", ctypes.c_void_p),
        ("n_others", ctypes.c_int64),
        ("voltage", _Port),
        ("current", _Port),
        ("omega", ctypes.c_double),
        ("power_scale", ctypes.c_double),
        ("v", ctypes.c_double * 2),
        ("time", ctypes.c_double),
        ("angle", ctypes.c_double),
    )


@cache
def compiled_adapter() -> Any:
    try:
        return ctypes.PyDLL(str(compile_here(_SOURCE)))
    except (OSError, RuntimeError) as error:
        raise InputError(f"a binding is compiled, and {error}") from error


class BoundComponent(Derived):
    def __init__(self, inner: Component, description: BoundDescription) -> None:
        self.name, self.description, self.inner = inner.name, description, inner
        self._port, self._inner_names = description.port, description.inner_names
        self._start = self._delivered_start()
        self._start_is_new = True
        self._adapter = _Adapter()
        self._fill()
        self.pointer = ctypes.addressof(self._adapter)
        library = compiled_adapter()
        address, size, real, flag = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_int
        exchange = ctypes.PYFUNCTYPE(ctypes.c_int, address, address, size, address)
        self.set_real = exchange(("adapter_set_real", library))
        self.get_real = exchange(("adapter_get_real", library))
        self.do_step = ctypes.PYFUNCTYPE(ctypes.c_int, address, real, real, flag)(
            ("adapter_do_step", library)
        )
        many = ctypes.PYFUNCTYPE(ctypes.c_int, address, address, address)
        self.many_steps = many(("adapter_many_steps", library))
        self._takes_many = ctypes.PYFUNCTYPE(ctypes.c_int, address, address)(
            ("adapter_takes_many", library)
        )
        try:
            self.set(self._port.settings, own=True)
        except BaseException:
            self.close()
            raise

    def _fill(self) -> None:
        adapter, variables = self._adapter, self.description.inner.variables
        adapter.component = self.inner.pointer
        for field in ("set_real", "get_real"):
            setattr(adapter, field, ctypes.cast(getattr(self.inner, field), ctypes.c_void_p))
        adapter.step = ctypes.cast(self.inner.do_step, ctypes.c_void_p)
        if self.inner.many_steps is not None:
            adapter.steps = ctypes.cast(self.inner.many_steps, ctypes.c_void_p)
        self._others = (_Other * max(1, len(self._inner_names)))()
        for other, (name, own) in zip(self._others, self._inner_names.items(), strict=False):
            signal = self._port.signals.get(name)
            other.factor, other.offset = (signal.factor, signal.offset) if signal else (1.0, 0.0)
            other.reference = variables[own].reference
        adapter.others, adapter.n_others = ctypes.addressof(self._others), len(self._inner_names)
        self._fill_port(adapter.voltage, self._port.voltage)
        self._fill_port(adapter.current, self._port.current)
        adapter.omega = self._port.omega
        adapter.v[0] = 1.0
        self._scale()

    def _fill_port(self, field: Any, phasor: PhasorMap) -> None:
        field.form, field.angle_factor = int(phasor.form), phasor.angle_factor
        field.moment = phasor.moment
        field.matrix[:] = phasor.matrix
        for place, variable in enumerate(phasor.variables):
            field.references[place] = self.description.inner.variables[variable].reference

    def _scale(self) -> None:
        """Set what depends on the rating: several units in parallel, or one that was given another rating."""
        S_n, current = self._start["S_n"], self._port.current
        factor = S_n / self._port.rating if current.per_rating else 1.0
        self._adapter.current.matrix[:] = [factor * element for element in current.matrix]
        self._adapter.power_scale = SYSTEM_BASE_MVA / S_n
        for other, name in zip(self._others, self._inner_names, strict=False):
            if name in self._port.signals:
                other.factor = self._factor(self._port.signals[name])

    def _factor(self, signal: SignalMap) -> float:
        return signal.factor_at(self._start["S_n"] / self._port.rating)

    def takes_many(self, steps: ctypes.Structure) -> bool:
        return bool(self._takes_many(self.pointer, ctypes.addressof(steps)))

    @property
    def one_thread(self) -> str | None:
        return self.inner.one_thread

    def check(self, status: int, call: str, time: float | None = None) -> None:
        try:
            self.inner.check(status, call, time)
        except NotFiniteError:
            raise
        except ComponentError as error:
            cause = self.description.likely_cause()
            if not cause:
                raise
            said = f"{error.log}; {cause}"
            raise ComponentError(
                error.component, error.call, error.status, said, error.time, error.kind
            ) from error

    def progress_of_step(self) -> tuple[bool, float | None]:
        return self.inner.progress_of_step()

    def setup(self, start_time: float, stop_time: float | None) -> None:
        self._send_start()
        self._adapter.time = start_time
        self.inner.setup(start_time, stop_time)

    def enter_initialization_mode(self) -> None:
        self._send_start()
        self.inner.enter_initialization_mode()

    def exit_initialization_mode(self) -> None:
        self._send_start()
        self.inner.exit_initialization_mode()

    def close(self) -> None:
        self.inner.close()

    def set(self, values: Mapping[str, float | bool], *, own: bool = False) -> None:
        """Set variables by name; ``own`` means the FMU's own names."""
        if not own:
            start = {name: float(value) for name, value in values.items() if name in self._start}
            self._start |= start
            self._start_is_new |= bool(start)
        for name, value in values.items():
            if not own and name in self._start:
                continue  # known before the others, whose base S_n may be
            if not own and name in PORT:
                self._write_port(name, float(value))
            elif own or name in self._inner_names:
                target = name if own else self._inner_names[name]
                signal = None if own else self._port.signals.get(name)
                scaled = signal is not None and self.description.variables[name].type == "Real"
                self.inner.set(
                    {
                        target: (value - signal.offset) / self._factor(signal)
                        if signal and scaled
                        else value
                    }
                )
            else:
                raise InputError(
                    f"component {self.name!r} has no variable {name!r}; `gfor fmu info` lists them"
                )
        self._scale()

    def read(self, batch: RealBatch) -> None:
        self.inner.read(batch)

    def jacobian(self, unknowns: Sequence[str], knowns: Sequence[str]) -> NoReturn:
        """Refuse: the FMU's derivatives are of its own variables, not of the port's."""
        raise ComponentError(
            self.name,
            "fmi2GetDirectionalDerivative",
            "nothing",
            "behind a binding an FMU gives no directional derivatives; linearise by perturbation",
        )

    def values(self, names: Iterable[str]) -> dict[str, float | bool]:
        found: dict[str, float | bool] = {}
        for name in names:
            if name in self._start:
                found[name] = self._start[name]
            elif self.description.variables[name].type == "Real":
                found |= self.get([name])
            else:
                found[name] = self.inner.values([self._inner_names[name]])[self._inner_names[name]]
        return found

    def _write_port(self, name: str, value: float) -> None:
        if name not in ("v_re", "v_im"):
            raise InputError(
                f"component {self.name!r}: {name} is computed by the FMU and cannot be set"
            )
        reference, number = ctypes.c_uint(PORT.index(name)), ctypes.c_double(value)
        with calls:
            status = self.set_real(
                self.pointer, ctypes.addressof(reference), 1, ctypes.addressof(number)
            )
        self.check(status, f"setting {name} = {value}")

    def _send_start(self) -> None:
        """Give the FMU its start values in its own names, units and bases."""
        if not self._start_is_new:
            return
        self._start_is_new = False
        rating = self._start["S_n"] / self._port.rating
        for name, value in self._start.items():
            for target in self._port.start.get(name, ()):
                scale = rating if target.per_rating else 1.0
                self.inner.set({target.variable: scale * target.factor * value + target.offset})

    def save_state(self) -> Any:
        adapter = self._adapter
        own = (
            *adapter.v,
            adapter.time,
            adapter.angle,
            float(self._start_is_new),
            *self._start.values(),
        )
        return self.inner.save_state(), own

    def restore_state(self, state: Any) -> None:
        inner, (re, im, self._adapter.time, self._adapter.angle, new, *start) = state
        self._adapter.v[:] = re, im
        self._start, self._start_is_new = dict(zip(self._start, start, strict=True)), bool(new)
        self._scale()
        self.inner.restore_state(inner)

    def free_state(self, state: Any) -> None:
        self.inner.free_state(state[0])

    def serialize_state(self, state: Any) -> bytes:
        """The FMU's own state as bytes, behind those of the conversion."""
        inner, own = state
        return struct.pack(f"<{len(own)}d", *own) + self.inner.serialize_state(inner)

    def deserialize_state(self, content: bytes) -> Any:
        form = struct.Struct(f"<{5 + len(self._start)}d")
        return self.inner.deserialize_state(content[form.size :]), form.unpack_from(content)

    def reset(self) -> None:
        """Back to where it was after instantiation; the start values are sent again."""
        self.inner.reset()
        self._begin_again()

    @property
    def renewable(self) -> bool:
        return self.inner.renewable

    def renew(self) -> None:
        self.inner.renew()
        self._start = self._delivered_start()
        self._scale()
        self._begin_again()

    def _delivered_start(self) -> dict[str, float]:
        variables = self.description.variables
        return {name: variables[name].start_number for name in START if name in variables}

    def _begin_again(self) -> None:
        self._adapter.v[:] = (1.0, 0.0)
        self._adapter.time = self._adapter.angle = 0.0
        self._start_is_new = True
        self.set(self._port.settings, own=True)

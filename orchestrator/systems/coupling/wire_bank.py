"""The connections into one group of components that change what they carry, stepped as a component before the group.

The compiled loop calls a bank as it calls an FMU, so that it is the same loop with connections of this kind as without.
Where no library can be compiled, the same arithmetic runs in Python and gives the same bits."""

import ctypes
import hashlib
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.compiler import compile_here
from orchestrator.core.errors import InputError
from orchestrator.systems.coupling.imperfections import (
    Bias,
    Delay,
    DropOut,
    Imperfection,
    Noise,
    Quantisation,
    WirePlan,
)

STRETCH = 1000  # communication steps for which the noise is made at once
# what a wire gives on: as the numbers of the compiled loop
_PASS = 0  # the value
_HOLD = 1  # the last value, while it is lost
_SUBSTITUTE = 2  # a given value, while it is lost
_REALS = ("bias", "deviation", "keep", "fresh", "quantum", "substitute", "coloured", "last")
_INTEGERS = ("mode", "delay", "capacity", "head", "started")
_WIRE = np.dtype(
    [*((n, "f8") for n in _REALS), *((n, "i8") for n in _INTEGERS), ("ring", "u8"), ("white", "u8")]
)
_STATE = ("coloured", "last", "head", "started")
_SETTING = ("bias", "deviation", "keep", "fresh", "quantum", "substitute", "mode", "delay")


_ADDRESS = ctypes.c_void_p
_GET_SET = ctypes.PYFUNCTYPE(ctypes.c_int, _ADDRESS, _ADDRESS, ctypes.c_size_t, _ADDRESS)
_STEP = ctypes.PYFUNCTYPE(ctypes.c_int, _ADDRESS, ctypes.c_double, ctypes.c_double, ctypes.c_int)
"""The functions that a bank is called with, from C as from Python."""

_nothing = _GET_SET(lambda *_: 0)


class _Bank(ctypes.Structure):
    _fields_ = (
        ("wires", ctypes.c_void_p),
        ("inputs", ctypes.c_void_p),
        ("outputs", ctypes.c_void_p),
        ("n", ctypes.c_int64),
        ("position", ctypes.c_int64),
        ("quiet", ctypes.c_int64),
    )


@cache
def _library() -> Any | None:
    try:
        library = ctypes.PyDLL(str(compile_here(Path(__file__).with_name("imperfect_wires.c"))))
    except (OSError, RuntimeError):
        return None
    for function in (library.wires_set_real, library.wires_get_real):
        function.argtypes = [_ADDRESS, _ADDRESS, ctypes.c_size_t, _ADDRESS]
    library.wires_step.argtypes = [_ADDRESS, ctypes.c_double, ctypes.c_double, ctypes.c_int]
    return library


class WireValues:
    """Values that a bank takes or gives, in the form of a `RealBatch`."""

    def __init__(
        self, component: "WireBank", names: Sequence[str], values: NDArray[np.float64]
    ) -> None:
        self.component, self.names, self.values = component, tuple(names), values
        self.arguments = (component.pointer, 0, len(self.names), values.ctypes.data)


class WireBank:
    """The connections of a system into one group that do more than carry a value.

    ``step_size``: communication step [s].
    ``sources``: index of each connection's output in the system's vector y.
    ``outputs``: where what arrives is written, shape (number of connections,).
    ``window``: where that is in the vector that the loop reads.
    Raises an `InputError` if a delay is no multiple of the communication step, or a noise's bandwidth is beyond what
    the step shows."""

    name = "connections"
    one_thread = "no FMU"
    step_stack = None

    def __init__(
        self,
        plans: Sequence[WirePlan],
        step_size: float,
        sources: NDArray[np.int64],
        outputs: NDArray[np.float64],
        window: slice,
    ) -> None:
        self.plans, self._step_size, self.sources, self.window = (
            tuple(plans),
            step_size,
            sources,
            window,
        )
        n = len(plans)
        self._wires = np.zeros(n, dtype=_WIRE)
        longest = [
            max((whole_steps(s, step_size, p.name) for s in p.delays), default=0) for p in plans
        ]
        self._rings = [np.zeros(steps + 1 if steps else 0) for steps in longest]
        self._white = np.zeros((n, STRETCH))
        self._keys = [0] * n
        for plan in plans:
            _check_bandwidths(plan, step_size)
        for k, ring in enumerate(self._rings):
            self._wires[k]["capacity"] = len(ring)
            self._wires[k]["ring"], self._wires[k]["white"] = (
                ring.ctypes.data,
                self._white[k].ctypes.data,
            )
        inputs = np.zeros(n)
        self._bank = _Bank(
            self._wires.ctypes.data, inputs.ctypes.data, outputs.ctypes.data, n, 0, 0
        )
        self.pointer = ctypes.addressof(self._bank)
        names = [plan.name for plan in plans]
        self.inputs, self.outputs = (
            WireValues(self, names, inputs),
            WireValues(self, names, outputs),
        )
        library = _library()
        self.set_real = library.wires_set_real if library else _nothing
        self.get_real = library.wires_get_real if library else _nothing
        self.do_step = library.wires_step if library else _STEP(self._do_step)
        for k, plan in enumerate(plans):
            for imperfection in plan.permanent.values():
                self._begin(k, imperfection)

    @property
    def component(self) -> "WireBank":
        return self

    @property
    def delivered(self) -> NDArray[np.int64]:
        """Return what the loop gathers for the bank: outputs of components, as they are."""
        return self.sources

    def check(self, status: int, call: str, time: float | None = None) -> None:
        """Nothing in a bank can fail."""

    def step(self, time: float, step_size: float) -> None:
        self._do_step(self.pointer, time, step_size, 1)

    def begin(self, k: int, imperfection: Imperfection) -> None:
        """From now on a connection has this imperfection, in place of another of its kind."""
        plan = self.plans[k]
        if imperfection not in (*plan.later, *plan.permanent.values()):
            raise InputError(
                f"connection {plan.name}: {imperfection} was not announced before the run"
            )
        self._begin(k, imperfection)

    def end(self, k: int, kind: type[Imperfection]) -> None:
        """From now on a connection is as its permanent settings have it."""
        wire = self._wires[k]
        for field in {
            Bias: ("bias",),
            Noise: ("deviation",),
            Quantisation: ("quantum",),
            Delay: ("delay",),
            DropOut: ("mode",),
        }[kind]:
            wire[field] = 0
        if kind in self.plans[k].permanent:
            self._begin(k, self.plans[k].permanent[kind])

    def _begin(self, k: int, imperfection: Imperfection) -> None:
        wire, plan = self._wires[k], self.plans[k]
        match imperfection:
            case Bias():
                wire["bias"] = imperfection.value
            case Noise():
                band = imperfection.bandwidth
                keep = 0.0 if band is None else math.exp(-2 * math.pi * band * self._step_size)
                wire["keep"], wire["fresh"] = keep, math.sqrt(1 - keep * keep)
                wire["deviation"], wire["started"] = imperfection.deviation, 0
                digest = hashlib.sha256(f"{imperfection.seed}\0{plan.name}".encode()).digest()
                self._keys[k] = int.from_bytes(digest[:16], "little")
            case Quantisation():
                wire["quantum"] = imperfection.step
            case Delay():
                wire["delay"] = whole_steps(imperfection.seconds, self._step_size, plan.name)
            case DropOut():
                wire["mode"] = _HOLD if imperfection.substitute is None else _SUBSTITUTE
                wire["substitute"] = imperfection.substitute or 0.0

    @property
    def quiet(self) -> bool:
        return bool(self._bank.quiet)

    @quiet.setter
    def quiet(self, value: bool) -> None:
        self._bank.quiet = value

    def prepare(self, index: int, count: int) -> None:
        """Make the noise of the next communication steps, at most `STRETCH`."""
        self._bank.position = 0
        for k in np.flatnonzero(self._wires["deviation"]):
            self._white[k, :count] = white(self._keys[k], index, count)

    def settle(self, y: NDArray[np.float64], *, first: bool = False) -> None:
        """Let what arrives be what would after a long time with these outputs, without noise and quantisation."""
        for k, wire in enumerate(self._wires):
            value = y[self.sources[k]] + wire["bias"]
            self._rings[k][:] = value
            if wire["mode"] == _HOLD and not first:
                value = wire["last"]
            if wire["mode"] == _SUBSTITUTE:
                value = wire["substitute"]
            wire["last"] = self.outputs.values[k] = value

    def _do_step(self, pointer: int, time: float, step_size: float, kept: int) -> int:
        position, quiet = self._bank.position, self.quiet
        for k, w in enumerate(self._wires):
            value = float(self.inputs.values[k])
            if w["bias"] != 0:
                value += float(w["bias"])
            if w["deviation"] != 0 and not quiet:
                now = float(self._white[k, position])
                if w["started"]:
                    now = float(w["keep"]) * float(w["coloured"]) + float(w["fresh"]) * now
                w["coloured"], w["started"] = now, 1
                value += float(w["deviation"]) * now
            if w["quantum"] != 0 and not quiet:
                value = float(w["quantum"]) * float(np.rint(value / float(w["quantum"])))
            if w["capacity"]:
                ring, head = self._rings[k], int(w["head"])
                ring[head] = value
                value = float(ring[(head - int(w["delay"])) % len(ring)])
                w["head"] = (head + 1) % len(ring)
            if w["mode"] == _HOLD:
                value = float(w["last"])
            if w["mode"] == _SUBSTITUTE:
                value = float(w["substitute"])
            w["last"] = self.outputs.values[k] = value
        self._bank.position += 1
        return 0

    def state(self) -> dict[str, NDArray[np.float64]]:
        """All that the next step depends on beside the components, as arrays of numbers."""
        table = np.array(
            [[float(wire[name]) for name in (*_SETTING, *_STATE)] for wire in self._wires]
        )
        keys = np.array(
            [[float((key >> (32 * part)) & 0xFFFFFFFF) for part in range(4)] for key in self._keys]
        )
        return {
            "wires": table,
            "keys": keys,
            "rings": np.concatenate(self._rings),
            "delivered": self.outputs.values.copy(),
        }

    def restore(self, state: dict[str, NDArray[np.float64]]) -> None:
        for wire, row in zip(self._wires, state["wires"], strict=True):
            for name, value in zip((*_SETTING, *_STATE), row.tolist(), strict=True):
                wire[name] = value
        self._keys = [
            sum(int(part) << (32 * p) for p, part in enumerate(row.tolist()))
            for row in state["keys"]
        ]
        first = 0
        for ring in self._rings:
            ring[:] = state["rings"][first : first + len(ring)]
            first += len(ring)
        self.outputs.values[:] = state["delivered"]


def whole_steps(seconds: float, step_size: float, where: str) -> int:
    steps = round(seconds / step_size)
    if abs(seconds - steps * step_size) > 1e-6 * step_size:
        nearest = max(steps, 0) * step_size
        raise InputError(
            f"connection {where}: a delay of {seconds:g} s is no multiple of the communication step of "
            f"{step_size:g} s; the nearest is {nearest:g} s"
        )
    return steps


def _check_bandwidths(plan: WirePlan, step_size: float) -> None:
    for noise in (*plan.permanent.values(), *plan.later):
        if (
            isinstance(noise, Noise)
            and noise.bandwidth is not None
            and noise.bandwidth >= 0.5 / step_size
        ):
            raise InputError(
                f"connection {plan.name}: noise up to {noise.bandwidth:g} Hz does not fit a communication step of "
                f"{step_size:g} s, which shows {0.5 / step_size:g} Hz at most; leave the bandwidth out for white noise"
            )


_BLOCK = 1024  # values of one setting of the counter


def white(key: int, first: int, count: int) -> NDArray[np.float64]:
    """Values of standard deviation 1 for ``count`` communication steps from ``first`` on, shape (count,)."""
    blocks = range(first // _BLOCK, (first + count - 1) // _BLOCK + 1) if count else range(0)
    values = [
        np.random.Generator(np.random.Philox(key=key, counter=[0, b, 0, 0])).standard_normal(_BLOCK)
        for b in blocks
    ]
    start = first % _BLOCK
    whole = np.concatenate(values) if values else np.zeros(0)
    return whole[start : start + count]

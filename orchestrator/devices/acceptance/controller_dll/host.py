"""A host of a controller DLL: instances in memory of its process, and sessions of calls."""

import ctypes
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fmus.vendor_dll.interface import DllInterface, Place, layout
from fmus.vendor_dll.state_trial import InstanceStructure, moving_input, pack_value
from orchestrator.devices.sandbox.dll_process import DllProcess, Order

ARRAYS = ("inputs", "outputs", "parameters", "integer states", "float states", "double states")
INPUTS = 0  # place among `ARRAYS`
OUTPUTS = 1  # the same
PARAMETERS = 2  # the same
_STATES = range(3, 6)  # places among `ARRAYS`
_SIZES_OF_STATES = (4, 4, 8)  # of one integer, float and double state [bytes]
_MARK = 0xA5  # what lies around the arrays
_ROOM = 256  # around arrays that no closed page guards [bytes]
_TIME_AT = 24  # place of the time in an instance's structure [bytes]
_EMT = 1  # mode of a host
_RMS = 2  # mode of a host, and of a DLL that is for such hosts alone
START = ("FirstCall", "CheckParameters", "Initialize")
REAL_CODES = {8: "f", 9: "d"}
"""Number of a data type of real numbers → its code in `struct`."""
_TEXT = 10  # number of the data type of texts


@dataclass(frozen=True)
class Heard:
    """The answer to one call."""

    call: str
    instance: int
    time: float  # [s]
    code: int
    text: str | None
    outputs: bytes
    states: bytes

    @property
    def answer(self) -> tuple[int, bytes, bytes]:
        """All of it that two equal runs have in common."""
        return self.code, self.outputs, self.states


@dataclass(frozen=True)
class Placement:
    """Where the arrays lie.

    ``guarded``: places among `ARRAYS` that end (or begin) at a page that nobody may touch; the others lie between
    marked bytes. ``at_the_end``: which of the two. ``filling``: byte with which the state arrays begin."""

    guarded: tuple[int, ...] = ()
    at_the_end: bool = True
    filling: int = 0


class Instance:
    """One instance of a DLL in the memory of its process."""

    def __init__(
        self,
        process: DllProcess,
        interface: DllInterface,
        texts: Mapping[str, str],
        placement: Placement,
        largest: float,
        phase: int,
    ) -> None:
        self._process, self._interface, self.largest = process, interface, largest
        self._phase = phase  # of its inputs, as a number of inputs
        rows = (interface.inputs, interface.outputs, interface.parameters)
        self.layouts = [layout(row) for row in rows]
        states = [n * size for n, size in zip(interface.states, _SIZES_OF_STATES, strict=True)]
        self.sizes = [found.size for found in self.layouts] + states
        self.at, self._slack = self._allocated(placement)
        self._at, self._structure_slack = self._roomy(ctypes.sizeof(InstanceStructure))
        mode = _RMS if interface.mode == _RMS else _EMT
        self._structure = bytes(
            InstanceStructure(*self.at[:3], 0.0, mode, None, None, *self.at[3:])
        )
        self._given = self._parameters(texts)
        filled = bytes([placement.filling])
        process.do(
            [
                ["write", self._at, self._structure.hex()],
                ["write", self.at[PARAMETERS], self._given.hex()],
                *(["write", self.at[k], (filled * self.sizes[k]).hex()] for k in _STATES),
            ]
        )

    def _roomy(self, size: int) -> tuple[int, list[tuple[int, int]]]:
        (begin,) = self._process.do([["allocate", size + 2 * _ROOM]])
        begin += -begin % 16
        slack = [(begin, _ROOM // 2), (begin + _ROOM // 2 + size, _ROOM // 2)]
        self._process.do([["write", at, bytes([_MARK] * n).hex()] for at, n in slack])
        return begin + _ROOM // 2, slack

    def _allocated(self, placement: Placement) -> tuple[list[int], list[list[tuple[int, int]]]]:
        """Address of each array, and the marked stretches around it."""
        places, slack = [], []
        for k, size in enumerate(self.sizes):
            if k not in placement.guarded:
                at, around = self._roomy(size)
            else:
                ((at, begin, inner),) = self._process.do([["guarded", size, placement.at_the_end]])
                stretches = [(begin, at - begin), (at + size, begin + inner - at - size)]
                around = [(where, n) for where, n in stretches if n > 0]
                self._process.do(
                    [["write", where, bytes([_MARK] * n).hex()] for where, n in around]
                )
            places.append(at)
            slack.append(around)
        return places, slack

    def _parameters(self, texts: Mapping[str, str]) -> bytes:
        content = bytearray(self.sizes[PARAMETERS])
        for row, place in zip(
            self._interface.parameters, self.layouts[PARAMETERS].places, strict=True
        ):
            if row.data_type == _TEXT:
                text = texts.get(row.name, str(row.default)).encode() + b"\0"
                (address,) = self._process.do([["allocate", len(text)]])
                self._process.do([["write", address, text.hex()]])
                struct.pack_into("P", content, place.offset, address)
            elif not isinstance(row.default, str):
                pack_value(content, row, place.offset, row.default)
        return bytes(content)

    def inputs(self, sample: int) -> bytearray:
        """Inputs of a sample, which move."""
        content = bytearray(self.sizes[INPUTS])
        for k, place in enumerate(self.layouts[INPUTS].places):
            kind = place.type.kind
            if kind != "String":
                value = moving_input(sample, k + self._phase, kind, self.largest)
                pack_value(content, place.row, place.offset, value)
        return content

    def with_not_a_number(self, sample: int, place: int, value: float) -> bytearray:
        """Inputs of a sample with one of them replaced."""
        content, at = self.inputs(sample), self.real_inputs[place]
        struct.pack_into(REAL_CODES[at.row.data_type], content, at.offset, value)
        return content

    @property
    def real_inputs(self) -> list[Place]:
        """Inputs that can hold what is no number."""
        return [place for place in self.layouts[INPUTS].places if place.row.data_type in REAL_CODES]

    def orders_of(self, call: str, time: float) -> list[Order]:
        """Set the time, call, and read outputs and states."""
        return [
            ["write", self._at + _TIME_AT, struct.pack("d", time).hex()],
            ["call", call, self._at],
            ["read", self.at[OUTPUTS], self.sizes[OUTPUTS]],
            *(["read", self.at[k], self.sizes[k]] for k in _STATES),
        ]

    def order_of_many(self, call: str, times: int) -> Order:
        return ["repeat", call, self._at, times]

    def snapshot(self) -> list[str]:
        """Outputs and states, to be put back by `restore`; as the orders have them."""
        return self._process.do([["read", self.at[k], self.sizes[k]] for k in (OUTPUTS, *_STATES)])

    def restore(self, kept: Sequence[str]) -> None:
        """Put back what `snapshot` gave, perhaps of another instance."""
        places = zip((OUTPUTS, *_STATES), kept, strict=True)
        self._process.do([["write", self.at[k], content] for k, content in places])

    def arrays_left(self) -> list[str]:
        """Arrays around which something was written, in words."""
        found = []
        for name, around in [
            *zip(ARRAYS, self._slack, strict=True),
            ("structure", self._structure_slack),
        ]:
            seen = self._process.do([["read", at, n] for at, n in around])
            if any(text != f"{_MARK:02x}" * (len(text) // 2) for text in seen):
                found.append(name)
        return found

    def changes(self) -> tuple[list[str], bool]:
        """Members of its structure that a DLL must leave to its host, and has changed; and if its parameters did."""
        structure, parameters = (
            bytes.fromhex(text)
            for text in self._process.do(
                [
                    ["read", self._at, len(self._structure)],
                    ["read", self.at[PARAMETERS], self.sizes[PARAMETERS]],
                ]
            )
        )
        given, now = (
            InstanceStructure.from_buffer_copy(content) for content in (self._structure, structure)
        )
        theirs = ("inputs", "outputs", "parameters", "mode", "ints", "floats", "doubles")
        found = [name for name in theirs if getattr(given, name) != getattr(now, name)]
        return found, parameters != self._given


@dataclass
class _Entry:
    call: str
    instance: int
    time: float
    first: int  # place of the answer to the call
    count: int  # of the answers that follow it


class Session:
    """Calls of one or more instances in an order, made at once.

    ``step``: between two samples [s]."""

    def __init__(self, process: DllProcess, interface: DllInterface, step: float) -> None:
        self._process, self._interface, self.step = process, interface, step
        self._orders: list[Order] = []
        self._entries: list[_Entry] = []
        self._instances: list[Instance] = []
        self.in_thread = False  # whether the calls come from another thread than before

    def _number(self, instance: Instance) -> int:
        if instance not in self._instances:
            self._instances.append(instance)
        return self._instances.index(instance)

    def call(self, instance: Instance, name: str, time: float = 0.0) -> None:
        """Call a function, if the DLL has it."""
        if name not in self._interface.calls:
            return
        orders = instance.orders_of(name, time)
        first = len(self._orders) + 1
        entry = _Entry(name, self._number(instance), time, first, len(orders) - 2)
        self._entries.append(entry)
        self._orders += orders

    def start(self, instance: Instance, time: float = 0.0) -> None:
        """First calls, with the inputs of the first sample."""
        self._orders.append(["write", instance.at[INPUTS], instance.inputs(0).hex()])
        for name in START:
            self.call(instance, name, time)

    def sample(
        self,
        instance: Instance,
        sample: int,
        time: float | None = None,
        inputs: bytes | None = None,
    ) -> None:
        given = bytes(instance.inputs(sample)) if inputs is None else inputs
        self._orders.append(["write", instance.at[INPUTS], given.hex()])
        self.call(instance, "Outputs", sample * self.step if time is None else time)

    def samples(self, instance: Instance, first: int, count: int) -> None:
        for sample in range(first, first + count):
            self.sample(instance, sample)

    def play(self) -> list[Heard]:
        """Make the calls; what came of each."""
        orders, entries = self._orders, self._entries
        self._orders, self._entries = [], []
        if self.in_thread:
            (answers,) = self._process.do([["thread", orders]])
        else:
            answers = self._process.do(orders)
        found = []
        for entry in entries:
            code, text = answers[entry.first]
            outputs, *states = answers[entry.first + 1 : entry.first + 1 + entry.count]
            heard = Heard(
                call=entry.call,
                instance=entry.instance,
                time=entry.time,
                code=int(code),
                text=text if text is None else str(text),
                outputs=bytes.fromhex(outputs),
                states=bytes.fromhex("".join(states)),
            )
            found.append(heard)
        return found

"""Instances of a native FMU that step side by side: the bits that each has alone, whatever one of them does."""

import ctypes
import math

import numpy as np
import pytest

from fmus.toolchain import symbols
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import cached
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.systems.coupling.compiled_loop import SIDE_BY_SIDE

OK, DISCARD = 0, 2
H = 1e-3


def operations():
    """Each operation of equations once, on an input and a state, and a state that moves at a step's end."""
    m = ModelBuilder("operations", "Every operation", internal_step=1e-4)
    u = m.input("u", "1", "Input", start=0.3)
    k = m.parameter("k", 0.7, "1", "Factor", tunable=True)
    nothing = m.parameter("nothing", 0.0, "1", "Zero", tunable=True)
    x = m.state("x", 0.5, "1", "State")
    held = m.state("held", 0.1, "1", "Stepwise state", stepwise=True)
    m.derivative(x, u * k - x)
    m.derivative(held, x)
    one = [symbols.sin, symbols.cos, symbols.tan, symbols.exp, symbols.fabs, symbols.floor]
    one += [symbols.atan, symbols.logic_not, lambda a: -a, lambda a: 1 / a, lambda a: a * a]
    one += [lambda a: symbols.sqrt(symbols.fabs(a)), lambda a: symbols.log(symbols.fabs(a))]
    two = [symbols.fmin, symbols.fmax, symbols.atan2, symbols.copysign, symbols.logic_and]
    two += [symbols.logic_or, lambda a, b: a < b, lambda a, b: a <= b, lambda a, b: a == b]
    two += [lambda a, b: a != b, lambda a, b: symbols.if_else(a, b, 0.0), lambda a, b: a - b]
    two += [lambda a, b: a / b, lambda a, b: symbols.fabs(a) ** b]
    for n, operation in enumerate(one):
        m.output(f"one_{n}", operation(x - u), "1", "Of one operand")
    for n, operation in enumerate(two):
        m.output(f"two_{n}", operation(x, u + held), "1", "Of two operands")
        m.output(f"equal_{n}", operation(u, k), "1", "Of operands that may be equal")
    for n, operation in enumerate(two[:6]):  # without a division
        m.output(f"zero_{n}", operation(u, nothing), "1", "Of two zeros, perhaps")
    return m.build()


MODELS = {
    "operations": operations,
    "gfor_phasor": lambda: build_model("gfor_phasor"),
    "gfor": lambda: build_model("gfor"),
    "machine": lambda: build_model("synchronous_generator_ac4a_phasor"),
}
SPECIAL = (0.7, 0.0, -0.0, 1e300, -1e300, 5e-324)


class Row:
    """So many instances of one FMU; the second may have another internal step."""

    def __init__(self, model, count, internal_step=None):
        description = read_description(cached(NativeFmu(model)))
        self.members = [LoadedComponent(f"m{k}", description, ours=True) for k in range(count)]
        self._status = (ctypes.c_int32 * count)()
        inputs = [v.name for v in model.inputs]
        values = [*inputs, *(v.name for v in (*model.states, *model.outputs))]
        for member in self.members:
            member.setup(0.0, None)
            if internal_step and member is self.members[1]:
                member.set({"internal_step": internal_step})
            member.enter_initialization_mode()
            member.exit_initialization_mode()
        self.inputs = [RealBatch(member, inputs) for member in self.members]
        self._values = [RealBatch(member, values) for member in self.members]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for member in self.members:
            member.close()

    def alone(self, index):
        return [m.do_step(m.pointer, index * H, H, 1) for m in self.members]

    def together(self, index, size=H):
        count, step = len(self.members), self.members[0].step_stack
        pointers = (ctypes.c_void_p * count)(*(m.pointer for m in self.members))
        step.argtypes = [
            *(ctypes.c_void_p, ctypes.c_size_t),
            *(ctypes.c_double, ctypes.c_double, ctypes.c_void_p),
        ]
        worst = step(pointers, count, index * size, size, self._status)
        assert worst == max(self._status)
        return list(self._status)

    def bits(self):
        return [batch.read().tobytes() for batch in self._values]


def both(name, count, course, steps=30, **more):
    """What members step by step have come to, alone and together."""
    ends = []
    for how in ("alone", "together"):
        random = np.random.default_rng(8)
        with Row(MODELS[name](), count, **more) as row:
            seen = []
            for index in range(steps):
                course(row, index, random)
                seen.append((getattr(row, how)(index), row.bits()))
            ends.append(seen)
    return ends


def wander(row, index, random):
    """Each member's inputs about where they start; one member's parameter changes, another goes back."""
    for batch in row.inputs:
        batch.values[:] = batch.read() * (1 + 0.01 * random.standard_normal(len(batch.names)))
        batch.write()
    member = row.members[1]
    tunable = [
        v.name
        for v in member.description.variables.values()
        if v.causality == "parameter" and v.variability == "tunable" and v.type == "Real"
    ]
    if index == 10 and tunable:
        value = member.get(tunable[:1])[tunable[0]]
        member.set({tunable[0]: value * 1.01})
    other = row.members[-1]
    if index == 12:
        row.saved = other.save_state()
    if index == 20:
        other.restore_state(row.saved)
        other.free_state(row.saved)


@pytest.mark.parametrize("count", [3, SIDE_BY_SIDE, 2 * SIDE_BY_SIDE + 3])
@pytest.mark.parametrize("name", MODELS)
def test_members_have_the_bits_that_each_has_alone(name, count):
    alone, together = both(name, count, wander)
    assert alone == together
    assert all(status == [OK] * count for status, _ in alone)
    assert len(set(alone[-1][1])) == count  # each went its own way


def test_members_may_step_beside_others_than_before():
    """Parameters are kept side by side; whoever has new neighbours is not taken for another."""

    def course(row, index, random):
        wander(row, index, random)
        if index % 3 == 2:
            row.members.append(row.members.pop(0))

    alone, together = both("operations", SIDE_BY_SIDE + 3, course)
    assert alone == together
    assert all(status == [OK] * (SIDE_BY_SIDE + 3) for status, _ in together)


def test_one_of_another_internal_step_keeps_it():
    alone, together = both("operations", 4, wander, internal_step=5e-5)
    assert alone == together
    plain, _ = both("operations", 4, wander)
    assert alone != plain


def test_special_numbers_have_their_bits_side_by_side():
    def course(row, index, random):
        for k, batch in enumerate(row.inputs):
            batch.values[:] = SPECIAL[(index + k) % len(SPECIAL)]
            batch.write()

    alone, together = both("operations", SIDE_BY_SIDE, course, steps=10)
    assert alone == together
    # else they would step one by one
    assert all(status == [OK] * SIDE_BY_SIDE for status, _ in together)


def test_one_that_cannot_step_stops_nobody_else():
    """Its state is left as it was, with its own words."""

    def course(row, index, random):
        for k, batch in enumerate(row.inputs):
            batch.values[:] = 1e308 if index == 5 and k == 2 else 0.1 * k
            batch.write()
        if index == 3:
            row.members[2].set({"k": 1e10})

    alone, together = both("operations", SIDE_BY_SIDE, course, steps=6)
    assert alone == together
    assert [status for status, _ in together][-1] == [OK, OK, DISCARD] + [OK] * (SIDE_BY_SIDE - 3)


def test_a_step_of_another_size_is_taken():
    with Row(MODELS["operations"](), 4) as row:
        for size in (H, H / 2, H / 2, 3 * H):
            assert row.together(0, size) == [OK] * 4
        x = [member.get(["x"])["x"] for member in row.members]
    exact = 0.21 + (0.5 - 0.21) * math.exp(-5 * H)
    assert x == pytest.approx([exact] * 4, rel=1e-9)

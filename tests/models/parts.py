"""Single parts of a generator with inputs in place of what surrounds them, and a plain integration of a model."""

from ctypes import c_double
from functools import lru_cache

import numpy as np

from fmus.synchronous_generator.excitation.common import Regulated
from fmus.synchronous_generator.limiters.common import Limiters
from fmus.synchronous_generator.machine import Start
from fmus.synchronous_generator.parts import EXCITERS, GOVERNORS, STABILIZERS
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr
from tests.support.evaluated import Evaluated

V_T, E_FD, P_M = 1.01, 2.2, 0.7
"""Operating point of the parts: terminal voltage, field voltage and current, mechanical power [pu]."""

CURRENT = Phasor(0.7, -0.1)
START = Start(Expr(V_T), Expr(E_FD), Expr(P_M), Phasor(1.0, 0.0), CURRENT)
AT_REST = {"exciter": [V_T, E_FD, 0.0], "governor": [1.0], "pss": [0.0, 0.8]}
OF_POWER = ("ggov1", "degov1", "pidgov", "wpidhy", "wshygp", "wehgov")
OF_VOLTAGE = ("ieeest", "st2cut", "iee2st")
"""Governors that see the electrical power too, an input more; and stabilisers that see the voltage."""

built_once = lru_cache(maxsize=64)
"""A part alone, of which tests differ in its values, is one model."""

BUS = 1.02 * np.exp(-0.4j)
AT_BUS = {"P_0": 0.7, "Q_0": 0.15, "v_0": 1.02, "theta_0": -0.4}


def exciter(name, values=None):
    """An exciter between terminal voltage, field current and a stabiliser's signal."""
    own = {f"exciter.{key}": value for key, value in (values or {}).items()}
    return Evaluated(_exciter(name), own)


@built_once
def _exciter(name):
    m = ModelBuilder("alone", "The exciter alone")
    v_t, I_fd, v_s = (
        m.input(name, "pu", name, base="S_n", start=start)
        for name, start in (("v_t", V_T), ("I_fd", E_FD), ("v_s", 0))
    )
    terminal = Phasor(v_t, 0.0)
    seen = Regulated(START, lambda E: terminal, I_fd, v_s, i=CURRENT, v_0=Phasor(V_T, 0.0))
    E_fd, _ = EXCITERS[name](m, seen)
    m.output("E_fd", E_fd, "pu", "Field voltage", base="E_fd")
    return m.build()


def governor(name, values=None, *, made=None, full=None):
    """A governor and turbine behind the speed.

    ``made``: what stands in the table's place; ``full``: values by their names with the scope."""
    own = {f"governor.{key}": value for key, value in (values or {}).items()}
    return Evaluated(_governor(name, made or GOVERNORS[name]), own | (full or {}))


@built_once
def _governor(name, made):
    m = ModelBuilder("alone", "The governor alone")
    w = m.input("w", "pu", "Speed", base="f_n", start=1.0)
    P_e = m.input("P_e", "pu", "P_e", base="S_n", start=P_M) if name in OF_POWER else Expr(P_M)
    shaft = Shaft(w, Expr(P_M), P_e, Expr(P_M), Expr(V_T), Expr(V_T), Expr(0), Expr(P_M), Expr(100))
    m.output("P_m", made(m, shaft), "pu", "Power", base="S_n")
    return m.build()


def stabilizer(name, values=None, *, sees_voltage=False, sees_all=False, scope="pss"):
    """A stabiliser behind speed deviation and power; ``sees_voltage``: behind the voltage too.

    ``sees_all``: behind the voltage, its phase [s] and the mechanical power too; ``scope``: of its parameters."""
    sees_voltage = sees_voltage or sees_all or name in OF_VOLTAGE
    own = {f"{scope}.{key}": value for key, value in (values or {}).items()}
    return Evaluated(_stabilizer(name, sees_voltage, sees_all), own)


@built_once
def _stabilizer(name, sees_voltage, sees_all):
    m = ModelBuilder("alone", "The stabiliser alone")
    speed, power = (
        m.input("speed", "pu", "w − 1", base="f_n"),
        m.input("power", "pu", "P_e", base="S_n", start=0.8),
    )
    v_t = m.input("v_t", "pu", "|v|", base="S_n", start=V_T) if sees_voltage else Expr(V_T)
    phase, P_m = Expr(0), Expr(0.8)
    if sees_all:
        phase = m.input("phase", "s", "angle over ω_b")
        P_m = m.input("P_m", "pu", "P_m", base="S_n", start=0.8)
    part = STABILIZERS[name]
    assert part is not None
    shaft = Shaft(1 + speed, Expr(0.8), power, Expr(0.8), v_t, Expr(V_T), phase, P_m, Expr(100))
    m.output("v_s", part(m, shaft), "pu", "Signal", base="S_n")
    return m.build()


def limiter(values, **named):
    """A limiter between field current, field voltage and the stator's current; its regulator gives what it is given."""
    (scope,) = named
    own = {f"{scope}.{key}": value for key, value in values.items()}
    return Evaluated(_limiter(**named), own)


@built_once
def _limiter(**named):
    m = ModelBuilder("alone", "The limiter alone")
    starts = {"I_fd": E_FD, "E_fd": E_FD, "i_re": 0.7, "i_im": -0.1}
    I_fd, E_fd, i_re, i_im = (
        m.input(name, "pu", name, base="S_n", start=start) for name, start in starts.items()
    )
    terminal = Phasor(V_T + 0 * E_fd, 0.0)
    seen = Regulated(START, lambda E: terminal, I_fd, i=Phasor(i_re, i_im), v_0=Phasor(V_T, 0.0))

    def passed(m, seen):
        m.output("v_s", seen.v_s, "pu", "Sum of the limiters' signals", base="S_n")
        return E_fd, terminal.magnitude()

    Limiters(**named).regulate(m, seen, passed)
    return m.build()


def integrated(model, inputs, end, step=1e-3, x=None):
    """Outputs at every step, by Runge-Kutta of order 4 with held inputs; ``inputs`` gives them at a time."""
    names = [v.name for v in model.model.outputs]
    z = (c_double * len(model.model.value_references))(*model.p, *model.c)
    first_input = len(model.p) + len(model.c)
    first_state = first_input + len(model.model.inputs)
    first_output = first_state + len(model.x)
    u, states = slice(first_input, first_state), slice(first_state, first_output)
    outputs = slice(first_output, first_output + len(names))
    z[states] = np.array(model.x if x is None else x, dtype=float).tolist()
    found = []
    for k in range(round(end / step)):
        z[u] = np.array(inputs(k * step), dtype=float).ravel().tolist()
        assert model.kernel.advance(z, step, 1) == 0  # all states are finite
        found.append(dict(zip(names, z[outputs], strict=True)))
    return found, np.array(z[states])


def refused(model):
    """Texts of the requirements that do not hold."""
    margins = np.array(model.model.requirements(model.p, model.c)).ravel()
    return [
        text
        for text, margin in zip(model.model.requirement_texts, margins, strict=True)
        if not margin > 0
    ]

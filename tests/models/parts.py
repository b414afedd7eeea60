"""Single parts of a generator with inputs in place of what surrounds them, and a plain integration of a model."""

import casadi as ca
import numpy as np

from fmus.synchronous_generator.machine import Start
from fmus.synchronous_generator.parts import EXCITERS, GOVERNORS, STABILIZERS
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from tests.support.evaluated import Evaluated

V_T, E_FD, P_M = 1.01, 2.2, 0.7
"""Operating point of the parts: terminal voltage, field voltage and current, mechanical power [pu]."""

START = Start(ca.SX(V_T), ca.SX(E_FD), ca.SX(P_M), Phasor(1.0, 0.0), Phasor(0.7, -0.1))
AT_REST = {"exciter": [V_T, E_FD, 0.0], "governor": [1.0], "pss": [0.0, 0.8]}
BUS = 1.02 * np.exp(-0.4j)
AT_BUS = {"P_0": 0.7, "Q_0": 0.15, "v_0": 1.02, "theta_0": -0.4}


def exciter(name, values=None):
    """An exciter between terminal voltage, field current and a stabiliser's signal."""
    m = ModelBuilder("alone", "The exciter alone")
    v_t, I_fd, v_s = (
        m.input(name, "pu", name, base="S_n", start=start) for name, start in (("v_t", V_T), ("I_fd", E_FD), ("v_s", 0))
    )
    E_fd, _ = EXCITERS[name](m, START, lambda E: v_t, I_fd, v_s)
    m.output("E_fd", E_fd, "pu", "Field voltage", base="E_fd")
    return Evaluated(m.build(), {f"exciter.{key}": value for key, value in (values or {}).items()})


def governor(name, values=None):
    """A governor and turbine behind the speed."""
    m = ModelBuilder("alone", "The governor alone")
    w = m.input("w", "pu", "Speed", base="f_n", start=1.0)
    m.output("P_m", GOVERNORS[name](m, w, ca.SX(P_M)), "pu", "Power", base="S_n")
    return Evaluated(m.build(), {f"governor.{key}": value for key, value in (values or {}).items()})


def stabilizer(name, values=None):
    """A stabiliser behind speed deviation and power."""
    m = ModelBuilder("alone", "The stabiliser alone")
    speed, power = m.input("speed", "pu", "w − 1", base="f_n"), m.input("power", "pu", "P_e", base="S_n", start=0.8)
    part = STABILIZERS[name]
    assert part is not None
    m.output("v_s", part(m, speed, power, ca.SX(0.8)), "pu", "Signal", base="S_n")
    return Evaluated(m.build(), {f"pss.{key}": value for key, value in (values or {}).items()})


def integrated(model, inputs, end, step=1e-3, x=None):
    """Outputs at every step, by Runge-Kutta of order 4 with held inputs; ``inputs`` gives them at a time."""
    steps = round(end / step)
    u = np.array([inputs(k * step) for k in range(steps)]).T
    state, held = ca.MX.sym("x", len(model.x)), ca.MX.sym("u", len(u))

    def rate(at):
        return model.model.derivatives(at, held, model.p, model.c)

    k1 = rate(state)
    k2 = rate(state + step / 2 * k1)
    k3 = rate(state + step / 2 * k2)
    k4 = rate(state + step * k3)
    one = ca.Function("one", [state, held], [state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
    states = np.array(one.mapaccum(steps)(model.x if x is None else x, u)).reshape(len(model.x), steps)
    show = ca.Function("show", [state, held], [model.model.outputs_function(state, held, model.p, model.c)])
    values = np.array(show.map(steps)(states, u)).reshape(-1, steps)
    names = [v.name for v in model.model.outputs]
    return [dict(zip(names, column, strict=True)) for column in values.T], states[:, -1]


def refused(model):
    """Texts of the requirements that do not hold."""
    margins = np.array(model.model.requirements(model.p, model.c)).ravel()
    return [text for text, margin in zip(model.model.requirement_texts, margins, strict=True) if not margin > 0]

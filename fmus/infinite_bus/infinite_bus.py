"""Infinite bus: a source behind R + jX, a bus with capacitance and a load, and one device.

A voltage dip or a load step can be set by tunable parameters during the run, or beforehand by times, for masters that
change no parameter while they run. A clock inside the FMU compares these times. The clock runs only if it is enabled,
because a running clock is a state that never stands still."""

from math import pi

from fmus.toolchain.frames import (
    Phasor,
    current_of_power,
    phasor_derivative,
    phasor_state,
    polar,
    power,
)
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port_variables import SYSTEM_BASE, SYSTEM_BASE_MVA
from fmus.toolchain.symbols import Expr

TOLERANCE = 1e-9
"""A dip or step happens this much before its time [s]: far more than the clock's rounding, far less than an internal
step.

A Runge-Kutta step that ends at that time sees it in its last stage, with a sixth of its weight.
"""


def infinite_bus() -> Model:
    """Source, bus and load of a single-machine system, in the network frame, per unit on 100 MVA."""
    m = ModelBuilder(
        "infinite_bus",
        "Infinite bus behind an impedance, with a load, a voltage dip and a load step",
        kind="network",
    )
    f_n = m.parameter("f_n", 50.0, "Hz", "Rated frequency", minimum=1.0, maximum=400.0)
    omega_b = 2 * pi * f_n
    v_0, i_0 = _operating_point(m)
    injected = Phasor(
        m.input("i_re", "pu", "Current injected by the device, real part", base=SYSTEM_BASE),
        m.input("i_im", "pu", "Current injected by the device, imaginary part", base=SYSTEM_BASE),
    )
    R = m.parameter(
        "R", 0.002, "pu", "Resistance between source and bus", base=SYSTEM_BASE, minimum=0
    )
    X = m.parameter(
        "X", 0.02, "pu", "Reactance between source and bus", base=SYSTEM_BASE, minimum=1e-4
    )
    B = m.parameter("B", 0.5, "pu", "Capacitance at the bus", base=SYSTEM_BASE, minimum=1e-3)
    clock = _clock(m)
    G_0, G = _load(m, v_0, clock)

    line_0 = Phasor(G_0, B) * v_0 - i_0
    source_0 = v_0 + Phasor(R, X) * line_0
    source = _source(m, source_0, clock, omega_b)
    line = phasor_state(m, "line.i", line_0, "Current from the source", SYSTEM_BASE)
    v = phasor_state(m, "bus.v", v_0, "Bus voltage, network frame", "bus")
    phasor_derivative(m, line, (source - v - Phasor(R, X) * line) * (omega_b / X))
    phasor_derivative(m, v, (line + injected - Phasor(G, B) * v) * (omega_b / B))

    m.output("v_re", v.re, "pu", "Bus voltage, real part, network frame", base="bus")
    m.output("v_im", v.im, "pu", "Bus voltage, imaginary part, network frame", base="bus")
    m.output("v", v.magnitude(), "pu", "Bus voltage magnitude", base="bus")
    s = power(v, injected)
    m.output("p", s.re, "pu", "Active power of the device", base=SYSTEM_BASE)
    m.output("q", s.im, "pu", "Reactive power of the device", base=SYSTEM_BASE)
    return m.build()


def _operating_point(m: ModelBuilder) -> tuple[Phasor, Phasor]:
    """Voltage at the bus and current of the device."""
    v_0 = m.parameter(
        "v_0",
        1.0,
        "pu",
        "Start: voltage magnitude at the bus",
        base="bus",
        minimum=0.1,
        maximum=2.0,
    )
    theta_0 = m.parameter("theta_0", 0.0, "rad", "Start: voltage angle at the bus")
    P_0 = m.parameter("P_0", 13.5, "pu", "Start: active power of the device", base=SYSTEM_BASE)
    Q_0 = m.parameter("Q_0", 0.0, "pu", "Start: reactive power of the device", base=SYSTEM_BASE)
    voltage = polar(v_0, theta_0)
    return voltage, current_of_power(P_0, Q_0, voltage)


def _clock(m: ModelBuilder) -> Expr:
    """Time since the start [s], or always 0 if the clock is not enabled."""
    with m.scope("clock"):
        runs = m.switch(
            "runs", False, "What has a time happens at it; without the clock nothing does"
        )
        t = m.state("t", 0.0, "s", "Time since the start")
        m.derivative(t, runs)
    return t


def _reached(t: Expr, time: Expr) -> Expr:
    return t > time - TOLERANCE


def _load(m: ModelBuilder, v_0: Phasor, t: Expr) -> tuple[Expr, Expr]:
    """Conductance at the start and now."""
    with m.scope("load"):
        P = m.parameter("P", 400.0, "MW", "Active power at the start's voltage", minimum=0)
        scale = m.parameter(
            "scale", 1.0, "1", "Load step: factor on the conductance", minimum=0, tunable=True
        )
        at = m.parameter(
            "step_time", 1.0, "s", "When the load steps by itself, if the clock runs", minimum=0
        )
        step = m.parameter(
            "step", 0.0, "1", "By how much it then steps, as a part of it", minimum=-1
        )
    G_0 = P / SYSTEM_BASE_MVA / (v_0.re**2 + v_0.im**2)
    return G_0, G_0 * (scale + step * _reached(t, at))


def _source(m: ModelBuilder, start: Phasor, t: Expr, omega_b: Expr) -> Phasor:
    """The source's voltage, with its own frequency, and reduced in a dip."""
    with m.scope("source"):
        E = m.calculated(
            "E", start.magnitude(), "pu", "Voltage magnitude of the source", base="bus"
        )
        theta = m.state("theta", start.angle(), "rad", "Voltage angle of the source")
        deviation = m.parameter(
            "delta_omega",
            0.0,
            "pu",
            "Frequency deviation",
            base="f_n",
            minimum=-0.2,
            maximum=0.2,
            tunable=True,
        )
    with m.scope("dip"):
        depth = m.parameter(
            "depth",
            0.0,
            "1",
            "Part of the source's voltage that is missing",
            minimum=0,
            maximum=1,
            tunable=True,
        )
        start_time = m.parameter(
            "start", 1.0, "s", "When a dip begins by itself, if the clock runs", minimum=0
        )
        duration = m.parameter("duration", 0.15, "s", "How long it lasts", minimum=0)
        own_depth = m.parameter(
            "timed_depth", 0.0, "1", "Part that is then missing", minimum=0, maximum=1
        )
    m.derivative(theta, omega_b * deviation)
    dipped = _reached(t, start_time) * (1 - _reached(t, start_time + duration))
    return polar(E * (1 - depth) * (1 - own_depth * dipped), theta)

"""Test bench: a source whose voltage, angle, frequency and impedance follow a programme, a bus, and two plants.

Everything that a programme moves is a tunable parameter. The second plant is the duplicate that the loss of the last
machine asks for; without one its inputs stay 0."""

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
from fmus.toolchain.port import BREAKER_TIME
from fmus.toolchain.port_variables import SYSTEM_BASE, SYSTEM_BASE_MVA
from fmus.toolchain.symbols import Expr


def test_bench() -> Model:
    """Source, impedance, bus, load and fault in the network frame, per unit on 100 MVA."""
    title = "Test bench: a programmable source behind a settable impedance, and a load (EMT type)"
    m = ModelBuilder("test_bench", title, kind="network")
    f_n = m.parameter("f_n", 50.0, "Hz", "Rated frequency", minimum=1.0, maximum=400.0)
    omega_b = 2 * pi * f_n
    v_0, i_0 = _operating_point(m)
    plant, duplicate = _injected(m)
    X_0 = m.parameter(
        "X_0", 0.1, "pu", "Start: reactance of the source", base=SYSTEM_BASE, minimum=1e-4
    )
    R_0 = m.parameter(
        "R_0", 0.01, "pu", "Start: resistance of the source", base=SYSTEM_BASE, minimum=0
    )
    X = X_0 * m.parameter(
        "X_factor", 1.0, "1", "Factor on the reactance", minimum=1e-3, maximum=1e3, tunable=True
    )
    R = R_0 * m.parameter(
        "R_factor", 1.0, "1", "Factor on the resistance", minimum=0, maximum=1e3, tunable=True
    )
    B = m.parameter("B", 0.05, "pu", "Capacitance at the bus", base=SYSTEM_BASE, minimum=1e-3)
    G, B_load = _load(m, v_0)
    fault = _fault(m)

    load_0 = v_0 * Phasor(0.0, -1.0) * B_load
    line_0 = Phasor(G, B) * v_0 + load_0 - i_0
    source, closed = _source(m, v_0 + Phasor(R_0, X_0) * line_0, omega_b)
    line = phasor_state(m, "line.i", line_0, "Current from the source", SYSTEM_BASE)
    load = phasor_state(m, "load.i", load_0, "Current of the load's inductor", SYSTEM_BASE)
    v = phasor_state(m, "bus.v", v_0, "Bus voltage, network frame", "bus")
    passive = (-v - Phasor(R, X) * line) * (omega_b / X * closed) - line * (
        (1 - closed) / BREAKER_TIME
    )
    phasor_derivative(m, line, passive + source * (omega_b / X * closed), passive)
    phasor_derivative(m, load, v * (omega_b * B_load) - load.times_j() * omega_b)
    currents = line + plant + duplicate - load - Phasor(G + fault, B) * v
    phasor_derivative(m, v, currents * (omega_b / B))

    m.output("v_re", v.re, "pu", "Bus voltage, real part, network frame", base="bus")
    m.output("v_im", v.im, "pu", "Bus voltage, imaginary part, network frame", base="bus")
    m.output("v", v.magnitude(), "pu", "Bus voltage magnitude", base="bus")
    _declare_power(m, "", v, plant, "of the plant")
    _declare_power(m, "duplicate.", v, duplicate, "of the duplicate")
    _declare_power(m, "source.", v, line, "from the source")
    return m.build(integrator="sdirk")


def _operating_point(m: ModelBuilder) -> tuple[Phasor, Phasor]:
    """Voltage at the bus and current of both plants."""
    v_0 = m.parameter(
        "v_0",
        1.0,
        "pu",
        "Start: voltage magnitude at the bus",
        base="bus",
        minimum=0.1,
        maximum=2.0,
    )
    P_0 = m.parameter("P_0", 0.5, "pu", "Start: active power of the plants", base=SYSTEM_BASE)
    Q_0 = m.parameter("Q_0", 0.0, "pu", "Start: reactive power of the plants", base=SYSTEM_BASE)
    voltage = polar(v_0, 0.0)
    return voltage, current_of_power(P_0, Q_0, voltage)


def _injected(m: ModelBuilder) -> tuple[Phasor, Phasor]:
    """Currents of the plant and of its duplicate, the latter behind a breaker."""

    def current(of: str) -> Phasor:
        return Phasor(
            m.input("i_re", "pu", f"Current injected by {of}, real part", base=SYSTEM_BASE),
            m.input("i_im", "pu", f"Current injected by {of}, imaginary part", base=SYSTEM_BASE),
        )

    plant = current("the plant")
    with m.scope("duplicate"):
        return plant, current("its duplicate")


def _load(m: ModelBuilder, v_0: Phasor) -> tuple[Expr, Expr]:
    """Conductance, and susceptance of the inductor [pu]: a load of constant impedance."""
    v_squared = v_0.re**2 + v_0.im**2
    with m.scope("load"):
        P = m.parameter("P", 0.0, "MW", "Active power at the start's voltage", minimum=0)
        Q = m.parameter("Q", 0.0, "Mvar", "Reactive power at the start's voltage", minimum=0)
    return P / SYSTEM_BASE_MVA / v_squared, Q / SYSTEM_BASE_MVA / v_squared


def _fault(m: ModelBuilder) -> Expr:
    """Conductance of a balanced fault at the bus."""
    with m.scope("fault"):
        return m.parameter(
            "G",
            0.0,
            "pu",
            "Conductance of a fault of all three phases at the bus",
            base=SYSTEM_BASE,
            minimum=0,
            maximum=1e4,
            tunable=True,
        )


def _source(m: ModelBuilder, start: Phasor, omega_b: Expr) -> tuple[Phasor, Expr]:
    """The source's voltage, and whether its breaker is closed."""
    with m.scope("source"):
        E = m.calculated(
            "E", start.magnitude(), "pu", "Voltage magnitude of the source", base="bus"
        )
        factor = m.parameter(
            "factor", 1.0, "1", "Factor on the voltage", minimum=0, maximum=2, tunable=True
        )
        jump = m.parameter(
            "jump", 0.0, "rad", "Angle by which the voltage has jumped", tunable=True
        )
        rise = m.parameter(
            "rise",
            0.0,
            "1",
            "Rate of the frequency, per unit of f_n and second",
            minimum=-1,
            maximum=1,
            tunable=True,
        )
        closed = m.switch("connected", True, "The breaker of the source is closed", tunable=True)
        theta = m.state(
            "theta", start.angle(), "rad", "Voltage angle of the source without the jumps"
        )
        deviation = m.state(
            "delta_omega", 0.0, "pu", "Frequency deviation of the source", base="f_n"
        )
    m.derivative(theta, omega_b * deviation)
    m.derivative(deviation, rise)
    return polar(E * factor, theta + jump), closed


def _declare_power(m: ModelBuilder, scope: str, v: Phasor, current: Phasor, of: str) -> None:
    s = power(v, current)
    m.output(f"{scope}p", s.re, "pu", f"Active power {of} into the bus", base=SYSTEM_BASE)
    m.output(f"{scope}q", s.im, "pu", f"Reactive power {of} into the bus", base=SYSTEM_BASE)

"""An EMT network in the frame that turns at ω_b: dynamic lines, constant-impedance loads, bus capacitances.

A bus with capacitance has its voltage as a state. A bus without has v = Σ i / G, directly from the
currents that the devices inject: there the FMU has direct feed-through, and says so.
"""

from dataclasses import dataclass

import casadi as ca

from fmus.grid.network import SYSTEM_BASE_MVA, Line, Load, Network
from fmus.toolchain.frames import ZERO, Phasor, polar, power
from fmus.toolchain.model import Model, ModelBuilder, Scalar
from fmus.toolchain.port import SYSTEM_BASE


@dataclass
class _Bus:
    """What meets at a bus: injected current, conductance, susceptance; its voltage once known."""

    v_0: Phasor
    injected: Phasor
    G: ca.SX
    B: ca.SX
    v: Phasor = ZERO


@dataclass(frozen=True)
class _Branch:
    """An inductive current state with R and X, from a voltage to a voltage."""

    current_re: ca.SX
    current_im: ca.SX
    R: Scalar
    X: ca.SX
    from_bus: str
    to_bus: str | None

    @property
    def current(self) -> Phasor:
        return Phasor(self.current_re, self.current_im)


def grid(network: Network) -> Model:
    """Build the model of a network; parameters are named after its elements (``X_<line>``, ``<load>.P``)."""
    m = ModelBuilder(network.name, f"EMT network {network.name} in the frame turning at ω_b")
    f_n = m.parameter("f_n", 50.0, "Hz", "Rated frequency", minimum=1.0, maximum=400.0)
    omega_b = 2 * ca.pi * f_n
    buses = {bus: _declare_bus(m, bus) for bus in network.buses}
    for port in network.ports:
        buses[port.bus].injected += _port_current(m, port.name)
    branches = [_declare_line(m, line, buses) for line in network.lines]
    for load in network.loads:
        branches += _declare_load(m, load, buses)
    for branch in branches:
        buses[branch.from_bus].injected -= branch.current
        if branch.to_bus:
            buses[branch.to_bus].injected += branch.current
    for name, bus in buses.items():
        _bus_voltage(m, name, bus, omega_b, dynamic=network.has_capacitance(name))
    for branch in branches:
        _branch_equation(m, branch, buses, omega_b)
    _declare_outputs(m, network, buses, branches)
    # Bus capacitances against small line reactances are far faster than any communication step: such a
    # network needs an integrator that is stable at any step and damps the ringing after a switching.
    stiff = any(network.has_capacitance(bus) for bus in network.buses)
    return m.build(integrator="sdirk" if stiff else "runge_kutta")


def _declare_bus(m: ModelBuilder, name: str) -> _Bus:
    with m.scope(name):
        magnitude = m.parameter("v_0", 1.0, "pu", "Power flow: voltage magnitude", base="bus", minimum=0.1, maximum=2.0)
        angle = m.parameter("theta_0", 0.0, "rad", "Power flow: voltage angle")
    return _Bus(polar(magnitude, angle), ZERO, ca.SX(0), ca.SX(0))


def _port_current(m: ModelBuilder, name: str) -> Phasor:
    with m.scope(name):
        return Phasor(
            m.input("i_re", "pu", "Current injected by the device, real part", base=SYSTEM_BASE),
            m.input("i_im", "pu", "Current injected by the device, imaginary part", base=SYSTEM_BASE),
        )


def _declare_line(m: ModelBuilder, line: Line, buses: dict[str, _Bus]) -> _Branch:
    X = m.parameter(
        f"X_{line.name}",
        line.X,
        "pu",
        f"Reactance of line {line.name}",
        base=SYSTEM_BASE,
        minimum=1e-5,
        maximum=100,
        tunable=True,
    )
    R = m.parameter(
        f"R_{line.name}",
        line.R,
        "pu",
        f"Resistance of line {line.name}",
        base=SYSTEM_BASE,
        minimum=0,
        tunable=True,
    )
    if line.B:
        B = m.parameter(f"B_{line.name}", line.B, "pu", f"Charging of line {line.name}", base=SYSTEM_BASE, minimum=1e-9)
        for bus in (line.from_bus, line.to_bus):
            buses[bus].B += B / 2
    initial = (buses[line.from_bus].v_0 - buses[line.to_bus].v_0) / Phasor(R, X)
    with m.scope(line.name):
        return _branch(m, initial, f"Current of line {line.name}", R, X, line.from_bus, line.to_bus)


def _declare_load(m: ModelBuilder, load: Load, buses: dict[str, _Bus]) -> list[_Branch]:
    bus = buses[load.bus]
    v_squared = bus.v_0.re**2 + bus.v_0.im**2
    with m.scope(load.name):
        scale = m.parameter(
            "scale", 1.0, "1", "Load step: factor on G and 1/X", minimum=1e-6, maximum=100, tunable=True
        )
        P = m.parameter("P", load.p_mw, "MW", "Active power at the power flow's voltage", minimum=0)
        bus.G += scale * P / SYSTEM_BASE_MVA / v_squared
        if load.q_mvar == 0:
            return []
        inductive = load.q_mvar > 0
        Q = m.parameter(
            "Q",
            load.q_mvar,
            "Mvar",
            "Reactive power at the power flow's voltage",
            minimum=1e-6 if inductive else None,
            maximum=None if inductive else -1e-6,
        )
        if not inductive:
            bus.B += -scale * Q / SYSTEM_BASE_MVA / v_squared
            return []
        X = v_squared / (scale * Q / SYSTEM_BASE_MVA)
        return [_branch(m, bus.v_0 / Phasor(0, X), "Inductor current", 0.0, X, load.bus, None)]


def _branch(
    m: ModelBuilder, initial: Phasor, text: str, R: Scalar, X: ca.SX, from_bus: str, to_bus: str | None
) -> _Branch:
    """Declare the current of an inductive branch as a state, in the builder's scope."""
    re = m.state("i_re", initial.re, "pu", f"{text}, real part", SYSTEM_BASE)
    im = m.state("i_im", initial.im, "pu", f"{text}, imaginary part", SYSTEM_BASE)
    return _Branch(re, im, R, X, from_bus, to_bus)


def _bus_voltage(m: ModelBuilder, name: str, bus: _Bus, omega_b: ca.SX, *, dynamic: bool) -> None:
    """(B/ω_b)·dv/dt = Σ i − (G + jB)·v, or v = Σ i / G where there is no capacitance."""
    if not dynamic:
        bus.v = bus.injected / bus.G
        return
    with m.scope(name):
        re = m.state("v_re_state", bus.v_0.re, "pu", "Bus voltage, real part", base="bus")
        im = m.state("v_im_state", bus.v_0.im, "pu", "Bus voltage, imaginary part", base="bus")
    bus.v = Phasor(re, im)
    rate = (bus.injected - Phasor(bus.G, bus.B) * bus.v) * (omega_b / bus.B)
    m.derivative(re, rate.re)
    m.derivative(im, rate.im)


def _branch_equation(m: ModelBuilder, branch: _Branch, buses: dict[str, _Bus], omega_b: ca.SX) -> None:
    """(X/ω_b)·di/dt = v_from − v_to − (R + jX)·i."""
    over = buses[branch.from_bus].v - (buses[branch.to_bus].v if branch.to_bus else ZERO)
    rate = (over - Phasor(branch.R, branch.X) * branch.current) * (omega_b / branch.X)
    m.derivative(branch.current_re, rate.re)
    m.derivative(branch.current_im, rate.im)


def _declare_outputs(m: ModelBuilder, network: Network, buses: dict[str, _Bus], branches: list[_Branch]) -> None:
    for name, bus in buses.items():
        with m.scope(name):
            m.output("v_re", bus.v.re, "pu", "Bus voltage, real part, network frame", base="bus")
            m.output("v_im", bus.v.im, "pu", "Bus voltage, imaginary part, network frame", base="bus")
            m.output("v", bus.v.magnitude(), "pu", "Bus voltage magnitude", base="bus")
    for line, branch in zip(network.lines, branches, strict=False):
        with m.scope(line.name):
            s = power(buses[line.from_bus].v, branch.current)
            m.output("p", s.re, "pu", "Active power entering the line", base=SYSTEM_BASE)
            m.output("q", s.im, "pu", "Reactive power entering the line", base=SYSTEM_BASE)

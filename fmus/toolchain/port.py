"""The port through which a device meets the grid, and the power-flow figures it starts from.

A device takes the bus voltage and gives the current of its transformer, both in the network frame.
The current is a state, so a device has no direct feed-through at its port.

A breaker at the port is open where ``connected`` is false. Its phases interrupt one after the other, each at a zero
of its current; here the current fades with `BREAKER_TIME`, di/dt = −i/τ, whatever the voltages are.
"""

from dataclasses import dataclass

import casadi as ca

from fmus.toolchain.frames import Phasor, current_of_power, polar, power
from fmus.toolchain.model_builder import ModelBuilder

SYSTEM_BASE = "100 MVA"
BREAKER_TIME = 1e-3
"""Time constant τ [s] with which the current of an open breaker fades."""


@dataclass(frozen=True)
class DevicePort:
    """Voltage at the bus, and the same at the operating point.

    Attributes
    ----------
    v
        Bus voltage, network frame [pu].
    v_0, i_0
        Bus voltage and injected current of the power flow, network frame [pu, S_n].
    omega_b
        Base angular frequency [rad/s].
    current_scale
        Device current [pu, S_n] times this is the current in the port's unit: mostly pu on the system base.
    connected
        1 where the breaker is closed, 0 where it is open.
    """

    v: Phasor
    v_0: Phasor
    i_0: Phasor
    omega_b: ca.SX
    current_scale: ca.SX
    connected: ca.SX

    def through_breaker(self, closed: Phasor, opened: Phasor) -> Phasor:
        """What holds behind a closed breaker, or behind an open one."""
        return closed * self.connected + opened * (1 - self.connected)


def device_port(m: ModelBuilder, S_n: float, P_0: float) -> DevicePort:
    """Declare rating, power-flow start values and the voltage input of a device."""
    rating = declare_rating(m, S_n)
    system = m.parameter("S_base", 100.0, "MVA", "Base power of the network", minimum=1e-3)
    v = Phasor(
        m.input("v_re", "pu", "Bus voltage, real part, network frame", base="bus", start=1.0),
        m.input("v_im", "pu", "Bus voltage, imaginary part, network frame", base="bus"),
    )
    return port_at(m, v, P_0, rating / system)


def declare_rating(m: ModelBuilder, S_n: float) -> ca.SX:
    """Declare the rating [MVA]."""
    return m.parameter("S_n", S_n, "MVA", "Rated apparent power, the device's base", minimum=1e-3)


def port_at(m: ModelBuilder, v: Phasor, P_0: float, current_scale: ca.SX) -> DevicePort:
    """Declare the power-flow start values of a device at a bus voltage, network frame [pu]."""
    f_n = m.parameter("f_n", 50.0, "Hz", "Rated frequency", minimum=1.0, maximum=400.0)
    v_0 = m.parameter(
        "v_0", 1.0, "pu", "Power flow: voltage magnitude at the bus", base="bus", minimum=0.1, maximum=2.0
    )
    theta_0 = m.parameter("theta_0", 0.0, "rad", "Power flow: voltage angle at the bus")
    p_0 = m.parameter("P_0", P_0, "pu", "Power flow: active power into the bus", base="S_n", minimum=-2.0, maximum=2.0)
    q_0 = m.parameter(
        "Q_0", 0.0, "pu", "Power flow: reactive power into the bus", base="S_n", minimum=-2.0, maximum=2.0
    )
    connected = m.switch("connected", True, "The breaker at the port is closed", tunable=True)
    bus = polar(v_0, theta_0)
    return DevicePort(v, bus, current_of_power(p_0, q_0, bus), 2 * ca.pi * f_n, current_scale, connected)


def declare_port_outputs(m: ModelBuilder, port: DevicePort, current: Phasor) -> None:
    """Declare i_re, i_im on the system base, and p, q at the bus on the rating."""
    injected = current * port.current_scale
    s = power(port.v, current)
    m.output("i_re", injected.re, "pu", "Injected current, real part, network frame", base=SYSTEM_BASE)
    m.output("i_im", injected.im, "pu", "Injected current, imaginary part, network frame", base=SYSTEM_BASE)
    m.output("p", s.re, "pu", "Active power into the bus", base="S_n")
    m.output("q", s.im, "pu", "Reactive power into the bus", base="S_n")

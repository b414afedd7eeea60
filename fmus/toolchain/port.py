"""The port between a device and the grid, and the power-flow values from which the device starts.

A device takes the bus voltage and gives the current of its transformer, both in the network frame.
The current is a state, so a device has no direct feed-through at its port.

A breaker at the port is open where ``connected`` is false. Its phases interrupt one after the other, each at a zero
of its current; here the current fades with `BREAKER_TIME`, di/dt = −i/τ, whatever the voltages are."""

from dataclasses import dataclass, replace
from math import pi

from fmus.toolchain import port_variables
from fmus.toolchain.frames import Phasor, current_of_power, polar, power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr

BREAKER_TIME = 1e-3  # time constant τ [s] with which the current of an open breaker fades


@dataclass(frozen=True)
class OperatingPoint:
    """A device's operating point from the power flow, and its frame."""

    # v_0, i_0: bus voltage and injected current of the power flow, network frame [pu, S_n].
    v_0: Phasor
    i_0: Phasor
    omega_b: Expr  # base angular frequency [rad/s]


@dataclass(frozen=True)
class DevicePort(OperatingPoint):
    """Voltage at the bus, and the same at the operating point."""

    v: Phasor  # bus voltage, network frame [pu]
    # device current [pu, S_n] times this is the current in the port's unit: mostly pu on the system base.
    current_scale: Expr
    connected: Expr  # 1 where the breaker is closed, 0 where it is open

    def through_breaker(self, closed: Phasor, opened: Phasor) -> Phasor:
        """The first value behind a closed breaker, the second behind an open one."""
        return closed * self.connected + opened * (1 - self.connected)


def device_port(m: ModelBuilder, S_n: float, P_0: float) -> DevicePort:
    """Declare rating, power-flow start values and the voltage input of a device."""
    return device_port_of(m, declare_rating(m, S_n), P_0)


def device_port_of(
    m: ModelBuilder, rating: Expr, P_0: float, most: float = port_variables.LARGEST_POWER
) -> DevicePort:
    """`device_port` of a device that has declared its rating [MVA], because its data depend on it.

    ``most``: Largest active and reactive power of the operating point [pu, S_n]."""
    system = m.declare(port_variables.S_BASE)
    v = Phasor(m.declare(port_variables.V_RE), m.declare(port_variables.V_IM))
    return port_at(m, v, P_0, rating / system, most)


def declare_rating(m: ModelBuilder, S_n: float) -> Expr:
    """Declare the rating [MVA]."""
    return m.declare(replace(port_variables.S_N, start=float(S_n)))


def port_at(
    m: ModelBuilder,
    v: Phasor,
    P_0: float,
    current_scale: Expr,
    most: float = port_variables.LARGEST_POWER,
) -> DevicePort:
    """Declare the power-flow start values of a device at a bus voltage.

    ``v``: Bus voltage, network frame [pu].
    ``P_0``: Default of the active power into the bus [pu, S_n].
    ``current_scale``: Device current [pu, S_n] times this is the current in the port's unit.
    ``most``: Largest active and reactive power of the operating point [pu, S_n]."""
    start = declare_operating_point(m, P_0, most)
    connected = m.switch("connected", True, "The breaker at the port is closed", tunable=True)
    return DevicePort(start.v_0, start.i_0, start.omega_b, v, current_scale, connected)


def declare_operating_point(
    m: ModelBuilder, P_0: float, most: float = port_variables.LARGEST_POWER
) -> OperatingPoint:
    """Declare the rated frequency and the power-flow start values.

    ``P_0``: Default of the active power [pu, S_n].
    ``most``: Largest active and reactive power [pu, S_n]."""
    f_n = m.declare(port_variables.F_N)
    v_0, theta_0 = m.declare(port_variables.V_0), m.declare(port_variables.THETA_0)
    p_0, q_0 = (
        m.declare(replace(port_variables.P_0, start=float(P_0), minimum=-most, maximum=most)),
        m.declare(replace(port_variables.Q_0, minimum=-most, maximum=most)),
    )
    bus = polar(v_0, theta_0)
    return OperatingPoint(bus, current_of_power(p_0, q_0, bus), 2 * pi * f_n)


def declare_port_outputs(m: ModelBuilder, port: DevicePort, current: Phasor) -> None:
    """Declare i_re, i_im on the system base, and p, q at the bus on the rating."""
    injected = current * port.current_scale
    s = power(port.v, current)
    m.declare_output(port_variables.I_RE, injected.re)
    m.declare_output(port_variables.I_IM, injected.im)
    m.declare_output(port_variables.P, s.re)
    m.declare_output(port_variables.Q, s.im)

"""Static generation: the current of the operating point, which turns with the bus voltage behind a lag.

It is what a negative load is in the network's own models, as a device with a port. In steady state magnitude and power
factor of the current are constant, so that nothing holds the angle of the grid. Above 1/τ the current does not move at
all: an admittance of zero, neither damping nor the negative conductance of a constant power.
"""

import casadi as ca

from fmus.converter_parts.bus_voltage import extrapolated_voltage
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import SourceEmf, declare_master_step, declare_phasor_outputs, phasor_builder
from fmus.toolchain.port import BREAKER_TIME, DevicePort, declare_port_outputs, device_port

S_N, P_0 = 1500.0, 0.9
"""Default rating [MVA] and dispatch [pu]: those of `gfor` and `gfl`, whose place it takes."""

LAG = 1e-2
"""Default of τ [s]: 16 Hz, above electromechanical modes, which it follows, and below the resonances of networks."""

LEAST_VOLTAGE = 0.05
"""Voltage [pu] below which the current shrinks with it: at zero it has no angle to turn with."""


def static_generation() -> Model:
    """The device, EMT type."""
    m = ModelBuilder("static_generation", "Static generation: a constant current at a constant power factor (EMT type)")
    port = device_port(m, S_n=S_N, P_0=P_0)
    tau = _declare_lag(m)
    i = _declare_current(m, port)
    rate = port.through_breaker((_wanted(port, port.v) - i) / tau, i * (-1 / BREAKER_TIME))
    m.derivative(ca.SX(i.re), rate.re)
    m.derivative(ca.SX(i.im), rate.im)
    declare_port_outputs(m, port, i)
    return m.build()


def static_generation_phasor() -> Model:
    """The same for a network of admittances: the emf is the bus voltage that it sees, and what its current adds."""
    m = phasor_builder(
        "static_generation_phasor", "Static generation: a constant current at a constant power factor (phasor type)"
    )
    port = device_port(m, S_n=S_N, P_0=P_0)
    tau = _declare_lag(m)
    X = m.parameter("X", 0.15, "pu", "Reactance of the port, across which the current is fed", base="S_n", minimum=0.01)
    Z = Phasor(0.0, X)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    i = _declare_current(m, port)
    rate = (_wanted(port, seen.value) - i) / tau
    seen.follow(m, port.v)
    m.derivative(ca.SX(i.re), rate.re)
    m.derivative(ca.SX(i.im), rate.im)

    def emf(time: ca.SX) -> Phasor:
        return seen.after(time) + Z * (i + rate * time)

    declare_phasor_outputs(m, port, SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next)), Z)
    return m.build()


def _declare_lag(m: ModelBuilder) -> ca.SX:
    return m.parameter("tau", LAG, "s", "Lag with which the current turns with the bus voltage", minimum=1e-3)


def _declare_current(m: ModelBuilder, port: DevicePort) -> Phasor:
    return Phasor(
        m.state("i_x", port.i_0.re, "pu", "Current into the bus, real part", base="S_n"),
        m.state("i_y", port.i_0.im, "pu", "Current into the bus, imaginary part", base="S_n"),
    )


def _wanted(port: DevicePort, v: Phasor) -> Phasor:
    """The current of the operating point [pu, S_n], turned as far as the voltage is."""
    size = ca.fmax(v.magnitude(), LEAST_VOLTAGE) * port.v_0.magnitude()
    return port.i_0 * v * port.v_0.conjugate() / size

"""Static generation: the current of the operating point, which turns with the bus voltage.

It is what a negative load is in the network's own models, as a device with a port. The current follows the voltage's
angle as a phase-locked loop would, (2ω_0·s + ω_0²)/(s + ω_0)². For swings that is 1 − s²/ω_0²: without a lag, which
would be a damping torque. Well above ω_0 the current stands still: an admittance of zero, neither damping nor the
negative conductance of a constant power."""

from dataclasses import dataclass
from math import pi

from fmus.converter_parts.bus_voltage import extrapolated_voltage
from fmus.toolchain.frames import ZERO, Phasor, phasor_derivative
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    SourceEmf,
    declare_master_step,
    declare_phasor_outputs,
    phasor_builder,
)
from fmus.toolchain.port import BREAKER_TIME, DevicePort, declare_port_outputs, device_port
from fmus.toolchain.symbols import Expr, fmax

# those of `gfor` and `gfl`, whose place it takes
S_N = 1500.0  # default rating [MVA]
P_0 = 0.9  # default dispatch [pu, S_n]
# default of ω_0/2π [Hz]: above electromechanical modes, which the current follows, below networks'
# own
F_0 = 10.0
# voltage [pu] below which the current shrinks with it: at zero it has no angle to turn with
LEAST_VOLTAGE = 0.05


@dataclass(frozen=True)
class Following:
    """The current into the bus [pu, S_n], and its rate per ω_0 at which it goes on turning [pu]."""

    current: Phasor
    turning: Phasor
    omega_0: Expr

    def rate(self, port: DevicePort, v: Phasor) -> Phasor:
        """di/dt [pu/s] at a bus voltage [pu]."""
        return (_turned_current(port, v) - self.current) * (
            2 * self.omega_0
        ) + self.turning * self.omega_0

    def follow(self, m: ModelBuilder, port: DevicePort, v: Phasor) -> None:
        """Give the equations at a bus voltage [pu]; behind an open breaker the current fades."""
        rate = port.through_breaker(self.rate(port, v), self.current * (-1 / BREAKER_TIME))
        error = (_turned_current(port, v) - self.current) * self.omega_0
        turning = port.through_breaker(error, self.turning * (-1 / BREAKER_TIME))
        for state, its in ((self.current, rate), (self.turning, turning)):
            phasor_derivative(m, state, its)


def static_generation() -> Model:
    """The device, EMT type."""
    m = ModelBuilder(
        "static_generation",
        "Static generation: a constant current at a constant power factor (EMT type)",
        kind="load",
    )
    port = device_port(m, S_n=S_N, P_0=P_0)
    following = _declare_current(m, port)
    following.follow(m, port, port.v)
    declare_port_outputs(m, port, following.current)
    return m.build()


def static_generation_phasor() -> Model:
    """The same for a network of admittances: the emf is the bus voltage that it sees, and what its current adds."""
    title = "Static generation: a constant current at a constant power factor (phasor type)"
    m = phasor_builder("static_generation_phasor", title, kind="load")
    port = device_port(m, S_n=S_N, P_0=P_0)
    X = m.parameter(
        "X",
        0.5,
        "pu",
        "Reactance of the port, across which the current is fed",
        base="S_n",
        minimum=0.01,
    )
    R = m.parameter("R", 0.0, "pu", "Resistance of the port", base="S_n", minimum=0.0)
    Z = Phasor(R, X)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    following = _declare_current(m, port)
    seen.follow(m, port.v)
    following.follow(m, port, seen.value)
    moving = following.rate(port, seen.value)

    def emf(time: Expr) -> Phasor:
        return seen.after(time) + Z * (following.current + moving * time)

    declare_phasor_outputs(
        m, port, SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next)), Z
    )
    return m.build()


def _declare_current(m: ModelBuilder, port: DevicePort) -> Following:
    f_0 = m.parameter(
        "f_0",
        F_0,
        "Hz",
        "Natural frequency with which the current follows the voltage's angle",
        minimum=0.1,
        maximum=50.0,
    )
    current, turning = (
        Phasor(
            m.state(f"{name}_x", start.re, "pu", f"{text}, real part", base="S_n"),
            m.state(f"{name}_y", start.im, "pu", f"{text}, imaginary part", base="S_n"),
        )
        for name, start, text in (
            ("i", port.i_0, "Current into the bus"),
            ("turning", ZERO, "Rate at which the current goes on turning, per ω_0"),
        )
    )
    return Following(current, turning, 2 * pi * f_0)


def _turned_current(port: DevicePort, v: Phasor) -> Phasor:
    """The current of the operating point [pu, S_n], turned as far as the voltage is."""
    size = fmax(v.magnitude(), LEAST_VOLTAGE) * port.v_0.magnitude()
    return port.i_0 * v * port.v_0.conjugate() / size

"""The converter without network transients, for RMS tools with steps of milliseconds.

The filter's voltages are algebraic and the current control is a lag; PLL and outer control are those of the EMT
variant. A current source has no emf. Its emf is the voltage that the converter's current gives at the capacitor, with
a bus voltage that two lags extrapolate: 2·v_1 − v_2 errs by (s·τ)², and is a function of states alone.
"""

from dataclasses import dataclass

import casadi as ca

from fmus.converter_parts.filter import APPENDIX, FilterData, declare_filter_data
from fmus.grid_following.converter import P_0, S_N, Signals, declare_signals
from fmus.grid_following.outer_control import Measured, outer_control
from fmus.grid_following.pll import phase_locked_loop
from fmus.toolchain.frames import Phasor, power, qd_state
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    MasterStep,
    SourceEmf,
    declare_master_step,
    declare_phasor_outputs,
    motion,
    phasor_builder,
)
from fmus.toolchain.port import DevicePort, device_port

SHORT = 1e-3
"""Communication step in parts of the lags below which their delays are those of a step so short: 2e-7 from τ."""


def grid_following_converter_phasor() -> Model:
    """PLL and outer control of `grid_following_converter` behind an algebraic electrical side."""
    m = phasor_builder("gfl_phasor", "Grid-following converter with PLL and P, Q or voltage control (phasor type)")
    port = device_port(m, S_n=S_N, P_0=P_0)
    f = declare_filter_data(m, port)
    master = declare_master_step(m)
    seen = _bus_voltage(m, port, master)
    i_s = qd_state(m, "current_control.i_s", f.initial.i_s, "Current of the converter")
    theta = m.algebraic("theta")
    u = _capacitor_voltage(f, seen.value.rotated(-theta), i_s.value)
    frame = phase_locked_loop(m, f.initial.theta, port.omega_b, u)
    m.close(theta, frame.theta)
    seen.follow(m, port.v)
    into_grid = (i_s.value - _capacitor(f) * u) * port.connected
    measured = Measured(power(u, into_grid), u.magnitude(), frame.w)
    limited, i_ref = outer_control(m, f, port, measured, _capacitor(f) * u)
    with m.scope("current_control"):
        tau = m.parameter("tau", 0.001, "s", "Time constant of the current loop", minimum=1e-3, source=APPENDIX)
        i_s.set_derivative(m, (i_ref - i_s.value) / tau)
        moving = motion(m, "slow", i_s.value, f.initial.i_s, "Current of the converter")

    def emf(time: ca.SX) -> Phasor:
        i_then = (i_s.value + moving * time).rotated(frame.theta + port.omega_b * (frame.w - 1) * time)
        return _capacitor_voltage(f, seen.after(time), i_then)

    source = SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next))
    declare_phasor_outputs(m, port, source, Phasor(f.R_t, f.X_t))
    declare_signals(m, Signals(frame, limited, u.magnitude(), i_s.value.magnitude()))
    return m.build()


def _capacitor(f: FilterData) -> Phasor:
    """Admittance of the capacitor with its series resistance, at rated frequency [pu, S_n]."""
    return Phasor(0.0, f.B_c) / Phasor(1.0, f.R_cap * f.B_c)


def _capacitor_voltage(f: FilterData, v: Phasor, i_s: Phasor) -> Phasor:
    """Voltage that the converter's current gives at the capacitor, with a bus voltage behind the transformer [pu]."""
    impedance = Phasor(f.R_t, f.X_t)
    return (v + impedance * i_s) / (Phasor(1, 0) + impedance * _capacitor(f))


@dataclass(frozen=True)
class _BusVoltage:
    """Bus voltage through one lag and through two, in the network frame, in which a master holds it.

    Attributes
    ----------
    delay, more
        Of the first lag at the end of a communication step, and how much later the second is [s].
    """

    once: Phasor
    twice: Phasor
    tau: ca.SX
    delay: ca.SX
    more: ca.SX

    @property
    def value(self) -> Phasor:
        """The voltage, extrapolated [pu]; right on average over a step in which the input is held."""
        return 2 * self.once - self.twice

    def after(self, time: ca.SX) -> Phasor:
        """The voltage [pu] at that time [s] after the end of a communication step."""
        return self.once + (self.once - self.twice) * ((self.delay + time) / self.more)

    def follow(self, m: ModelBuilder, v: Phasor) -> None:
        """Give both lags what they follow."""
        for behind, ahead in ((self.once, v), (self.twice, self.once)):
            m.derivative(ca.SX(behind.re), (ahead.re - behind.re) / self.tau)
            m.derivative(ca.SX(behind.im), (ahead.im - behind.im) / self.tau)


def _bus_voltage(m: ModelBuilder, port: DevicePort, master: MasterStep) -> _BusVoltage:
    """Declare both lags.

    A step H holds the voltage of its middle. At its end the first lag is late by D = (H/2)·coth(H/2τ) and the second by
    (H²/4τ)/sinh²(H/2τ) more; both are τ where H is short.
    """
    with m.scope("bus_voltage"):
        shortest = m.parameter(
            "tau", 0.002, "s", "Time constant of both lags of the bus voltage; at least communication_step",
            minimum=1e-3,
        )  # fmt: skip
        once, twice = (
            Phasor(
                *(
                    m.state(f"{name}_{part}", initial, "pu", f"Bus voltage through {text}, {part} part", base="bus")
                    for part, initial in (("re", port.v_0.re), ("im", port.v_0.im))
                )
            )
            for name, text in (("once", "one lag"), ("twice", "two lags"))
        )
    tau = ca.fmax(shortest, master.size)
    ratio = ca.fmax(master.size / tau, SHORT)
    growth = ca.exp(ratio)
    more = tau * ratio**2 / (growth - 2 + 1 / growth)
    return _BusVoltage(once, twice, tau, tau * ratio / 2 * (growth + 1) / (growth - 1), more)

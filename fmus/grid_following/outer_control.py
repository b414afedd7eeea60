"""Outer control: active power, and reactive power or voltage, each by a PI controller that asks for current.

The gains follow from one response time each, unless they are given. Without given ones the controllers' zeros cancel
the lag τ_m of the measurement: at 1 pu and with a fast current control the measured power follows its reference as
1/(1 + s·τ), the power as (1 + s·τ_m)/(1 + s·τ).
"""

from dataclasses import dataclass

from fmus.converter_parts.filter import APPENDIX, FilterData
from fmus.grid_following.current_limit import Limited, limited_current
from fmus.toolchain.blocks import low_pass
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, Scalar, if_else

CHOSEN = "chosen here: about six times slower than the PLL"
# time constant [s] with which control and capacitor follow the bus behind an open breaker
TRACKING_TIME = 0.01


@dataclass(frozen=True)
class Measured:
    """P + jQ and voltage magnitude at the capacitor branch [pu, S_n], and the PLL's frequency [pu, f_n]."""

    s: Phasor
    u: Expr
    w: Expr


def outer_control(
    m: ModelBuilder, f: FilterData, port: DevicePort, measured: Measured, standby: Phasor
) -> tuple[Limited, Phasor]:
    """Declare both controllers and the current limit; return what is asked for, and the converter's reference.

    ``f``: filter data with the operating point; ``port``: the port, which gives the breaker's position; ``measured``:
    without the lags of the measurement, which are declared here; ``standby``: current that the converter injects behind
    an open breaker, its own frame [pu, S_n]."""
    start = f.initial
    with m.scope("measurement"):
        tau = m.parameter(
            "tau",
            0.01,
            "s",
            "Lag of the measurements of P, Q and u",
            minimum=1e-3,
            source="chosen here",
        )
        P_f = low_pass(m, "P_f", Expr(measured.s.re), tau, start.s.re)
        Q_f = low_pass(m, "Q_f", Expr(measured.s.im), tau, start.s.im)
        U_f = low_pass(m, "U_f", measured.u, tau, start.u.re)
    active, K_P = _active_error(m, start.s.re, P_f, measured.w)
    reactive, K_Q = _reactive_error(m, start.s.im, start.u.re, Q_f, U_f)
    crossed = _declare_crossing(m)
    of_P = _declare_gains(m, "active_power", tau * K_P, K_P)
    of_Q = _declare_gains(m, "reactive_power", tau * K_Q, K_Q)
    with m.scope("active_power"):
        own = if_else(crossed, start.i_s.im, start.i_s.re)
        x_P = m.state("x", own, "pu", "Integrator, active current", base="S_n")
    with m.scope("reactive_power"):
        own = if_else(crossed, start.i_s.re, -start.i_s.im)
        x_Q = m.state("x", own, "pu", "Integrator, reactive current", base="S_n")
    asked_P, asked_Q = of_P.proportional * active + x_P, of_Q.proportional * reactive + x_Q
    demanded = Phasor(if_else(crossed, asked_Q, asked_P), if_else(crossed, asked_P, -asked_Q))
    limited = limited_current(m, start, demanded)
    tracked, excess = (standby - demanded) / TRACKING_TIME, limited.excess
    rate_P = _unless_outward(of_P.integral * active, if_else(crossed, excess.im, excess.re))
    rate_Q = _unless_outward(of_Q.integral * reactive, if_else(crossed, excess.re, -excess.im))
    tracked_P = if_else(crossed, tracked.im, tracked.re)
    tracked_Q = if_else(crossed, tracked.re, -tracked.im)
    rate = port.through_breaker(Phasor(rate_P, rate_Q), Phasor(tracked_P, tracked_Q))
    m.derivative(x_P, rate.re)
    m.derivative(x_Q, rate.im)
    return limited, port.through_breaker(limited.allowed, standby)


@dataclass(frozen=True)
class Gains:
    """Proportional [pu] and integral gain [1/s] of an outer controller."""

    proportional: Expr
    integral: Expr


def _declare_gains(m: ModelBuilder, scope: str, proportional: Expr, integral: Expr) -> Gains:
    """Declare both gains, 0 by default, where those from the response time hold, which are given."""
    with m.scope(scope):
        K_P = m.parameter(
            *("K_P", 0.0, "pu", "Proportional gain; 0: from tau and measurement.tau"),
            base="S_n",
            minimum=0.0,
        )
        K_I = m.parameter("K_I", 0.0, "1/s", "Integral gain; 0: 1/tau", minimum=0.0)
    return Gains(if_else(K_P > 0, K_P, proportional), if_else(K_I > 0, K_I, integral))


def _declare_crossing(m: ModelBuilder) -> Expr:
    """Declare that each controller asks for the other's current."""
    with m.scope("outer_control"):
        crossed = m.switch(
            "crossed",
            False,
            "P asks for reactive and Q for active current, as PowerSimulationsDynamics.jl's PI controllers do",
        )
    return crossed > 0


def _active_error(m: ModelBuilder, P_0: Scalar, P_f: Expr, w: Expr) -> tuple[Expr, Expr]:
    """Error of the active power [pu] with the droop's part, and the integral gain [1/s]."""
    with m.scope("active_power"):
        tau = m.parameter("tau", 0.1, "s", "Response time", minimum=5e-3, source=CHOSEN)
        change = m.parameter(
            "delta_P_ref", 0, "pu", "Change of the P reference", base="S_n", tunable=True
        )
        P_ref = m.calculated(
            "P_ref", P_0, "pu", "Active-power reference of the operating point", base="S_n"
        )
    with m.scope("frequency_droop"):
        enabled = m.switch(
            "enabled", False, "Active power answers the frequency that the PLL sees", tunable=True
        )
        R_f = m.parameter(
            "R_f", 0.05, "pu", "P-f droop", base="S_n", minimum=1e-3, tunable=True, source=APPENDIX
        )
        lag = m.parameter(
            "tau", 0.05, "s", "Lag of the measured frequency", minimum=1e-3, source="chosen here"
        )
        w_f = m.state("w_f", 1, "pu", "Measured frequency", base="f_n")
        m.derivative(w_f, (w - w_f) / lag)
    return P_ref + change + enabled * (1 - w_f) / R_f - P_f, 1 / tau


def _reactive_error(
    m: ModelBuilder, Q_0: Scalar, U_0: Scalar, Q_f: Expr, U_f: Expr
) -> tuple[Expr, Expr]:
    """Error of what the mode controls [pu, as reactive power], and the integral gain [1/s]."""
    with m.scope("reactive_power"):
        mode = m.parameter(
            "mode",
            0,
            "1",
            "0: reactive power; 1: voltage; 2: reactive power with Q-V droop",
            minimum=0,
            maximum=2,
            type="Integer",
        )
        tau = m.parameter("tau", 0.1, "s", "Response time", minimum=5e-3, source=CHOSEN)
        R_V = m.parameter(
            "R_V", 0.067, "pu", "Q-V droop", base="S_n", minimum=1e-3, source=APPENDIX
        )
        X_s = m.parameter(
            "X_s",
            0.5,
            "pu",
            "Reactance to a stiff voltage for which modes 1 and 2 respond within tau",
            base="S_n",
            minimum=0.01,
            source="chosen here: a short-circuit ratio near 3, and the step-up transformer",
        )
        change_Q = m.parameter(
            "delta_Q_ref", 0, "pu", "Change of the Q reference", base="S_n", tunable=True
        )
        change_U = m.parameter(
            "delta_U_ref", 0, "pu", "Change of the voltage reference", base="S_n", tunable=True
        )
        Q_ref = m.calculated(
            "Q_ref", Q_0, "pu", "Reactive-power reference of the operating point", base="S_n"
        )
        U_ref = m.calculated(
            "U_ref", U_0, "pu", "Voltage reference of the operating point", base="S_n"
        )
    of_q, of_u = Q_ref + change_Q - Q_f, U_ref + change_U - U_f
    droop = (of_q + of_u / R_V) / (1 + X_s / R_V)
    return if_else(mode < 0.5, of_q, if_else(mode < 1.5, of_u / X_s, droop)), 1 / tau


def _unless_outward(rate: Scalar, excess: Scalar) -> Expr:
    """The integrator's rate; 0 where it would lead further beyond the limit."""
    return if_else(rate * excess > 0, 0, rate)

"""Electrical side of the converter of the benchmark, and its control: PLL with freezing, current limit, outer and
inner control.

A modular multilevel converter needs no filter capacitor: its own voltage lies behind the reactance of its transformer,
in the frame of the PLL. The transformer is one reactance with an ideal ratio r at the side of the grid: u = v/r and
i = r·i_bus, per unit on S_n. Names of the benchmark: its d is our q, its q our −d. Gains are those of the benchmark
itself, so that its data can be entered as they are published."""

from dataclasses import dataclass

from fmus.grid_following.pll import Frame, LoopDefaults, phase_locked_loop
from fmus.toolchain.blocks import clamp, low_pass
from fmus.toolchain.frames import Phasor, QdState, power, qd_state
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import BREAKER_TIME, DevicePort
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and, logic_or, sqrt

COLIB = "COLIB, four-VSC benchmark (Van Cutsem 2023), a wind park"


@dataclass(frozen=True)
class Start:
    """The operating point: frame [rad], u and i in it [pu, S_n], P + jQ at the bus, voltage of the converter."""

    theta: Expr
    u: Phasor
    i: Phasor
    s: Phasor
    v_c: Phasor


@dataclass(frozen=True)
class Transformer:
    """Resistance and reactance [pu, S_n], ratio at the grid's side, the operating point, and the current's state."""

    R: Expr
    X: Expr
    ratio: Expr
    start: Start
    i: QdState


def declare_transformer(m: ModelBuilder, port: DevicePort) -> Transformer:
    """Declare parameters and current; the equation follows once the control has formed the voltage."""
    with m.scope("transformer"):
        R = m.parameter("R", 0.005, "pu", "Resistance", base="S_n", minimum=0.0, source=COLIB)
        X = m.parameter("X", 0.12, "pu", "Reactance", base="S_n", minimum=0.01, source=COLIB)
        ratio = m.parameter("ratio", 1.0, "1", "Ratio at the grid's side", minimum=0.5, maximum=2.0)
        theta = port.v_0.angle()
        u = Phasor(port.v_0.magnitude() / ratio, 0)
        inside = port.i_0.rotated(-theta) * ratio
        start = Start(theta, u, inside, power(port.v_0, port.i_0), u + Phasor(R, X) * inside)
        return Transformer(R, X, ratio, start, qd_state(m, "i", inside, "Current of the converter"))


def transformer_equation(
    m: ModelBuilder, t: Transformer, port: DevicePort, v_c: Phasor, u: Phasor, w: Expr
) -> None:
    """(X/ω_b)·di/dt = v_c − u − (R + j·w·X)·i; behind an open breaker the current fades.

    ``port``: the port, which gives the breaker's position; ``v_c``, ``u``: voltage of the converter, and of the bus
    behind the ratio, converter's frame [pu, S_n]; ``w``: frequency of that frame [pu, f_n]."""
    i = t.i.value
    closed = (v_c - u - Phasor(t.R, w * t.X) * i) * (port.omega_b / t.X)
    t.i.set_derivative(m, port.through_breaker(closed, i * (-1 / BREAKER_TIME)))


# time constant [s] of the state that remembers; it passes the middle 0.7 ms after a threshold
MEMORY = 1e-3


def running(m: ModelBuilder, v: Expr) -> Expr:
    """1 while the PLL runs, 0 while it stands: below ``V_low``, and from there until ``V_high``.

    ``v``: magnitude of the bus voltage [pu]."""
    with m.scope("pll"), m.scope("freezing"):
        low = m.parameter(
            "V_low",
            0.4,
            "pu",
            "Voltage below which the PLL stands; 0: never",
            base="bus",
            minimum=0.0,
            source=COLIB,
        )
        high = m.parameter(
            "V_high", 0.5, "pu", "Voltage above which it runs again", base="bus", source=COLIB
        )
        m.require(high - low, "pll.freezing.V_high must be above pll.freezing.V_low")
        awake = m.state("awake", 1.0, "1", "Memory of the thresholds: the PLL runs above 0.5")
        runs = if_else(awake > 0.5, 1.0, 0.0)
        m.derivative(awake, (if_else(v < low, 0.0, if_else(v > high, 1.0, runs)) - awake) / MEMORY)
    return runs


SMALLEST = 1e-3  # least part of the limit's square under a root, for a finite derivative


@dataclass(frozen=True)
class Limits:
    """Largest current, largest active current now, and largest reactive current of the voltage control [pu, S_n]."""

    I_max: Expr
    active: Expr
    reactive: Expr


def declare_limits(m: ModelBuilder, start: Start, reactive: Expr) -> Limits:
    """Declare the limit and the state that carries the active current's share.

    ``start``: the operating point. It leaves sqrt(I_max² − i_q0²) for the reactive current of the voltage control;
    ``reactive``: reactive current in the converter [pu, S_n]."""
    with m.scope("current_limit"):
        I_max = m.parameter(
            "I_max", 1.0, "pu", "Largest current", base="S_n", minimum=0.1, source=COLIB
        )
        T = m.parameter(
            "tau", 0.002, "s", "Lag of the active current's limit", minimum=1e-3, source=COLIB
        )
        recovery = m.parameter(
            "recovery",
            0.5,
            "pu/s",
            "Fastest recovery of the active current's limit",
            base="S_n",
            minimum=0.01,
            source=COLIB,
        )
        m.require(
            I_max - start.i.magnitude(),
            "the power flow asks for more current than current_limit.I_max: lower P_0 or Q_0, or raise S_n",
        )
        most = m.state(
            "I_active", _rest(I_max, start.i.im), "pu", "Largest active current", base="S_n"
        )
        m.derivative(most, fmin((_rest(I_max, reactive) - most) / T, recovery))
    return Limits(I_max, clamp(most, 0, I_max), _rest(I_max, start.i.re))


def limited(limits: Limits, active: Expr, reactive: Expr) -> Phasor:
    """The current that is allowed [pu, S_n]."""
    return Phasor(
        clamp(active, -limits.active, limits.active), clamp(reactive, -limits.I_max, limits.I_max)
    )


def _rest(most: Expr, other: Scalar) -> Expr:
    return sqrt(fmax(most**2 - other**2, SMALLEST * most**2))


LOOP = LoopDefaults(
    f_0=7.957747154594767, xi=1.0, source=f"{COLIB}: 5/(2π·0.1 s), from its gains 10/T and 25/T²"
)
MODES = f"{COLIB}, mode 0; 0.1667 and 50 in mode 1"


@dataclass(frozen=True)
class Following:
    """Quantities that the variants show: frame, current into the bus in it [pu, S_n], and magnitudes."""

    frame: Frame
    into_bus: Phasor
    u_c: Expr
    i: Expr
    demand: Expr


def following_converter(m: ModelBuilder, port: DevicePort, v: Phasor) -> Following:
    """Declare the whole converter.

    ``v``: voltage at the bus, network frame [pu]."""
    t = declare_transformer(m, port)
    theta = m.algebraic("theta")
    bus = v.rotated(-theta)
    frame = phase_locked_loop(m, t.start.theta, port.omega_b, bus, LOOP, running(m, v.magnitude()))
    m.close(theta, frame.theta)
    u, i = bus / t.ratio, t.i.value
    inside = u + Phasor(t.R, t.X) * i
    limits = declare_limits(m, t.start, Expr(i.im))
    with m.scope("measurement"):
        tau = m.parameter(
            "tau",
            0.0033,
            "s",
            "Lag of the measurements of P, Q and u_c",
            minimum=1e-3,
            source=COLIB,
        )
    s = power(u, i)
    active = _active_power(m, port, t, limits, Expr(s.re), tau)
    seen = _Seen(Expr(s.im), inside.magnitude(), v.magnitude())
    reactive = _reactive_power(m, port, t, limits, seen, tau)
    i_ref = limited(limits, active, reactive)
    v_c = _current_control(m, port, t, u, frame.w, i_ref)
    transformer_equation(m, t, port, v_c, u, frame.w)
    asked = sqrt(active**2 + reactive**2) / limits.I_max
    return Following(frame, i / t.ratio, inside.magnitude(), i.magnitude(), asked)


def _active_power(
    m: ModelBuilder, port: DevicePort, t: Transformer, limits: Limits, P: Expr, tau: Expr
) -> Expr:
    """Active current that the PI controller asks for [pu, S_n]."""
    with m.scope("active_power"):
        K_p = m.parameter(
            "K_p",
            0.0333,
            "pu",
            "Proportional gain",
            base="S_n",
            minimum=0.0,
            source=f"{COLIB}: K_i·measurement.tau",
        )
        K_i = m.parameter(
            "K_i", 10.0, "pu/s", "Integral gain", base="S_n", minimum=0.01, source=COLIB
        )
        change = m.parameter(
            "delta_P_ref", 0, "pu", "Change of the P reference", base="S_n", tunable=True
        )
        P_ref = m.calculated(
            "P_ref", t.start.s.re, "pu", "Reference of the operating point", base="S_n"
        )
        error = P_ref + change - low_pass(m, "P_f", P, tau, t.start.s.re)
        x = m.state("x", t.start.i.re, "pu", "Integrator, active current", base="S_n")
        _integrate(m, port, x, K_i * error, limits.active)
        return K_p * error + clamp(x, -limits.active, limits.active)


@dataclass(frozen=True)
class _Seen:
    """Reactive power at the bus, magnitudes of the converter's and of the bus voltage [pu]."""

    Q: Expr
    u_c: Expr
    v: Expr


def _reactive_power(
    m: ModelBuilder, port: DevicePort, t: Transformer, limits: Limits, seen: _Seen, tau: Expr
) -> Expr:
    """Reactive current that is asked for [pu, S_n]: a PI controller, and what a low voltage adds."""
    with m.scope("reactive_power"):
        mode = m.parameter(
            "mode",
            0,
            "1",
            "0: reactive power at the bus; 1: voltage of the converter",
            minimum=0,
            maximum=1,
            type="Integer",
        )
        K_p = m.parameter(
            "K_p", 0.0333, "pu", "Proportional gain", base="S_n", minimum=0.0, source=MODES
        )
        K_i = m.parameter(
            "K_i", 10.0, "pu/s", "Integral gain", base="S_n", minimum=0.01, source=MODES
        )
        Q_ref = m.calculated(
            "Q_ref", t.start.s.im, "pu", "Reference of the operating point", base="S_n"
        )
        U_ref = m.calculated(
            "U_ref", t.start.v_c.magnitude(), "pu", "Reference of the operating point", base="S_n"
        )
        change = m.parameter(
            "delta_ref", 0, "pu", "Change of the reference", base="S_n", tunable=True
        )
        by_q = mode < 0.5
        controlled = if_else(by_q, seen.Q, seen.u_c)
        start = if_else(by_q, Q_ref, U_ref)
        slow = low_pass(m, "measured", controlled, tau, start)
        high, low = _support(m)
        error = if_else(seen.v < low, 0, slow - start - change)
        x = m.state("x", t.start.i.im, "pu", "Integrator, reactive current", base="S_n")
        _integrate(m, port, x, K_i * error, limits.reactive)
        asked = clamp(
            K_p * error + clamp(x, -limits.reactive, limits.reactive),
            -limits.reactive,
            limits.reactive,
        )
        return asked - limits.I_max * clamp((high - seen.v) / (high - low), 0, 1)


def _support(m: ModelBuilder) -> tuple[Expr, Expr]:
    """Bus voltages [pu] at which the support begins, and at which all current is reactive."""
    with m.scope("support"):
        high = m.parameter(
            "V_1",
            0.95,
            "pu",
            "Voltage below which reactive current is added",
            base="bus",
            source=COLIB,
        )
        low = m.parameter(
            "V_2",
            0.5,
            "pu",
            "Voltage below which all of it is, and integration stands",
            base="bus",
            source=COLIB,
        )
        m.require(high - low, "support.V_1 must be above support.V_2")
        return high, low


def _integrate(m: ModelBuilder, port: DevicePort, x: Expr, rate: Expr, most: Expr) -> None:
    """The integrator stands still at its limit; behind an open breaker it returns to 0."""
    outward = logic_or(logic_and(x > most, rate > 0), logic_and(x < -most, rate < 0))
    m.derivative(
        x, if_else(outward, 0, rate) * port.connected - x / BREAKER_TIME * (1 - port.connected)
    )


def _current_control(
    m: ModelBuilder, port: DevicePort, t: Transformer, u: Phasor, w: Expr, i_ref: Phasor
) -> Phasor:
    """Voltage of the converter [pu, S_n]: PI controller, decoupling, and the voltage along the frame fed forward."""
    with m.scope("current_control"):
        K_p = m.parameter(
            "K_p", 0.4584, "pu", "Proportional gain", base="S_n", minimum=0.01, source=COLIB
        )
        K_i = m.parameter(
            "K_i", 6.0, "pu/s", "Integral gain", base="S_n", minimum=0.0, source=COLIB
        )
        x = qd_state(m, "x", t.start.i * t.R, "Integrator of the current loop")
        error = i_ref - t.i.value
        x.set_derivative(m, port.through_breaker(error * K_i, x.value * (-1 / BREAKER_TIME)))
        return error * K_p + x.value + Phasor(0, w * t.X) * t.i.value + Phasor(u.re, 0)

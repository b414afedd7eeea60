"""REGFM_B1: a grid-forming inverter as a virtual synchronous machine, with a PLL that limits its angle.

    machine:  2·H·Δω' = P_cmd − Pf − D1·Δω − D2·s/(s + wD)·Δω within Dwmin…Dwmax
    P_cmd:    Pref − Δω/mp behind Tp (FFlag; wFlag: of the PLL's Δω)
    PLL:      v_q → kpPLL + kiPLL/s within DwPLLmin…DwPLLmax = its Δω; both wait below VPLLfrz
    angle:    δ_IT' = ω_b·(Δω − Δω_PLL) within δ_ITmin…δ_ITmax, to the PLL's angle
    limits:   δ_ITmax' = kI·(Idmax − Id) within 0…δ_max; δ_ITmin' = kI·(−Ke·Idmax − Id) within −δ_max…0 (ESFlag);
              δ_max = asin(XL·ImaxSS); PQFlag: Idmax = kf·ImaxSS, Iqmax = √(ImaxSS² − Id²); else the other way round
    voltage:  V_cmd = Vref + mq·(Qref − Qf), or Vref + mq·(Iq_0 − Iq) (VdrpFlag) → less Vf → kpv + kiv/s
              within |V ± j·XL·(Id ∓ j·Iqmax)|
    fault:    i = (E − v)/(Re + j·XL); where |i| > ImaxF the inner voltage is the one that gives i·ImaxF/|i|

Id and Iq are in the PLL's frame behind TIf; Iq above 0 feeds reactive power. Names of parameters are those of the
specification (NREL/TP-5D00-90260, 2024), whose equations a public model for ANDES gives in words and code; defaults are
those of a public script of PNNL's for PSS/E 36.4."""

from collections.abc import Mapping
from dataclasses import dataclass

from fmus.converter_parts.fault_current import (
    FaultLimit,
    declare_seen_lag,
    declare_terminal_outputs,
    limited_in_faults,
)
from fmus.synchronous_generator.data_lines import Given, declared, number, power, seconds
from fmus.toolchain.blocks import clamp, held_at_limits, low_pass
from fmus.toolchain.frames import Phasor
from fmus.toolchain.frames import power as power_of
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import declare_phasor_outputs, phasor_builder, source_emf
from fmus.toolchain.port import DevicePort, device_port
from fmus.toolchain.symbols import Expr, atan2, fmax, fmin, if_else, logic_and, sqrt
from fmus.toolchain.variables import usual_beside

SOURCE = "PNNL's public script of REGFM_B1 for PSS/E 36.4"
CHOSEN = "chosen here"

LEAST_LAG = 1e-3
"""Least lag [s] of what is measured: no output follows an input at once."""

RETURN_TIME = 0.01
"""Time constant [s] with which a limit of the angle comes to rest at its outer limit."""

FRINGE = 1e-12
"""Square [pu²] below which no root is taken."""

LINES = (
    power("mq", 0.05, "Q-V droop gain, or virtual reactance", 0),
    power("kpv", 0.0, "Proportional gain of the voltage control", 0),
    number("kiv", 5.0, "Integral gain of the voltage control", 0, "1/s"),
    number("mp", 0.02, "P-f droop gain", 1e-4),
    number("Dwmax", 0.05, "Most speed deviation of the machine", 0),
    number("Dwmin", -0.05, "Least speed deviation of the machine"),
    number("kpPLL", 0.265, "Proportional gain of the PLL", 0),
    number("kiPLL", 2.65, "Integral gain of the PLL", 0, "1/s"),
    number("DwPLLmax", 0.2, "Most speed deviation of the PLL", 0),
    number("DwPLLmin", -0.2, "Least speed deviation of the PLL"),
    seconds("Tp", 0.0, "Lag of the P-f droop"),
    number("H", 0.5, "Inertia constant", 1e-3, "s"),
    power("D1", 0.0, "Damping", 0),
    power("D2", 100.0, "Transient damping", 0),
    number("wD", 50.0, "Corner of the transient damping", 1e-3, "rad/s"),
    power("ImaxSS", 1.0, "Most current in steady state", 1e-3),
    number("kf", 0.9, "Share of ImaxSS for the current that comes first", 1e-3),
    number("kI", 2.0, "Integral gain of the limit of active current", 0, "1/s"),
    power("ImaxF", 1.5, "Most current in a fault", 1e-3),
    seconds("TPf", 0.02, "Lag of the measurement of P; at least 1 ms"),
    seconds("TQf", 0.02, "Lag of the measurement of Q; at least 1 ms"),
    seconds("TVf", 0.0, "Lag of the measurement of V; at least 1 ms"),
    seconds("TIf", 0.0, "Lag of the measurement of current; at least 1 ms"),
    number("Ke", 1.0, "Share of Idmax that it draws at most", 0),
    power("VPLLfrz", 0.05, "Voltage below which the PLL waits", 0),
)
SWITCHES: Mapping[str, tuple[bool, str]] = {
    "wFlag": (False, "The P-f droop takes the PLL's speed; else the machine's"),
    "VdrpFlag": (False, "The voltage droops by reactive current; else by reactive power"),
    "PQFlag": (True, "Active current comes first; else reactive current"),
    "FFlag": (True, "There is a P-f droop"),
    "ESFlag": (True, "It can draw active power"),
}

S_N = 100.0  # default rating [MVA]: the base of networks
P_0 = 0.5  # default dispatch [pu, S_n]
USUAL = usual_beside(__file__)


@dataclass(frozen=True)
class _Start:
    """The operating point: terminal voltage [pu], powers, currents in the PLL's frame, and inner voltage [pu, S_n]."""

    V: Expr
    P: Expr
    Q: Expr
    I_d: Expr
    I_q: Expr
    E: Expr
    angle: Expr


@dataclass(frozen=True)
class _Signals:
    """Measured signals, behind lags [pu, S_n], and the voltage across the PLL's axis."""

    P: Expr
    Q: Expr
    V: Expr
    I_d: Expr
    I_q: Expr
    across: Expr
    waits: Expr


def regfm_b1_phasor() -> Model:
    """The virtual synchronous machine of the WECC, phasor type."""
    title = (
        "Grid-forming inverter REGFM_B1 of the WECC, a virtual synchronous machine (phasor type)"
    )
    m = phasor_builder("regfm_b1_phasor", title, kind="converter", usual=USUAL)
    port = device_port(m, S_n=S_N, P_0=P_0)
    R = m.parameter("Re", 0.0, "pu", "Coupling resistance", base="S_n", minimum=0, source=CHOSEN)
    X = m.parameter("XL", 0.15, "pu", "Coupling reactance", base="S_n", minimum=0.01, source=CHOSEN)
    Z = Phasor(R, X)
    flags = {name: m.switch(name, on, text) for name, (on, text) in SWITCHES.items()}
    p = declared(m, LINES, SOURCE)
    start = _start(port, Z)
    pll = m.state("delta_PLL", port.v_0.angle(), "rad", "Angle of the PLL in the network frame")
    turn = m.state("delta_IT", start.angle, "rad", "Angle of the inner voltage to the PLL's")
    P, Q, I_d, I_q = (m.algebraic(name) for name in ("P", "Q", "I_d", "I_q"))
    seen = _measured(m, p, port, start, (P, Q, I_d, I_q), pll)
    w_PLL = _speed_of_pll(m, p, port, seen, pll)
    w = _speed(m, p, flags, start, seen, w_PLL)
    Id_max, Iq_max = _steady_limits(p, flags["PQFlag"], seen.I_d, seen.I_q)
    low, high = _limits_of_angle(m, p, flags["ESFlag"], seen, Id_max, X)
    m.derivative(turn, held_at_limits(turn, port.omega_b * (w - w_PLL), low, high))
    inner = clamp(turn, low, high)
    E = _inner_voltage(m, p, flags, start, seen, Iq_max=Iq_max, X=X)
    _require_within(m, p, flags, start, X)

    delta = pll + inner
    v = port.v.rotated(-delta)
    limit = FaultLimit(p.ImaxF, declare_seen_lag(m, "T_seen"))
    at_rest = Phasor(start.V, 0.0).rotated(-start.angle)
    limited, share = limited_in_faults(m, limit, Phasor(E, 0.0), v, Z, at_rest)
    i = (limited - v) / Z * port.connected
    s, in_pll = power_of(v, i), i.rotated(inner)
    m.close(P, s.re)
    m.close(Q, s.im)
    m.close(I_d, in_pll.re)
    m.close(I_q, -in_pll.im)
    emf = source_emf(m, limited, Phasor(start.E, 0.0), delta, port.omega_b * w)
    declare_phasor_outputs(m, port, emf, Z)
    m.output("omega", 1 + w, "pu", "Speed of the virtual machine", base="f_n")
    m.output("E_inner", E, "pu", "Inner voltage before the fault current limit", base="S_n")
    declare_terminal_outputs(m, v, i, share)
    return m.build()


def _start(port: DevicePort, Z: Phasor) -> _Start:
    s_0, V = power_of(port.v_0, port.i_0), port.v_0.magnitude()
    inner = Phasor(V, 0.0) + Z * Phasor(s_0.re / V, -s_0.im / V)
    P, Q = Expr(s_0.re), Expr(s_0.im)
    E, angle = inner.magnitude(), inner.angle()
    return _Start(V=V, P=P, Q=Q, I_d=P / V, I_q=Q / V, E=E, angle=angle)


def _measured(
    m: ModelBuilder,
    p: Given,
    port: DevicePort,
    start: _Start,
    signals: tuple[Expr, Expr, Expr, Expr],
    pll: Expr,
) -> _Signals:
    """Declare the lags of what is measured."""
    P, Q, I_d, I_q = signals
    V = port.v.magnitude()
    lags = fmax(p.TPf, LEAST_LAG), fmax(p.TQf, LEAST_LAG), fmax(p.TVf, LEAST_LAG)
    of_current = fmax(p.TIf, LEAST_LAG)
    return _Signals(
        P=low_pass(m, "Pf", P, lags[0], start.P),
        Q=low_pass(m, "Qf", Q, lags[1], start.Q),
        V=low_pass(m, "Vf", V, lags[2], start.V),
        I_d=low_pass(m, "Idf", I_d, of_current, start.I_d),
        I_q=low_pass(m, "Iqf", I_q, of_current, start.I_q),
        across=Expr(port.v.rotated(-pll).im),
        waits=Expr(V) < p.VPLLfrz,
    )


def _speed_of_pll(m: ModelBuilder, p: Given, port: DevicePort, seen: _Signals, angle: Expr) -> Expr:
    """Declare the PLL; return its speed deviation [pu]."""
    x = m.state("x_PLL", 0.0, "pu", "Integrator of the PLL", base="f_n")
    free = p.kpPLL * seen.across + x
    speed = if_else(seen.waits, 0, clamp(free, p.DwPLLmin, p.DwPLLmax))
    rate = held_at_limits(x, p.kiPLL * seen.across, p.DwPLLmin, p.DwPLLmax)
    m.derivative(x, if_else(seen.waits, 0, rate))
    m.derivative(angle, port.omega_b * speed)
    return speed


def _speed(
    m: ModelBuilder,
    p: Given,
    flags: Mapping[str, Expr],
    start: _Start,
    seen: _Signals,
    w_PLL: Expr,
) -> Expr:
    """Declare the virtual machine; return its speed deviation [pu]."""
    change = m.parameter("delta_Pref", 0, "pu", "Change of Pref", base="S_n", tunable=True)
    x = m.state("Dw", 0.0, "pu", "Speed deviation of the machine", base="f_n")
    w = clamp(x, p.Dwmin, p.Dwmax)
    slow = low_pass(m, "Dw_droop", if_else(flags["wFlag"], w_PLL, w), fmax(p.Tp, LEAST_LAG), 0.0)
    steady = m.state("Dw_steady", 0.0, "pu", "Slow part of the speed deviation", base="f_n")
    m.derivative(steady, p.wD * (w - steady))
    asked = start.P + change - if_else(flags["FFlag"], slow / p.mp, 0)
    torque = asked - seen.P - p.D1 * w - p.D2 * (w - steady)
    m.derivative(x, held_at_limits(x, torque / (2 * p.H), p.Dwmin, p.Dwmax))
    return w


def _steady_limits(p: Given, active_first: Expr, I_d: Expr, I_q: Expr) -> tuple[Expr, Expr]:
    """Most active and most reactive current in steady state [pu, S_n]."""
    first = p.kf * p.ImaxSS
    rest_d, rest_q = (sqrt(fmax(p.ImaxSS**2 - other**2, FRINGE)) for other in (I_q, I_d))
    return if_else(active_first, first, rest_d), if_else(active_first, rest_q, first)


def _limits_of_angle(
    m: ModelBuilder, p: Given, stores: Expr, seen: _Signals, Id_max: Expr, X: Expr
) -> tuple[Expr, Expr]:
    """Declare the limits of the angle to the PLL, which active current beyond its limit draws in [rad]."""
    sine = X * p.ImaxSS
    most = atan2(sine, sqrt(fmax(1 - sine**2, FRINGE)))
    high = m.state("delta_ITmax", most, "rad", "Most angle to the PLL")
    low = m.state("delta_ITmin", if_else(stores, -most, 0), "rad", "Least angle to the PLL")
    # at rest both lie at the outer limit, towards which they return instead of stopping: that has a linear model
    rising = fmin(p.kI * (Id_max - seen.I_d), (most - high) / RETURN_TIME)
    m.derivative(high, fmax(rising, -high / RETURN_TIME))
    falling = fmax(p.kI * (-p.Ke * Id_max - seen.I_d), (-most - low) / RETURN_TIME)
    at_zero = -low / RETURN_TIME
    m.derivative(low, if_else(stores, fmin(falling, at_zero), at_zero))
    return clamp(low, -most, 0), clamp(high, 0, most)


def _inner_voltage(
    m: ModelBuilder,
    p: Given,
    flags: Mapping[str, Expr],
    start: _Start,
    seen: _Signals,
    *,
    Iq_max: Expr,
    X: Expr,
) -> Expr:
    """Declare droop and control of the voltage; return the inner voltage [pu]."""
    change_Q = m.parameter("delta_Qref", 0, "pu", "Change of Qref", base="S_n", tunable=True)
    change_V = m.parameter("delta_Vref", 0, "pu", "Change of Vref", base="bus", tunable=True)
    by_power = start.Q + change_Q - seen.Q
    beyond = if_else(flags["VdrpFlag"], start.I_q - seen.I_q, by_power)
    error = start.V + change_V + p.mq * beyond - seen.V
    low, high = (
        sqrt(fmax((seen.V + side * X * Iq_max) ** 2 + (X * seen.I_d) ** 2, FRINGE))
        for side in (-1, 1)
    )
    x = m.state("x_V", start.E, "pu", "Integrator of the voltage control", base="S_n")
    m.derivative(x, held_at_limits(x, p.kiv * error, low, high))
    return clamp(p.kpv * error + x, low, high)


def _require_within(
    m: ModelBuilder, p: Given, flags: Mapping[str, Expr], start: _Start, X: Expr
) -> None:
    """Refuse an operating point beyond the limits."""
    Id_max, Iq_max = _steady_limits(p, flags["PQFlag"], start.I_d, start.I_q)
    flows = sqrt(start.I_d**2 + start.I_q**2)
    m.require(1 - X * p.ImaxSS, "XL·ImaxSS must lie below 1: lower one of them")
    m.require(p.ImaxF - flows, "the power flow asks for more current than ImaxF: raise it, or S_n")
    m.require(
        Id_max - start.I_d,
        "the power flow asks for more active current than ImaxSS, kf and Q_0 leave: lower P_0, or raise them or S_n",
    )
    m.require(
        if_else(flags["ESFlag"], start.I_d + p.Ke * Id_max, start.I_d),
        "the power flow asks it to draw more active current than ESFlag and Ke allow: raise P_0, or change them",
    )
    m.require(
        if_else(logic_and(start.I_q <= Iq_max, start.I_q >= -Iq_max), 1, -1),
        "the power flow asks for more reactive current than ImaxSS and P_0 leave: bring Q_0 nearer to 0, or raise them",
    )

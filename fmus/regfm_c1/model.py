"""REGFM_C1: a voltage source behind an impedance and a current source beside it, in one inverter.

    forming:   E∠δ behind Re + j·Xe, which feeds nothing at the operating point
      voltage: VFlag: (Vref behind TVr − V behind TVr)/mq; less Iq of this branch behind TIf → KpE + KiE/s
               within DEmin…DEmax → + Vref behind TVr → 1/(1 + s·TVSM) = E
      machine: 2·H·Δω' = P_droop − P of this branch behind TPf − P_damping, Dwmin ≤ Δω ≤ Dwmax; δ' = ω_b·Δω
      droop:   FFlag: (Δω_ref behind Twr − Δω behind Twm)/mp within DPGFMmin…DPGFMmax
      damping: D1·Δω + D2·s/(s + wD)·Δω within DPDmin…DPDmax
    following: I_p = P_cmd/v, I_q = Q_cmd/v + Kqv·(Vref0 − V_f) beyond dbVL1…dbVH1, at the angle of the voltage;
               V_f behind TVf, v = V_f but at least Vmin; P_cmd and Q_cmd within their limits
      limits:  PQFlag: |I_p| ≤ Kf·Imax, |I_q| ≤ √(Imax² − I_p²); else the other way round
    both:      where |i| > Imax, both branches' currents are multiplied by Imax/|i|

I_q above 0 feeds reactive power. Names of parameters are those of PowerWorld's help on the specification
(NREL/TP-5D00-97443, 2025), whose equations a public model for ANDES (REGFMC1) gives in code; so are defaults."""

from collections.abc import Mapping
from dataclasses import dataclass

from fmus.converter_parts.bus_voltage import LEAST_VOLTAGE
from fmus.converter_parts.current_at_angle import at_angle_of
from fmus.converter_parts.fault_current import declare_seen_lag, declare_terminal_outputs
from fmus.synchronous_generator.data_lines import Given, declared, number, power, pu, seconds
from fmus.toolchain.blocks import clamp, held_at_limits, low_pass
from fmus.toolchain.frames import Phasor
from fmus.toolchain.frames import power as power_of
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import declare_phasor_outputs, phasor_builder, source_emf
from fmus.toolchain.port import DevicePort, device_port
from fmus.toolchain.symbols import Expr, fmax, if_else, sqrt
from fmus.toolchain.variables import usual_beside
from fmus.wecc_renewable.signals import ROUNDING, dead_band

SOURCE = "the public model REGFMC1 for ANDES"
CHOSEN = "chosen here"

LEAST_LAG = 1e-3
"""Least lag [s] of what is measured: no output follows an input at once."""

FRINGE = 1e-12
"""Square [pu²] below which no root is taken."""

LINES = (
    power("mq", 0.4, "Q-V droop gain of the forming branch", 1e-4),
    power("KpE", 0.333, "Proportional gain of its voltage", 0),
    number("KiE", 3.333, "Integral gain of its voltage", 0, "1/s"),
    pu("DEmax", 0.2083, "Most that the control adds to its voltage", 0, base="bus"),
    pu("DEmin", -0.2083, "Least that the control adds to its voltage", base="bus"),
    seconds("TVr", 0.025, "Lag of its voltage and of the reference; at least 1 ms"),
    seconds("TVSM", 0.318, "Lag of its inner voltage; at least 1 ms"),
    power("DPGFMmax", 1.36, "Most power of its droop", 0),
    power("DPGFMmin", -1.36, "Least power of its droop"),
    seconds("Twr", 0.02, "Lag of the reference of speed; at least 1 ms"),
    seconds("Twm", 0.3183, "Lag of the machine's speed that droops; at least 1 ms"),
    number("mp", 0.041667, "P-f droop gain of the forming branch", 1e-4),
    number("Dwmax", 0.1667, "Most speed deviation of the machine", 0),
    number("Dwmin", -0.3333, "Least speed deviation of the machine"),
    number("H", 1.6, "Inertia constant", 1e-3, "s"),
    power("D1", 5.0, "Damping", 0),
    power("D2", 90.0, "Transient damping", 0),
    number("wD", 3.14, "Corner of the transient damping", 1e-3, "rad/s"),
    seconds("TVf", 0.02, "Lag of the voltage of the following branch; at least 1 ms"),
    seconds("TPf", 0.02, "Lag of the forming branch's power; at least 1 ms"),
    seconds("TIf", 0.02, "Lag of the forming branch's reactive current; at least 1 ms"),
    pu("Vmin", 0.88, "Least voltage by which the following branch divides", 0.01, base="bus"),
    pu("Vref0", 0.0, "Voltage reference of Kqv; 0: that of the operating point", 0.0, base="bus"),
    pu("dbVL1", -0.12, "Lower end of the dead band of Kqv; at most 0", base="bus"),
    pu("dbVH1", 0.12, "Upper end of the dead band of Kqv; at least 0", 0, base="bus"),
    power("Kqv", 2.0, "Reactive current by voltage beyond the dead band", 0),
    power("Imax", 1.2, "Most current", 1e-3),
    power("PcmdGFLmax", 1.2, "Most active power that is asked of the following branch"),
    power("PcmdGFLmin", -1.0, "Least active power that is asked of the following branch"),
    power("QcmdGFLmax", 0.6, "Most reactive power that is asked of the following branch"),
    power("QcmdGFLmin", -0.6, "Least reactive power that is asked of the following branch"),
)
OWN_LINES = (
    power("DPDmax", 1.0, "Most power of the damping", 0),
    power("DPDmin", -1.0, "Least power of the damping"),
    number("Kf", 1.0, "Share of Imax for the current that comes first", 1e-3),
)
SWITCHES: Mapping[str, str] = {
    "FFlag": "The forming branch has a P-f droop",
    "VFlag": "The forming branch has a Q-V droop; else it feeds no reactive current for long",
    "PQFlag": "Active current comes first; else reactive current",
}

S_N = 100.0  # default rating [MVA]: the base of networks
P_0 = 0.5  # default dispatch [pu, S_n]
USUAL = usual_beside(__file__)


@dataclass(frozen=True)
class _Start:
    """The operating point: voltage [pu], its angle, and the currents of the following branch [pu, S_n]."""

    V: Expr
    angle: Expr
    active: Expr
    reactive: Expr


def regfm_c1_phasor() -> Model:
    """The hybrid inverter of the WECC, phasor type."""
    title = "Hybrid grid-forming inverter REGFM_C1 of the WECC (phasor type)"
    m = phasor_builder("regfm_c1_phasor", title, kind="converter", usual=USUAL)
    port = device_port(m, S_n=S_N, P_0=P_0)
    R = m.parameter("Re", 0.05, "pu", "Virtual resistance", base="S_n", minimum=0, source=SOURCE)
    X = m.parameter("Xe", 0.2, "pu", "Virtual reactance", base="S_n", minimum=0.01, source=SOURCE)
    Z = Phasor(R, X)
    flags = {name: m.switch(name, True, text) for name, text in SWITCHES.items()}
    p = declared(m, LINES, SOURCE) | declared(m, OWN_LINES, CHOSEN)
    start = _start(port)
    delta = m.state("delta", start.angle, "rad", "Angle of the inner voltage in the network frame")
    v = port.v.rotated(-delta)
    P, I_q = m.algebraic("P_forming"), m.algebraic("I_q_forming")
    w = _speed(m, p, flags["FFlag"], P)
    m.derivative(delta, port.omega_b * w)
    E = Phasor(_inner_voltage(m, p, flags["VFlag"], start, (v.magnitude(), I_q)), 0.0)

    lag = declare_seen_lag(m, "T_seen")
    seen = Phasor(
        low_pass(m, "V_seen_re", Expr(v.re), lag, start.V),
        low_pass(m, "V_seen_im", Expr(v.im), lag, 0.0),
    )
    following = _following(m, p, flags["PQFlag"], start, v.magnitude())
    at_voltage = at_angle_of(seen, Phasor(following[0], -following[1]))
    alone = (E - seen) / Z
    share = (alone + at_voltage).magnitude() / p.Imax
    scale = 1 / fmax(1, share)
    # exactly both branches where the limit does not act
    inner = E + Z * alone * (scale - 1) + Z * at_voltage * scale
    forming = (E - v) / Z * port.connected
    s = power_of(v, forming)
    m.close(P, s.re)
    m.close(I_q, s.im / fmax(v.magnitude(), LEAST_VOLTAGE))
    _require_within(m, p, flags["PQFlag"], start)

    at_start = Phasor(start.V, 0.0) + Z * Phasor(start.active, -start.reactive)
    emf = source_emf(m, inner, at_start, delta, port.omega_b * w)
    declare_phasor_outputs(m, port, emf, Z)
    m.output("omega", 1 + w, "pu", "Speed of the virtual machine", base="f_n")
    m.output("E_inner", E.re, "pu", "Inner voltage of the forming branch", base="S_n")
    m.output("P_forming", s.re, "pu", "Active power of the forming branch, unlimited", base="S_n")
    m.output("Q_forming", s.im, "pu", "Reactive power of the forming branch, unlimited", base="S_n")
    for name, current, text in zip("pq", following, ("Active", "Reactive"), strict=True):
        m.output(
            f"I_{name}_following",
            current,
            "pu",
            f"{text} current of the following branch, before the limit of both",
            base="S_n",
        )
    declare_terminal_outputs(m, v, (inner - v) / Z * port.connected, share)
    return m.build()


def _start(port: DevicePort) -> _Start:
    s_0, V = power_of(port.v_0, port.i_0), port.v_0.magnitude()
    return _Start(V, port.v_0.angle(), Expr(s_0.re) / V, Expr(s_0.im) / V)


def _lag(m: ModelBuilder, name: str, u: Expr, T: Expr, initial: Expr | float) -> Expr:
    return low_pass(m, name, u, fmax(T, LEAST_LAG), initial)


def _speed(m: ModelBuilder, p: Given, droops: Expr, P: Expr) -> Expr:
    """Declare the virtual machine; return its speed deviation [pu]."""
    change = m.parameter("delta_wref", 0, "pu", "Change of wref", base="f_n", tunable=True)
    x = m.state("Dw", 0.0, "pu", "Speed deviation of the machine", base="f_n")
    w = clamp(x, p.Dwmin, p.Dwmax)
    reference = _lag(m, "Dw_reference", change, p.Twr, 0.0)
    slow = _lag(m, "Dw_droop", w, p.Twm, 0.0)
    droop = if_else(droops, clamp((reference - slow) / p.mp, p.DPGFMmin, p.DPGFMmax), 0)
    steady = m.state("Dw_steady", 0.0, "pu", "Slow part of the speed deviation", base="f_n")
    m.derivative(steady, p.wD * (w - steady))
    damping = clamp(p.D1 * w + p.D2 * (w - steady), p.DPDmin, p.DPDmax)
    measured = _lag(m, "Pf", P, p.TPf, 0.0)
    rate = (droop - measured - damping) / (2 * p.H)
    m.derivative(x, held_at_limits(x, rate, p.Dwmin, p.Dwmax))
    return w


def _inner_voltage(
    m: ModelBuilder, p: Given, droops: Expr, start: _Start, seen: tuple[Expr, Expr]
) -> Expr:
    """Declare droop and control of the voltage; return the inner voltage [pu].

    ``seen``: size of the terminal voltage [pu], and the branch's reactive current [pu, S_n]."""
    change = m.parameter("delta_Vref", 0, "pu", "Change of Vref", base="bus", tunable=True)
    reference = _lag(m, "Vref_lagged", start.V + change, p.TVr, start.V)
    V = _lag(m, "Vr", seen[0], p.TVr, start.V)
    I_q = _lag(m, "Iqf", seen[1], p.TIf, 0.0)
    error = if_else(droops, (reference - V) / p.mq, 0) - I_q
    x = m.state("x_E", 0.0, "pu", "Integrator of the voltage control", base="S_n")
    m.derivative(x, held_at_limits(x, p.KiE * error, p.DEmin, p.DEmax))
    return _lag(m, "E", reference + clamp(p.KpE * error + x, p.DEmin, p.DEmax), p.TVSM, start.V)


def _following(
    m: ModelBuilder, p: Given, active_first: Expr, start: _Start, V: Expr
) -> tuple[Expr, Expr]:
    """Declare the following branch; return its active and reactive current [pu, S_n]."""
    change_P, change_Q = (
        m.parameter(f"delta_{name}", 0, "pu", f"Change of {name}", base="S_n", tunable=True)
        for name in ("Pref", "Qref")
    )
    measured = _lag(m, "Vf", V, p.TVf, start.V)
    divisor, divisor_0 = fmax(measured, p.Vmin), fmax(start.V, p.Vmin)
    P = start.active * divisor_0 + change_P
    Q = (start.reactive - _support(p, start.V, start)) * divisor_0 + change_Q
    free_p = clamp(P, p.PcmdGFLmin, p.PcmdGFLmax) / divisor
    free_q = clamp(Q, p.QcmdGFLmin, p.QcmdGFLmax) / divisor + _support(p, measured, start)
    return _within(p, active_first, free_p, free_q)


def _support(p: Given, V: Expr, start: _Start) -> Expr:
    """Reactive current of Kqv at a voltage [pu, S_n]."""
    reference = if_else(p.Vref0 > 0, p.Vref0, start.V)
    return p.Kqv * dead_band(reference - V, p.dbVL1, p.dbVH1)


def _within(p: Given, active_first: Expr, active: Expr, reactive: Expr) -> tuple[Expr, Expr]:
    """Return both currents within their limits [pu, S_n]."""
    first = p.Kf * p.Imax
    found = []
    for comes_first, own, other in (
        (active_first, active, reactive),
        (1 - active_first, reactive, active),
    ):
        rest = sqrt(fmax(p.Imax**2 - clamp(other, -first, first) ** 2, FRINGE))
        most = if_else(comes_first, first, rest)
        found.append(clamp(own, -most, most))
    return found[0], found[1]


def _require_within(m: ModelBuilder, p: Given, active_first: Expr, start: _Start) -> None:
    """Refuse an operating point beyond the limits."""
    active, reactive = _within(p, active_first, start.active, start.reactive)
    divisor = fmax(start.V, p.Vmin)
    P = start.active * divisor
    Q = (start.reactive - _support(p, start.V, start)) * divisor
    off_p, off_q = start.active - active, start.reactive - reactive
    for margin, text in (
        (ROUNDING - sqrt(off_p**2 + off_q**2), "more current than Imax and Kf leave"),
        (p.PcmdGFLmax - P, "more active power than PcmdGFLmax"),
        (P - p.PcmdGFLmin, "less active power than PcmdGFLmin"),
        (p.QcmdGFLmax - Q, "more reactive power than QcmdGFLmax"),
        (Q - p.QcmdGFLmin, "less reactive power than QcmdGFLmin"),
    ):
        m.require(
            margin + ROUNDING, f"the power flow asks for {text}: change that, S_n, P_0 or Q_0"
        )

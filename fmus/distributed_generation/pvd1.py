"""PVD1, WECC's small photovoltaic plants behind one bus, phasor type.

    reactive:  Q_ref + |Dqdv|·(V0 − v_c) below V0, + |Dqdv|·(V1 − v_c) above V1, this change within Qmn…Qmx → / v
               v_c = |v − j·Xc·i|
    active:    P_ref + Ddn·(1 − f + |fdbd|) above the dead band, at least 0 → / v
    limits:    I_p² + I_q² ≤ Imax²; Pqflag: active current comes first, else reactive current
    share:     both × what is left between Vt1 and Vt0, Vt2 and Vt3, Ft1 and Ft0, Ft2 and Ft3: from 1 to 0;
               of what was lost, Vrflag comes back with the voltage and Frflag with the frequency
    current:   → 1/(1 + s·Tg); the active one × the straight line from 0 at lvpnt0 to 1 at lvpnt1;
               the reactive one − Khv·(v − Vtmax) above Vtmax, down to Qmin

v is the terminal voltage, f its frequency behind Tf. I_q above 0 feeds reactive power.

Sources: PowerWorld's help on PVD1 and ANDES' PVD1, both after WECC's and Sandia's specification (SAND2013-8876)."""

from dataclasses import dataclass
from functools import partial
from math import pi

from fmus.converter_parts.bus_voltage import (
    LEAST_VOLTAGE,
    ExtrapolatedVoltage,
    extrapolated_voltage,
    frequency_of,
)
from fmus.converter_parts.current_at_angle import emf_of_current, port_of_current
from fmus.distributed_generation.tripping import kept_share
from fmus.synchronous_generator.data_lines import Given, declared, number, power, pu, seconds
from fmus.toolchain.blocks import clamp
from fmus.toolchain.frames import Phasor
from fmus.toolchain.frames import power as power_of
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    declare_master_step,
    declare_phasor_outputs,
    phasor_builder,
)
from fmus.toolchain.port import DevicePort, device_port
from fmus.toolchain.symbols import Expr, fabs, fmax, fmin, if_else, sqrt
from fmus.wecc_renewable.signals import ROUNDING, through_points

S_N = 100.0  # default rating [MVA]: the base of networks
P_0 = 0.8  # default power [pu, S_n]
LEAST_LAG = 1e-3  # of the frequency [s]: no output follows an input at once
LEAST_WIDTH = 1e-4  # of a straight line [pu, Hz], so that a step is one
PER_UNIT = (
    2.0  # frequency of a trip below which its number is per unit, as PowerWorld has it; else Hz
)
FRINGE = 1e-12  # square [pu²] below which no root is taken

SOURCE = "ANDES' PVD1"
LINES = (
    power("Xc", 0.0, "Reactance behind which the voltage is supported", 0),
    power("Qmx", 0.33, "Most reactive power that the voltage adds", 0),
    power("Qmn", -0.33, "Least reactive power that the voltage adds"),
    pu("V0", 0.8, "Voltage below which reactive power is added", 0, base="bus"),
    pu("V1", 1.1, "Voltage above which reactive power is taken off", 0, base="bus"),
    power("Dqdv", -1.0, "Reactive power by voltage; its sign does not matter"),
    power("Ddn", 0.0, "Active power taken off by frequency", 0),
    power("Imax", 1.3, "Most current", 1e-3),
    pu("Vt0", 0.88, "Voltage at which low voltage leaves none", 0, base="bus"),
    pu("Vt1", 0.9, "Voltage below which low voltage takes a share away", 0, base="bus"),
    pu("Vt2", 1.1, "Voltage above which high voltage takes a share away", 0, base="bus"),
    pu("Vt3", 1.2, "Voltage at which high voltage leaves none", 0, base="bus"),
    number("Vrflag", 0.0, "Share of what voltage trips that comes back with it", 0),
    number("Frflag", 0.0, "Share of what frequency trips that comes back with it", 0),
    seconds("Tg", 0.02, "Lag of the current's control", 1e-3),
)
CHOSEN = "chosen here"
OWN_LINES = (
    pu("fdbd", 99.0, "Dead band of f − 1; its sign does not matter", base="f_n"),
    number("Ft0", 47.0, "Frequency at which low frequency leaves none; below 2 per unit", 0, "Hz"),
    number(
        "Ft1",
        47.5,
        "Frequency below which low frequency takes a share away; below 2 per unit",
        0,
        "Hz",
    ),
    number(
        "Ft2",
        51.5,
        "Frequency above which high frequency takes a share away; below 2 per unit",
        0,
        "Hz",
    ),
    number("Ft3", 52.0, "Frequency at which high frequency leaves none; below 2 per unit", 0, "Hz"),
    seconds("Tf", 0.02, "Filter of the frequency; at least 1 ms"),
    pu("Vtmax", 1.2, "Voltage above which reactive current is taken off", 0, base="bus"),
    pu("lvpnt1", 0.8, "Voltage below which the active current falls", 0, base="bus"),
    pu("lvpnt0", 0.4, "Voltage at which no active current is left", 0, base="bus"),
    power("Qmin", -1.3, "Least reactive current above Vtmax"),
    power("Khv", 0.0, "Reactive current taken off by voltage above Vtmax", 0),
)


@dataclass(frozen=True)
class _Seen:
    """Voltage [pu], frequency [pu], and the current that is fed at the voltage's angle [pu, S_n]."""

    v: Expr
    f: Expr
    active: Expr
    reactive: Expr


def pvd1_phasor() -> Model:
    """Small photovoltaic plants by PVD1."""
    title = "Distributed photovoltaic generation of WECC's PVD1 (phasor type)"
    m = phasor_builder("pvd1_phasor", title, kind="converter")
    port = device_port(m, S_n=S_N, P_0=P_0)
    Z = port_of_current(m)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    seen.follow(m, port.v)
    fed = _declare_current(m, port, seen)
    at_start = power_of(port.v_0, port.i_0) / port.v_0.magnitude()
    source = emf_of_current(m, seen, Z, fed, at_start.conjugate(), master)
    declare_phasor_outputs(m, port, source, Z)
    m.output("V", seen.value.magnitude(), "pu", "Voltage magnitude at the terminal", base="bus")
    m.output("I_p_fed", fed.re, "pu", "Active current", base="S_n")
    m.output("I_q_fed", -fed.im, "pu", "Reactive current", base="S_n")
    return m.build()


def _declare_current(m: ModelBuilder, port: DevicePort, seen: ExtrapolatedVoltage) -> Phasor:
    """Declare control, trips and current; return the current at the voltage's angle [pu, S_n]."""
    f_n = port.omega_b / (2 * pi)
    active_first = m.switch("Pqflag", False, "Active current comes first; else reactive current")
    p = declared(m, LINES, SOURCE) | declared(m, OWN_LINES, CHOSEN)
    s_0, v_0 = power_of(port.v_0, port.i_0), port.v_0.magnitude()
    at_start = _Seen(v_0, Expr(1.0), s_0.re / v_0, s_0.im / v_0)
    _require_ordered(m, p)
    _require_within(m, p, at_start, f_n)
    f = frequency_of(m, seen, port.omega_b, fmax(p.Tf, LEAST_LAG))
    points = ((p.lvpnt0, Expr(0.0)), (p.lvpnt1, Expr(1.0)))
    command_0 = at_start.reactive + p.Khv * fmax(v_0 - p.Vtmax, 0)
    active = m.state("I_p", at_start.active, "pu", "Active current behind its lag", base="S_n")
    reactive = m.state("I_q", command_0, "pu", "Reactive current behind its lag", base="S_n")
    v = Expr(seen.value.magnitude())
    lowered = fmax(reactive - p.Khv * fmax(v - p.Vtmax, 0), fmin(p.Qmin, reactive))
    now = _Seen(v, f, active * through_points(v, points), lowered)
    # an extrapolated voltage overshoots at a jump, and what is lost stays lost
    share = _share_left(m, p, seen.once.magnitude(), f * f_n, _trips_in_hertz(p, f_n))
    wanted = _commands(m, p, active_first, now, (at_start, command_0))
    for x, command in zip((active, reactive), wanted, strict=True):
        m.derivative(x, (command * share - x) / p.Tg)
    m.output("share", share, "1", "Share of the generation that trips leave")
    m.output("f", f, "pu", "Frequency that is seen", base="f_n")
    m.output("I_p_command", wanted[0], "pu", "Command of active current", base="S_n")
    m.output("I_q_command", wanted[1], "pu", "Command of reactive current", base="S_n")
    return Phasor(now.active, -now.reactive)


def _commands(
    m: ModelBuilder, p: Given, active_first: Expr, now: _Seen, at_start: tuple[_Seen, Expr]
) -> tuple[Expr, Expr]:
    """Commands of active and of reactive current, before the share that trips leave [pu, S_n].

    ``at_start``: what was seen at the operating point, and the command of reactive current there."""
    start, command_0 = at_start
    change_P, change_Q = (
        m.parameter(f"delta_{name}", 0, "pu", f"Change of {name}", base="S_n", tunable=True)
        for name in ("Pref", "Qref")
    )
    P_0, Q_0 = start.v * start.active, start.v * command_0
    support, support_0 = _support(p, now), _support(p, start)
    taken = p.Ddn * fmax(now.f - 1 - fabs(p.fdbd), 0)
    divisor = fmax(now.v, LEAST_VOLTAGE)
    free_p = fmax(P_0 + change_P - taken, 0) / divisor
    free_q = (Q_0 + change_Q + support - support_0) / divisor
    alone_p, alone_q = fmin(free_p, p.Imax), clamp(free_q, -p.Imax, p.Imax)
    rest_p, rest_q = (sqrt(fmax(p.Imax**2 - used**2, FRINGE)) for used in (alone_q, alone_p))
    most_p = if_else(active_first, p.Imax, rest_p)
    most_q = if_else(active_first, rest_q, p.Imax)
    return fmin(free_p, most_p), clamp(free_q, -most_q, most_q)


def _support(p: Given, at: _Seen) -> Expr:
    """Reactive power that the voltage adds [pu, S_n]."""
    behind = Phasor(at.v, 0.0) - Phasor(0.0, p.Xc) * Phasor(at.active, -at.reactive)
    v = behind.magnitude()
    beyond = fmax(p.V0 - v, 0) + fmin(p.V1 - v, 0)
    return clamp(fabs(p.Dqdv) * beyond, p.Qmn, p.Qmx)


def _trips_in_hertz(p: Given, f_n: Expr) -> tuple[Expr, Expr, Expr, Expr]:
    """Return Ft0 to Ft3 [Hz]."""
    points = (if_else(f < PER_UNIT, f * f_n, f) for f in (p.Ft0, p.Ft1, p.Ft2, p.Ft3))
    none, low, high, all_off = points
    return none, low, high, all_off


def _share_left(
    m: ModelBuilder, p: Given, v: Expr, hertz: Expr, trips: tuple[Expr, Expr, Expr, Expr]
) -> Expr:
    """Declare the memories; return the share that voltage and frequency leave."""
    by_voltage, by_frequency = p.Vrflag, p.Frflag
    Ft0, Ft1, Ft2, Ft3 = trips
    left = Expr(1.0)
    for name, beyond, width, returning in (
        ("low_voltage", p.Vt1 - v, p.Vt1 - p.Vt0, by_voltage),
        ("high_voltage", v - p.Vt2, p.Vt3 - p.Vt2, by_voltage),
        ("low_frequency", Ft1 - hertz, Ft1 - Ft0, by_frequency),
        ("high_frequency", hertz - Ft2, Ft3 - Ft2, by_frequency),
    ):
        lost_now = clamp(beyond / fmax(width, LEAST_WIDTH), 0, 1)
        with m.scope(f"trip_{name}"):
            most = partial(fmax, lost_now)
            left = left * kept_share(m, lost_now, returning, most, acts=lost_now > 0)
    return left


def _require_ordered(m: ModelBuilder, p: Given) -> None:
    """Refuse points of a straight line in the wrong order."""
    for low, high in (
        (p.Vt0, p.Vt1),
        (p.Vt1, p.Vt2),
        (p.Vt2, p.Vt3),
        (p.Ft0, p.Ft1),
        (p.Ft1, p.Ft2),
        (p.Ft2, p.Ft3),
        (p.lvpnt0, p.lvpnt1),
        (p.V0, p.V1),
        (p.Qmn, p.Qmx),
    ):
        m.require(high - low + ROUNDING, f"{high.name()} must not lie below {low.name()}")


def _require_within(m: ModelBuilder, p: Given, at: _Seen, f_n: Expr) -> None:
    """Refuse an operating point beyond a limit, or at which a share is tripped."""
    current = sqrt(at.active**2 + at.reactive**2)
    for margin, text in (
        (at.active, "that it draws power: raise P_0"),
        (p.Imax - current, "more current than Imax at v_0: raise S_n or Imax, or lower P_0 or Q_0"),
        (at.v - p.Vt1, "a voltage below Vt1, where a share is off"),
        (p.Vt2 - at.v, "a voltage above Vt2, where a share is off"),
        (at.v - p.lvpnt1, "a voltage below lvpnt1, where the active current falls"),
    ):
        m.require(margin + ROUNDING, f"the power flow asks for {text}")
    _, Ft1, Ft2, _ = _trips_in_hertz(p, f_n)
    for margin, text in ((f_n - Ft1, "below Ft1"), (Ft2 - f_n, "above Ft2")):
        remedy = "give Ft0 to Ft3 in Hz, or per unit, on both sides of it"
        m.require(margin, f"rated frequency lies {text}, where a share is off: {remedy}")

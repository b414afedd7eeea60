"""MNLEX2 and UEL1: limiters of underexcitation with a circle in the plane of active and reactive power.

MNLEX2:

    e = (Q − Q_0·v²)² + P² − (R·v²)²     (P, Q of the terminal [pu, S_n], v its voltage)
    e − s·K_F2/(1+sT_F2)·V_UEL → K_M/(1+sT_M) = V_UEL, held within 0 and MELMAX

UEL1 (IEEE 421.5), a circle about Q = K_UC·v² with the radius K_UR·v²:

    e = min(|K_UC·v̄ − j·ī|, V_UCMAX) − min(K_UR·v, V_URMAX)
    e → K_UL + K_UI/s, the integral within V_UIMIN and V_UIMAX and the sum too → (1+sT_U1)/(1+sT_U2)
    → (1+sT_U3)/(1+sT_U4) = V_UEL, within V_ULMIN and V_ULMAX; at rest all is at the lower limits

With K_UI > 0 an operating point beyond the circle rests just within it: the edge is moved, and a warning says so.

V_UEL is added to the voltage reference, or lifts the exciter's signal at a gate. UEL1's input of the exciter's rate
feedback, K_UF, is left out. Sources: OpenIPSL's MNLEX2 of October 2024, after PSS/E's manual (GridDyn has the same);
IEEE 421.5 and Dynawo's Uel1 at 289313a, whose integral stops while the sum is at a limit."""

from fmus.synchronous_generator.data_lines import declared, number, power, seconds
from fmus.synchronous_generator.excitation.common import Regulated
from fmus.synchronous_generator.limiters.common import (
    Limited,
    floors_behind,
    moved_edge,
    rate_within_limits,
)
from fmus.toolchain.blocks import BYPASS_TIME, clamp, lead_lag
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, fmin, if_else

SOURCE = "OpenIPSL's test of MNLEX2"
MNLEX2 = (
    number("K_F2", 0.1, "Rate feedback; 0 leaves it out", 0, "s"),
    seconds("T_F2", 1.0, "Lag of the rate feedback", 1e-3),
    number("K_M", 100.0, "Gain", 0),
    seconds("T_M", 0.05, "Lag; 0 leaves it out"),
    power("MELMAX", 0.2, "Largest signal", 0),
    power("Q_0", 1.3, "Centre of the circle: reactive power at 1 pu"),
    power("R", 1.92, "Radius of the circle at 1 pu", 0),
)
UEL1 = (
    power("K_UR", 1.95, "Radius of the circle at 1 pu", 0),
    power("K_UC", 1.38, "Centre of the circle at 1 pu"),
    power("V_URMAX", 5.8, "Largest radius", 0),
    power("V_UCMAX", 5.8, "Largest distance from the centre", 0),
    number("K_UI", 0.0, "Integral gain", 0, "1/s"),
    number("K_UL", 100.0, "Proportional gain", 0),
    power("V_UIMAX", 18.0, "Upper limit of controller and integral"),
    power("V_UIMIN", -18.0, "Lower limit of controller and integral"),
    seconds("T_U1", 0.0, "First lead"),
    seconds("T_U2", 0.05, "First lag; 0 leaves the stage out"),
    seconds("T_U3", 0.0, "Second lead"),
    seconds("T_U4", 0.0, "Second lag; 0 leaves the stage out"),
    power("V_ULMAX", 18.0, "Largest signal"),
    power("V_ULMIN", -18.0, "Least signal"),
)
_IEEE = "IEEE 421.5, sample data"


def mnlex2(m: ModelBuilder, seen: Regulated) -> Limited:
    """Declare the limiter and return its signal to the voltage reference [pu]."""
    p = declared(m, MNLEX2, SOURCE)

    def excess(v: Phasor, i: Phasor) -> Expr:
        S, square = v * i.conjugate(), v.re**2 + v.im**2
        return (S.im - p.Q_0 * square) ** 2 + S.re**2 - (p.R * square) ** 2

    at_start = clamp(p.K_M * excess(seen.v_0, seen.start.i), 0, p.MELMAX)
    x = m.state("limited", at_start, "pu", "Signal of the limiter", base="S_n")
    slow = m.state("feedback", at_start, "pu", "Rate feedback, slow part", base="S_n")
    signal = clamp(x, 0, p.MELMAX)
    m.derivative(slow, (signal - slow) / p.T_F2)
    e = excess(seen.terminal(seen.I_fd), seen.i) - p.K_F2 / p.T_F2 * (signal - slow)
    left_out = p.T_M <= 0
    rate = (p.K_M * e - x) / if_else(left_out, BYPASS_TIME, p.T_M)
    m.derivative(x, rate_within_limits(x, rate, 0, p.MELMAX))
    limited = if_else(left_out, clamp(p.K_M * e, 0, p.MELMAX), signal)
    return Limited(limited, at_start, lambda E_fd: None)


def uel1(m: ModelBuilder, seen: Regulated) -> Limited:
    """Declare the limiter and return its signal to the voltage regulator [pu]."""
    p = declared(m, UEL1, _IEEE)

    def excess(v: Phasor, i: Phasor) -> Expr:
        far = (v * p.K_UC - i.times_j()).magnitude()
        return fmin(far, p.V_UCMAX) - fmin(p.K_UR * v.magnitude(), p.V_URMAX)

    integrates = p.K_UI > 0
    x_0 = if_else(integrates, p.V_UIMIN, 0)
    x = m.state("integrator", x_0, "pu", "Integral of the excess", base="S_n")
    excess_0 = excess(seen.v_0, seen.start.i)
    moved = moved_edge(m, excess_0, integrates)
    e = excess(seen.terminal(seen.I_fd), seen.i) - moved
    within = rate_within_limits(x, p.K_UI * e, p.V_UIMIN, p.V_UIMAX)
    m.derivative(x, if_else(integrates, within, -x / BYPASS_TIME))

    floors = floors_behind(p)

    def controlled(excess: Expr, integral: Expr) -> Expr:
        return clamp(p.K_UL * excess + integral, floors.of(p.V_UIMIN), p.V_UIMAX)

    first = controlled(excess_0 - moved, x_0)
    u = lead_lag(m, "lead_lag_1", controlled(e, x), p.T_U1, p.T_U2, first)
    u = lead_lag(m, "lead_lag_2", u, p.T_U3, p.T_U4, first)
    lowest = floors.of(p.V_ULMIN)
    signal, at_start = clamp(u, lowest, p.V_ULMAX), clamp(first, lowest, p.V_ULMAX)
    least = fmax(p.V_UIMIN, p.V_ULMIN)
    return Limited(signal, at_start, lambda E_fd: None, least)

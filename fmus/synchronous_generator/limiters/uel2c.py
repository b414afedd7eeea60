"""UEL2C (IEEE 421.5-2016) and UEL2 (2005): underexcitation below a polygon in the plane of active and reactive power.

    v/(1+sT_UV) → u       u = v above 1; 1 down to V_bias; v/V_bias below; v for V_bias < 0
    Q_ref = u^k_2·F(P/u^k_1 through 1/(1+sT_UP)), through 1/(1+sT_Qref)
    (Q_ref − Q/(1+sT_UQ))/K → K_UL + K_UI/s, the integral within V_UIMIN and V_UIMAX and the sum too
    → (1+sT_U1)/(1+sT_U2), within V_UELMIN2 and V_UELMAX2 → (1+sT_U3)/(1+sT_U4), within V_UELMIN1 and V_UELMAX1
    = V_UEL, within V_ULMIN and V_ULMAX; at rest all is at the lower limits

F goes through the points (P0, Q0) to (P10, Q10), as far as P rises, and straight on beyond both ends; M = 0 has it
even in P. K is K_fix, or with SW = 2 (v²/X_q + Q)/|v²/X_q + Q + jP| through 1/(1+sT_adj). The inputs K_UF and K_FB of
the exciter's feedback are left out. With K_UI > 0 an operating point below the polygon rests just above it: the edge
is moved, and a warning says so. UEL2 has the voltage for u, Q_ref at once, K = 1, and no limits between the stages.
Sources: IEEE 421.5-2016; the order of the fields and what the flags do as InterPSS
has them (`Uel2cData`, `Uel2cUnderExcitationLimiter`), which it holds against PSS/E. UEL2's equations are those of
OPAL-RT's ephasorsim-modelica-library at cba975b (`UEL2`), the order of its fields too, as PowerWorld's guide has it."""

from dataclasses import dataclass
from itertools import pairwise

from fmus.synchronous_generator.data_lines import Given, declared, number, power, seconds
from fmus.synchronous_generator.excitation.common import Regulated
from fmus.synchronous_generator.limiters.common import (
    Limited,
    floors_behind,
    moved_edge,
    rate_within_limits,
)
from fmus.toolchain.blocks import BYPASS_TIME, clamp, lead_lag, low_pass_or_nothing
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, fmax, if_else, logic_and

POINTS = 11
_CAPABILITY = ((0.0, -0.31), (0.3, -0.31), (0.6, -0.28), (0.9, -0.21), (1.02, 0.0))
"""Points of the polygon [pu, S_n] of a usual capability."""

_ADJUSTABLE = 1.5  # value of SW from which the gain is adjustable: 1 or 2
_SQUARED = 1.5  # power of the bias from which it is squared: 0, 1 or 2
_ONCE = 0.5
_LEAST_GAIN = 1e-3  # divisor [pu] of the error, which a file may have as 0
_LEAST_BIAS = 1e-3  # voltage bias [pu] by which powers are divided

_POLYGON = tuple(
    line
    for k, (P, Q) in enumerate((*_CAPABILITY, *((0.0, 0.0),) * (POINTS - len(_CAPABILITY))))
    for line in (
        power(f"P{k}", P, f"Active power of point {k}"),
        power(f"Q{k}", Q, f"Least reactive power at point {k}"),
    )
)
UEL2C = (
    number("k_1", 2.0, "Power of the bias by which the active power is divided: 0, 1 or 2", 0),
    number("k_2", 2.0, "Power of the bias with which the reactive power goes: 0, 1 or 2", 0),
    number("M", 0.0, "1: the polygon goes on below P = 0; 0: it is even there", 0),
    number("SW", 1.0, "2: the gain is adjustable", 0),
    seconds("T_UV", 0.02, "Lag of the voltage; 0 leaves it out"),
    seconds("T_UP", 0.02, "Lag of the active power; 0 leaves it out"),
    seconds("T_UQ", 0.02, "Lag of the reactive power; 0 leaves it out"),
    number("K_UI", 0.5, "Integral gain", 0, "1/s"),
    number("K_UL", 0.8, "Proportional gain", 0),
    power("V_UIMAX", 0.25, "Upper limit of controller and integral"),
    power("V_UIMIN", 0.0, "Lower limit of controller and integral"),
    seconds("T_U1", 0.0, "First lead"),
    seconds("T_U2", 0.0, "First lag; 0 leaves the stage out"),
    seconds("T_U3", 0.0, "Second lead"),
    seconds("T_U4", 0.0, "Second lag; 0 leaves the stage out"),
    *_POLYGON,
    power("V_ULMAX", 0.25, "Largest signal"),
    power("V_ULMIN", 0.0, "Least signal"),
    number("V_bias", 1.0, "Voltage down to which the bias is 1; below 0 it is the voltage"),
    number("K_fix", 1.0, "Divisor of the error"),
    seconds("T_adj", 3.0, "Lag of the adjustable gain; 0 leaves it out"),
    seconds("T_Qref", 0.0, "Lag of the reference; 0 leaves it out"),
    power("V_UELMAX2", 0.25, "Upper limit behind the first stage"),
    power("V_UELMIN2", 0.0, "Lower limit behind the first stage"),
    power("V_UELMAX1", 0.25, "Upper limit behind the second stage"),
    power("V_UELMIN1", 0.0, "Lower limit behind the second stage"),
    number("X_q", 1.8, "Synchronous reactance of the adjustable gain", 0.01),
)
_OF_2016 = ("SW", "V_bias", "K_fix", "T_adj", "T_Qref", "X_q")
_LIMITS_OF_2016 = ("V_UELMAX2", "V_UELMIN2", "V_UELMAX1", "V_UELMIN1")
UEL2 = tuple(line for line in UEL2C if line.name not in (*_OF_2016, *_LIMITS_OF_2016))
_SOURCE = "a usual capability"


def uel2(m: ModelBuilder, seen: Regulated) -> Limited:
    """Declare UEL2 (IEEE 421.5-2005) and return its signal to the voltage regulator [pu]."""
    p = declared(m, UEL2, _SOURCE)
    at = _Terminal.seen_by(seen)
    v = low_pass_or_nothing(m, "voltage", at.v, p.T_UV, at.v_0)
    bias, bias_0 = (fmax(size, _LEAST_BIAS) for size in (v, at.v_0))
    least, least_0 = _scaled_edge(m, p, at, (bias, bias_0))
    Q = low_pass_or_nothing(m, "reactive", Expr(at.S.im), p.T_UQ, at.S_0.im)
    controlled, controlled_0 = _controlled(m, p, least - Q, least_0 - at.S_0.im)
    first = lead_lag(m, "lead_lag_1", controlled, p.T_U1, p.T_U2, controlled_0)
    second = lead_lag(m, "lead_lag_2", first, p.T_U3, p.T_U4, controlled_0)
    lowest = floors_behind(p).of(p.V_ULMIN)
    signal, at_start = (clamp(x, lowest, p.V_ULMAX) for x in (second, controlled_0))
    return Limited(signal, at_start, lambda E_fd: None, fmax(p.V_UIMIN, p.V_ULMIN))


def uel2c(m: ModelBuilder, seen: Regulated) -> Limited:
    """Declare UEL2C and return its signal to the voltage regulator [pu]."""
    p = declared(m, UEL2C, _SOURCE)
    at = _Terminal.seen_by(seen)
    u_0 = _bias(p, at.v_0)
    u = _bias(p, low_pass_or_nothing(m, "voltage", at.v, p.T_UV, at.v_0))
    wanted, least_0 = _scaled_edge(m, p, at, (u, u_0))
    least = low_pass_or_nothing(m, "reference", wanted, p.T_Qref, least_0)
    Q = low_pass_or_nothing(m, "reactive", Expr(at.S.im), p.T_UQ, at.S_0.im)
    gain_0 = _gain(p, at.v_0, Expr(at.S_0.re), Expr(at.S_0.im))
    adjusted = _gain(p, at.v, Expr(at.S.re), Expr(at.S.im))
    gain = low_pass_or_nothing(m, "gain", adjusted, p.T_adj, gain_0)
    controlled, controlled_0 = _controlled(m, p, (least - Q) / gain, (least_0 - at.S_0.im) / gain_0)
    floors = floors_behind(p)
    low_2, low_1 = floors.of(p.V_UELMIN2), floors.of(p.V_UELMIN1)
    first_0 = clamp(controlled_0, low_2, p.V_UELMAX2)
    second_0 = clamp(first_0, low_1, p.V_UELMAX1)
    staged = lead_lag(m, "lead_lag_1", controlled, p.T_U1, p.T_U2, controlled_0)
    first = clamp(staged, low_2, p.V_UELMAX2)
    staged = lead_lag(m, "lead_lag_2", first, p.T_U3, p.T_U4, first_0)
    second = clamp(staged, low_1, p.V_UELMAX1)
    lowest = fmax(fmax(p.V_UIMIN, p.V_UELMIN2), fmax(p.V_UELMIN1, p.V_ULMIN))
    low = floors.of(p.V_ULMIN)
    signal, at_start = (clamp(x, low, p.V_ULMAX) for x in (second, second_0))
    return Limited(signal, at_start, lambda E_fd: None, lowest)


@dataclass(frozen=True)
class _Terminal:
    """Voltage [pu] and power [pu, S_n] at the terminal, now and at the start."""

    v: Expr
    S: Phasor
    v_0: Expr
    S_0: Phasor

    @classmethod
    def seen_by(cls, seen: Regulated) -> "_Terminal":
        v = seen.terminal(seen.I_fd)
        S, S_0 = v * seen.i.conjugate(), seen.v_0 * seen.start.i.conjugate()
        return cls(v.magnitude(), S, seen.v_0.magnitude(), S_0)


def _scaled_edge(
    m: ModelBuilder, p: Given, at: _Terminal, biases: tuple[Expr, Expr]
) -> tuple[Expr, Expr]:
    """The least reactive power [pu, S_n] by the voltage's bias, now and at the start."""
    bias, bias_0 = biases
    P_0 = at.S_0.re / _raised(bias_0, p.k_1)
    P = low_pass_or_nothing(m, "active", at.S.re / _raised(bias, p.k_1), p.T_UP, P_0)
    return _edge(p, P) * _raised(bias, p.k_2), _edge(p, Expr(P_0)) * _raised(bias_0, p.k_2)


def _controlled(m: ModelBuilder, p: Given, excess: Expr, excess_0: Expr) -> tuple[Expr, Expr]:
    """The excess through K_UL + K_UI/s, now and at the start; the integral rests at its lower limit."""
    integrates = p.K_UI > 0
    x_0 = if_else(integrates, p.V_UIMIN, 0)
    x = m.state("integrator", x_0, "pu", "Integral of the excess", base="S_n")
    moved = moved_edge(m, excess_0, integrates)
    within = rate_within_limits(x, p.K_UI * (excess - moved), p.V_UIMIN, p.V_UIMAX)
    m.derivative(x, if_else(integrates, within, -x / BYPASS_TIME))
    both = ((excess, x), (excess_0, x_0))
    now, start = (p.K_UL * (e - moved) + integral for e, integral in both)
    low = floors_behind(p).of(p.V_UIMIN)
    return clamp(now, low, p.V_UIMAX), clamp(start, low, p.V_UIMAX)


def _bias(p: Given, v: Expr) -> Expr:
    """The voltage bias [pu] at a voltage [pu]."""
    low = v / if_else(p.V_bias > 0, p.V_bias, 1)
    within = if_else(v > 1, v, if_else(v > p.V_bias, 1, low))
    return fmax(if_else(p.V_bias < 0, v, within), _LEAST_BIAS)


def _raised(bias: Expr, exponent: Expr) -> Expr:
    """The bias to a power of 0, 1 or 2."""
    return if_else(exponent > _SQUARED, bias**2, if_else(exponent > _ONCE, bias, 1))


def _edge(p: Given, P: Expr) -> Expr:
    """The least reactive power of the polygon at an active power [pu, S_n]."""
    at = if_else(p.M > _ONCE, P, fabs(P))
    points = [(getattr(p, f"P{k}"), getattr(p, f"Q{k}")) for k in range(POINTS)]
    found, rises = Expr(points[0][1]), Expr(1.0)
    for k, ((P_a, Q_a), (P_b, Q_b)) in enumerate(pairwise(points)):
        rises = if_else(logic_and(rises > _ONCE, P_b > P_a), 1, 0)
        width = if_else(P_b > P_a, P_b - P_a, 1)
        line = Q_a + (Q_b - Q_a) * (at - P_a) / width
        reached = at >= P_a if k else rises > _ONCE
        found = if_else(logic_and(rises > _ONCE, reached), line, found)
    return found


def _gain(p: Given, v: Expr, P: Expr, Q: Expr) -> Expr:
    """The divisor of the error [pu]."""
    along = v**2 / p.X_q + Q
    size = fmax((along**2 + P**2) ** 0.5, _LEAST_GAIN)
    return fmax(if_else(p.SW > _ADJUSTABLE, along / size, p.K_fix), _LEAST_GAIN)

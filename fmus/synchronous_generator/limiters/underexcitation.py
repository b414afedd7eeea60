"""MNLEX2: a limiter of underexcitation with a circle in the plane of active and reactive power.

    e = (Q − Q_0·v²)² + P² − (R·v²)²     (P, Q of the terminal [pu, S_n], v its voltage)
    e − s·K_F2/(1+sT_F2)·V_UEL → K_M/(1+sT_M) = V_UEL, held within 0 and MELMAX

V_UEL is added to the voltage reference. Source: OpenIPSL's MNLEX2 of October 2024, after PSS/E's manual; GridDyn has
the same."""

from fmus.synchronous_generator.data_lines import declared, number, power, seconds
from fmus.synchronous_generator.excitation.common import Regulated
from fmus.synchronous_generator.limiters.common import Limited, rate_within_limits
from fmus.toolchain.blocks import BYPASS_TIME, clamp
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else

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

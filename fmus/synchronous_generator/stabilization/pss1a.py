"""PSS1A with speed as its input; STAB1, and IEEEST with a speed signal and a filter of second order.

w − 1 → 1/(1+sT_6) → K_S·s·T_5/(1+sT_5) → 1/(1 + A_1·s + A_2·s²)
→ (1+sT_1)/(1+sT_2) → (1+sT_3)/(1+sT_4) → V_STMIN ≤ V_S ≤ V_STMAX"""

from fmus.synchronous_generator.stabilization.common import SOURCE, gain, limited_output, stage, time
from fmus.toolchain.blocks import BYPASS_TIME, low_pass_or_nothing, washout
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and, logic_or, sqrt


def pss1a(m: ModelBuilder, delta_omega: Expr, P_e: Expr, P_e_0: Expr) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu]."""
    with m.scope("pss"):
        K_S = gain(m, "K_S", 20.0, "Gain")
        signal = low_pass_or_nothing(m, "transducer", delta_omega, time(m, "T_6", 0.0, "Transducer; 0 leaves it out"))
        T_5 = m.parameter("T_5", 10.0, "s", "Washout", minimum=1e-3, source=SOURCE)
        signal = K_S * washout(m, "washout", signal, T_5)
        signal = _filter(m, signal)
        signal = stage(m, signal, 1, ("T_1", "T_2"), (0.05, 0.02))
        signal = stage(m, signal, 2, ("T_3", "T_4"), (3.0, 5.4))
        return limited_output(m, signal)


def _filter(m: ModelBuilder, u: Expr) -> Expr:
    """1/(1 + A_1·s + A_2·s²); A_2 = 0 leaves one lag, A_1 = 0 as well none."""
    A_1 = m.parameter("A_1", 0.0, "s", "Filter, first order", minimum=0, source=SOURCE)
    A_2 = m.parameter("A_2", 0.0, "1", "Filter, second order [s²]; 0: first order alone", minimum=0, source=SOURCE)
    m.require(if_else(logic_and(A_2 > 0, A_1 <= 0), -1, 1), "pss.A_2 > 0 needs pss.A_1 > 0")
    shortest = m.internal_step / 2
    m.require(
        if_else(logic_or(A_2 > 0, A_1 <= 0), 1, A_1 - shortest), "pss.A_1 must be 0 or exceed half of internal_step"
    )
    m.require(if_else(A_2 <= 0, 1, A_2 / fmax(A_1, 1e-9) - shortest), "pss.A_2/A_1 must exceed half of internal_step")
    second = A_2 > 0
    root = sqrt(if_else(second, A_2, 1))
    x = m.state("filter", 0.0, "pu", "filter", base="S_n")
    y = m.state("filter_rate", 0.0, "pu", "filter, its rate times the square root of A_2", base="S_n")
    first = (u - x) / if_else(A_1 > 0, A_1, BYPASS_TIME)
    m.derivative(x, if_else(second, y / root, first))
    m.derivative(y, if_else(second, (u - x - A_1 * y / root) / root, -y / BYPASS_TIME))
    return if_else(logic_or(second, A_1 > 0), x, u)

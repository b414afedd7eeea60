"""PSS2A and PSS2B: the integral of accelerating power, from speed and electrical power.

    speed  w − 1 → limits → s·T_w1/(1+sT_w1) → s·T_w2/(1+sT_w2) → 1/(1+sT_6)
    power  P_e → limits → s·T_w3/(1+sT_w3) → s·T_w4/(1+sT_w4) → K_s2/(1+sT_7)
    (speed + K_s3·power) → (1+sT_8)/(1+sT_9)^5 → − power → K_s1
    → (1+sT_1)/(1+sT_2) → (1+sT_3)/(1+sT_4) → (1+sT_10)/(1+sT_11) → V_STMIN ≤ V_S ≤ V_STMAX

The limits of the inputs, V_SI1MIN … V_SI2MAX, and the third stage are PSS2B's. The power's limits hold for its change
from the operating point. A block whose time constant is 0 is left out. M = 5 and N = 1 of the ramp-tracking filter."""

from functools import partial

from fmus.synchronous_generator.stabilization.common import gain, limited_output, stage, time
from fmus.synchronous_generator.stabilization.norm631 import RAMP_LAGS
from fmus.toolchain.blocks import clamp, lead_lag, low_pass_or_nothing, washout_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and


def pss2a(m: ModelBuilder, delta_omega: Expr, P_e: Expr, P_e_0: Expr, *, newer: bool = False) -> Expr:
    """Declare the stabiliser and return its signal to the voltage regulator [pu].

    ``newer``: whether it has what PSS2B has beyond PSS2A."""
    with m.scope("pss"):
        speed, power = delta_omega, P_e - P_e_0
        if newer:
            speed = clamp(speed, *_input_limits(m, "1", "speed"))
            power = clamp(power, *_input_limits(m, "2", "power, as its change"))
        speed = washout_or_nothing(m, "washout_1", speed, time(m, "T_w1", 2.0, "First washout of the speed"))
        speed = washout_or_nothing(m, "washout_2", speed, time(m, "T_w2", 2.0, "Second washout of the speed"))
        speed = low_pass_or_nothing(m, "speed", speed, time(m, "T_6", 0.0, "Lag of the speed"))
        power = washout_or_nothing(m, "washout_3", power, time(m, "T_w3", 2.0, "First washout of the power"))
        power = washout_or_nothing(m, "washout_4", power, time(m, "T_w4", 0.0, "Second washout of the power"))
        power = gain(m, "K_s2", 0.2, "Gain of the power, T_7/2H") * low_pass_or_nothing(
            m, "integrator", power, time(m, "T_7", 2.0, "Lag of the power, which integrates it")
        )
        K_s3 = gain(m, "K_s3", 1.0, "Power in the ramp filter")
        signal = _ramp_filter(m, speed + K_s3 * power)
        signal = gain(m, "K_s1", 10.0, "Gain of the stabiliser") * (signal - power)
        signal = stage(m, signal, 1, ("T_1", "T_2"), (0.25, 0.03))
        signal = stage(m, signal, 2, ("T_3", "T_4"), (0.15, 0.015))
        if newer:
            signal = stage(m, signal, 3, ("T_10", "T_11"), (0.0, 0.0))
        return limited_output(m, signal)


pss2b = partial(pss2a, newer=True)
"""PSS2A with limited inputs and a third stage."""


def _input_limits(m: ModelBuilder, number: str, text: str) -> tuple[Expr, Expr]:
    low = m.parameter(f"V_SI{number}MIN", -2.0, "pu", f"Lower limit of the {text}", base="S_n", maximum=0)
    high = m.parameter(f"V_SI{number}MAX", 2.0, "pu", f"Upper limit of the {text}", base="S_n", minimum=0)
    return low, high


def _ramp_filter(m: ModelBuilder, u: Expr) -> Expr:
    T_8 = time(m, "T_8", 0.5, "Ramp-tracking filter, lead")
    T_9 = time(m, "T_9", 0.1, "Ramp-tracking filter, each of its five lags; 0 leaves it out")
    m.require(if_else(logic_and(T_9 <= 0, T_8 > 0), -1, 1), "pss.T_9 = 0 needs pss.T_8 = 0 as well")
    u = lead_lag(m, "ramp_1", u, T_8, T_9)
    for number in range(2, RAMP_LAGS + 1):
        u = low_pass_or_nothing(m, f"ramp_{number}", u, T_9)
    return u

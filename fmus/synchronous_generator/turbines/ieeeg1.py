"""IEEEG1 with limits: a valve that moves at a limited rate, and up to four stages of a steam turbine.

    (w − 1) → K·(1+sT_2)/(1+sT_1) → P_ref − … − P_GV → 1/T_3, U_c ≤ rate ≤ U_o → 1/s = P_GV within P_MIN and P_MAX
    P_GV → 1/(1+sT_4) → 1/(1+sT_5) → 1/(1+sT_6) → 1/(1+sT_7), tapped after each with K_1+K_2, K_3+K_4, K_5+K_6, K_7+K_8

Both shafts of a cross-compound unit drive this one machine: the fractions of a pair add up."""

from fmus.synchronous_generator.turbines.common import SOURCE, power, power_reference, require_within, time
from fmus.toolchain.blocks import clamp, held_at_limits, lead_lag, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and

_STAGES = ("steam_chest", "reheater", "crossover", "last_stage")
_TIMES = (0.3, 7.0, 0.6, 0.0)
_FRACTIONS = (0.3, 0.0, 0.3, 0.0, 0.4, 0.0, 0.0, 0.0)


def ieeeg1(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        K = power(m, "K", 20.0, "Gain, 1/droop", 0)
        T_1, T_2 = time(m, "T_1", 0.0, "Controller, lag; 0 leaves it out"), time(m, "T_2", 0.0, "Controller, lead")
        T_3 = time(m, "T_3", 0.1, "Valve's servo", 1e-3)
        U_o = m.parameter("U_o", 1.0, "pu/s", "Fastest opening of the valve", minimum=1e-6, source=SOURCE)
        U_c = m.parameter("U_c", -10.0, "pu/s", "Fastest closing of the valve", maximum=-1e-6, source=SOURCE)
        high, low = power(m, "P_MAX", 1.0, "Valve, fully open"), power(m, "P_MIN", 0.0, "Valve, closed")
        T = [
            time(m, f"T_{k}", value, f"Stage {k - 3} of the turbine; 0 leaves it out")
            for k, value in enumerate(_TIMES, 4)
        ]
        part = [
            m.parameter(f"K_{k}", value, "1", f"Turbine fraction K_{k}", minimum=0, maximum=1, source=SOURCE)
            for k, value in enumerate(_FRACTIONS, 1)
        ]
        m.require(if_else(logic_and(T_1 <= 0, T_2 > 0), -1, 1), "governor.T_1 = 0 needs governor.T_2 = 0 as well")
        fractions = sum(part, Expr(0))
        m.require(fractions - 1e-3, "governor: at least one turbine fraction K_1 to K_8 must exceed 0")
        valve_0 = P_m_0 / fmax(fractions, 1e-3)
        require_within(m, valve_0, low, high, ("governor.P_MIN", "governor.P_MAX"))
        control = lead_lag(m, "controller", K * (w - 1), T_2, T_1)
        x = m.state("gate", valve_0, "pu", "Valve", base="S_n")
        valve = clamp(x, low, high)
        rate = clamp((power_reference(m, valve_0) - control - valve) / T_3, U_c, U_o)
        m.derivative(x, held_at_limits(x, rate, low, high))
        signal, total = valve, Expr(0)
        for stage, name in enumerate(_STAGES):
            signal = low_pass_or_nothing(m, name, signal, T[stage], valve_0)
            total += (part[2 * stage] + part[2 * stage + 1]) * signal
        return total

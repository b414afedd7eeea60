"""Speed governor and steam turbine IEEEG1 (without rate and valve limits)."""

from fmus.synchronous_generator.data import GovernorData
from fmus.toolchain.blocks import lead_lag, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmin, if_else, logic_and


def ieeeg1(m: ModelBuilder, w: Expr, P_m_0: Expr, data: GovernorData) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n].

    −Δw → (1/R)·(1+sT_2)/(1+sT_1) → + P_ref → 1/(1+sT_3) → 1/(1+sT_4) → 1/(1+sT_5) → 1/(1+sT_6)
    → 1/(1+sT_7), tapped after T_4, T_5, T_6 and T_7 with K_1+K_2, K_3+K_4, K_5+K_6 and K_7+K_8.

    ``w``: rotor speed [pu, f_n]; ``P_m_0``: mechanical power at the operating point [pu, S_n]; ``data``: defaults of
    the parameters."""
    with m.scope("governor"):
        enabled = m.switch(
            "enabled", True, "Governor in service; otherwise the mechanical power is constant"
        )
        gain = m.parameter(
            "inverse_R", data.inverse_droop, "pu", "1/R", base="S_n", minimum=0, source=data.source
        )
        T = [
            m.parameter(
                f"T_{k}",
                value,
                "s",
                f"Time constant T_{k}; 0 leaves its block out",
                minimum=0,
                source=data.source,
            )
            for k, value in enumerate(data.T, start=1)
        ]
        K = [
            m.parameter(
                f"K_{k}",
                value,
                "1",
                f"Turbine fraction K_{k}",
                minimum=0,
                maximum=1,
                source=data.source,
            )
            for k, value in enumerate(data.K, start=1)
        ]
        delta = m.parameter(
            "delta_P_ref", 0.0, "pu", "Change of the power reference", base="S_n", tunable=True
        )
        m.require(
            if_else(logic_and(T[0] <= 0, T[1] > 0), -1, 1),
            "governor.T_1 = 0 needs governor.T_2 = 0 as well",
        )
        fractions = sum(K, Expr(0))
        m.require(
            fractions - 1e-3, "governor: at least one turbine fraction K_1 to K_8 must exceed 0"
        )
        P_ref = m.calculated(
            "P_ref", P_m_0 / fractions, "pu", "Power reference of the operating point", base="S_n"
        )

        signal = lead_lag(m, "controller", -gain * (w - 1), T[0 + 1], T[0])
        signal = low_pass_or_nothing(m, "gate", P_ref + delta + signal, T[2], P_ref)
        power = Expr(0)
        for stage, name in enumerate(("steam_chest", "reheater", "crossover", "last_stage")):
            signal = low_pass_or_nothing(m, name, signal, T[3 + stage], P_ref)
            power += (K[2 * stage] + K[2 * stage + 1]) * signal
        m.require(
            _positive_or_zero(T, m.internal_step),
            "governor: a time constant must be 0 or longer than internal_step",
        )
        return if_else(enabled, power, P_m_0)


def _positive_or_zero(T: list[Expr], shortest: Expr) -> Expr:
    worst = Expr(1)
    for value in T:
        worst = fmin(worst, if_else(value <= 0, 1, value - shortest))
    return worst

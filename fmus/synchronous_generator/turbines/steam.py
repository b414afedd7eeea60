"""IEESGO: a governor and steam turbine with a reheater, without a limit of the valve's speed.

    (w − 1) → K_1·(1+sT_2)/((1+sT_1)·(1+sT_3)) → P_ref − … , held within P_MIN and P_MAX → 1/(1+sT_4) = chest
    P_m = (1 − K_2)·chest + K_2·(1 − K_3)·reheated + K_2·K_3·low,
    reheated = chest/(1+sT_5),  low = reheated/(1+sT_6)

Sources: OpenIPSL at 2be0558a, ANDES 2.0.0."""

from fmus.synchronous_generator.data_lines import declared, number, power, seconds
from fmus.synchronous_generator.turbines.governors import SOURCE, power_reference, require_within
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import clamp, lead_lag, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

IEESGO = (
    seconds("T_1", 0.2, "Controller, lag; 0 leaves it out"),
    seconds("T_2", 0.0, "Controller, lead"),
    seconds("T_3", 0.5, "Governor, lag; 0 leaves the stage out"),
    seconds("T_4", 0.12, "Steam chest; 0 leaves it out"),
    seconds("T_5", 5.0, "Reheater; 0 leaves it out"),
    seconds("T_6", 0.5, "Crossover; 0 leaves it out"),
    power("K_1", 20.0, "Gain, 1/droop", 0),
    number("K_2", 0.59, "Part behind the reheater", 0),
    number("K_3", 0.43, "Of that, part behind the crossover", 0),
    power("P_MAX", 0.98, "Highest power"),
    power("P_MIN", 0.0, "Lowest power"),
)


def ieesgo(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p, P_0 = declared(m, IEESGO, SOURCE), shaft.P_m_0
        m.require(
            if_else(logic_and(p.T_3 <= 0, p.T_2 > 0), -1, 1),
            "governor.T_3 = 0 needs governor.T_2 = 0 as well",
        )
        require_within(m, P_0, p.P_MIN, p.P_MAX, ("governor.P_MIN", "governor.P_MAX"))
        slow = low_pass_or_nothing(m, "controller", p.K_1 * (shaft.w - 1), p.T_1)
        control = lead_lag(m, "governor", slow, p.T_2, p.T_3)
        valve = clamp(power_reference(m, P_0) - control, p.P_MIN, p.P_MAX)
        chest = low_pass_or_nothing(m, "steam_chest", valve, p.T_4, P_0)
        reheated = low_pass_or_nothing(m, "reheater", chest, p.T_5, P_0)
        low = low_pass_or_nothing(m, "crossover", reheated, p.T_6, P_0)
        return (1 - p.K_2) * chest + p.K_2 * (1 - p.K_3) * reheated + p.K_2 * p.K_3 * low

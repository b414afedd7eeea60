"""IEESGO and TGOV3: governors and steam turbines with a reheater.

IEESGO has no limit of the valve's speed:

    (w − 1) → K_1·(1+sT_2)/((1+sT_1)·(1+sT_3)) → P_ref − … , held within P_MIN and P_MAX → 1/(1+sT_4) = chest
    P_m = (1 − K_2)·chest + K_2·(1 − K_3)·reheated + K_2·K_3·low,
    reheated = chest/(1+sT_5),  low = reheated/(1+sT_6)

TGOV3 has the governor of IEEEG1, and a reheater whose pressure stops at P_RMAX:

    (w − 1) → K·(1+sT_2)/(1+sT_1) → P_ref − … − valve → 1/T_3, within U_c and U_o → 1/s = valve within P_MIN and P_MAX
    valve → 1/(1+sT_4) = chest → 1/(1+sT_5) = reheated, at most P_RMAX → 1/(1+sT_6) = low
    P_m = K_1·chest + K_2·reheated + K_3·low

Its intercept valve is open: fast valving (TA, TB, TC) starts by a command from outside, which gfor does not give.

Sources: OpenIPSL at 2be0558a and ANDES 2.0.0 (IEESGO); OPAL-RT's modelica-ephasor-components at 6dc8ca5 and InterPSS
(TGOV3)."""

from fmus.synchronous_generator.data_lines import Line, declared, number, power, seconds
from fmus.synchronous_generator.turbines.governors import (
    SOURCE,
    power_reference,
    require_within,
    servo,
)
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import clamp, lead_lag, limited_low_pass, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and

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
TGOV3 = (
    power("K", 20.0, "Gain, 1/droop", 0),
    seconds("T_1", 0.0, "Controller, lag; 0 leaves it out"),
    seconds("T_2", 0.0, "Controller, lead"),
    seconds("T_3", 0.1, "Valve's servo", 1e-3),
    number("U_o", 0.3, "Fastest opening of the valve", 1e-6, "pu/s"),
    Line("U_c", -0.3, "Fastest closing of the valve", maximum=-1e-6, unit="pu/s"),
    power("P_MAX", 1.0, "Valve, fully open"),
    power("P_MIN", 0.0, "Valve, closed"),
    seconds("T_4", 0.3, "Steam chest; 0 leaves it out"),
    number("K_1", 0.3, "Part before the reheater", 0),
    seconds("T_5", 7.0, "Reheater; 0 leaves it out"),
    number("K_2", 0.3, "Part between reheater and crossover", 0),
    seconds("T_6", 0.6, "Crossover; 0 leaves it out"),
    number("K_3", 0.4, "Part behind the crossover", 0),
    power("P_RMAX", 1.2, "Highest pressure of the reheater", 1e-3),
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


def tgov3(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p, P_0 = declared(m, TGOV3, SOURCE), shaft.P_m_0
        m.require(
            if_else(logic_and(p.T_1 <= 0, p.T_2 > 0), -1, 1),
            "governor.T_1 = 0 needs governor.T_2 = 0 as well",
        )
        whole = p.K_1 + p.K_2 + p.K_3
        m.require(whole - 1e-3, "governor: one of K_1, K_2 and K_3 must exceed 0")
        valve_0 = P_0 / fmax(whole, 1e-3)
        require_within(m, valve_0, p.P_MIN, p.P_MAX, ("governor.P_MIN", "governor.P_MAX"))
        require_within(m, valve_0, -p.P_RMAX, p.P_RMAX, ("governor.P_RMAX", "governor.P_RMAX"))
        control = lead_lag(m, "controller", p.K * (shaft.w - 1), p.T_2, p.T_1)
        wanted = power_reference(m, valve_0) - control
        valve = servo(m, wanted, p.T_3, (p.U_c, p.U_o), (p.P_MIN, p.P_MAX), valve_0)
        chest = low_pass_or_nothing(m, "steam_chest", valve, p.T_4, valve_0)
        none = -p.P_RMAX  # a pressure has no lower limit; the valve's keeps it above this
        reheated = limited_low_pass(m, "reheater", chest, p.T_5, none, p.P_RMAX, initial=valve_0)
        low = low_pass_or_nothing(m, "crossover", reheated, p.T_6, valve_0)
        return p.K_1 * chest + p.K_2 * reheated + p.K_3 * low

"""IEEEG1, WSIEG1, IEESGO and TGOV3: governors and steam turbines with a reheater.

IEEEG1 has limits, a valve that moves at a limited rate, and up to four stages of a steam turbine; both shafts of a
cross-compound unit drive this one machine, so the fractions of a pair add up:

    (w − 1) → K·(1+sT_2)/(1+sT_1) → P_ref − … − P_GV → 1/T_3, U_c ≤ rate ≤ U_o → 1/s = P_GV within P_MIN and P_MAX
    P_GV → 1/(1+sT_4) → 1/(1+sT_5) → 1/(1+sT_6) → 1/(1+sT_7), tapped after each with K_1+K_2, K_3+K_4, K_5+K_6, K_7+K_8

WSIEG1 is WECC's IEEEG1: the controller sees of the speed what exceeds ± db_1, and the steam is a curve of the valve:

    P_GV → steam (points GV, PGV; all 0: as the valve) → 1/(1+sT_4) → …

With I_block = 1 or 3 a P_MIN of 0, with 2 or 3 a P_MAX of 0 is the valve of the operating point. The hysteresis of its
dead band (err) and the backlash of its valve (db_2) are left out.

IEESGO has no limit of the valve's speed:

    (w − 1) → K_1·(1+sT_2)/((1+sT_1)·(1+sT_3)) → P_ref − … , held within P_MIN and P_MAX → 1/(1+sT_4) = chest
    P_m = (1 − K_2)·chest + K_2·(1 − K_3)·reheated + K_2·K_3·low,
    reheated = chest/(1+sT_5),  low = reheated/(1+sT_6)

TGOV3 has the governor of IEEEG1, and a reheater whose pressure stops at P_RMAX:

    (w − 1) → K·(1+sT_2)/(1+sT_1) → P_ref − … − valve → 1/T_3, within U_c and U_o → 1/s = valve within P_MIN and P_MAX
    valve → 1/(1+sT_4) = chest → 1/(1+sT_5) = reheated, at most P_RMAX → 1/(1+sT_6) = low
    P_m = K_1·chest + K_2·reheated + K_3·low

Its intercept valve is open: fast valving (TA, TB, TC) starts by a command from outside, which gfor does not give.

Sources: OpenIPSL at 2be0558a (IEESGO, WSIEG1) and ANDES 2.0.0 (IEESGO); OPAL-RT's modelica-ephasor-components at
6dc8ca5 (WSIEG1, TGOV3), GridPACK at bea5ce1a (WSIEG1) and InterPSS (TGOV3)."""

from fmus.synchronous_generator.data_lines import Given, Line, declared, number, power, seconds
from fmus.synchronous_generator.turbines.curves import Point, beyond, curve_of_gate, through_points
from fmus.synchronous_generator.turbines.governors import (
    SOURCE,
    power_reference,
    require_within,
    servo,
)
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import clamp, lead_lag, limited_low_pass, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and, logic_or

_STAGES = ("steam_chest", "reheater", "crossover", "last_stage")
_TIMES = (0.3, 7.0, 0.6, 0.0)
_FRACTIONS = (0.3, 0.0, 0.3, 0.0, 0.4, 0.0, 0.0, 0.0)
_POINTS = range(1, 6)  # numbers of the points of WSIEG1's curve

IEEEG1 = (
    power("K", 20.0, "Gain, 1/droop", 0),
    seconds("T_1", 0.0, "Controller, lag; 0 leaves it out"),
    seconds("T_2", 0.0, "Controller, lead"),
    seconds("T_3", 0.1, "Valve's servo", 1e-3),
    number("U_o", 1.0, "Fastest opening of the valve", 1e-6, "pu/s"),
    Line("U_c", -10.0, "Fastest closing of the valve", maximum=-1e-6, unit="pu/s"),
    power("P_MAX", 1.0, "Valve, fully open"),
    power("P_MIN", 0.0, "Valve, closed"),
    *(
        seconds(f"T_{k}", value, f"Stage {k - 3} of the turbine; 0 leaves it out")
        for k, value in enumerate(_TIMES, 4)
    ),
    *(
        Line(f"K_{k}", value, f"Turbine fraction K_{k}", minimum=0, maximum=1, unit="1")
        for k, value in enumerate(_FRACTIONS, 1)
    ),
)
WSIEG1 = (
    *IEEEG1,
    power("db_1", 0.0, "Dead band of the speed", 0),
    *(number(f"GV_{k}", 0.0, f"Valve of point {k}") for k in _POINTS),
    *(number(f"PGV_{k}", 0.0, f"Steam of point {k}") for k in _POINTS),
    Line("I_block", 0.0, "Limits of 0 that the operating point sets", 0, 3, unit="1"),
)
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


def ieeeg1(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p = declared(m, IEEEG1, SOURCE)
        valve_0 = _steam_at_start(m, p, shaft.P_m_0)
        valve = _valve(m, p, shaft.w - 1, (p.P_MIN, p.P_MAX), valve_0)
        return _turbine(m, p, valve, valve_0)


def wsieg1(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p = declared(m, WSIEG1, SOURCE)
        points: list[Point] = [(getattr(p, f"GV_{k}"), getattr(p, f"PGV_{k}")) for k in _POINTS]
        steam_0 = _steam_at_start(m, p, shaft.P_m_0)
        is_curve, low, high = curve_of_gate(m, points, (steam_0, steam_0))
        require_within(m, steam_0, low, high, ("governor.PGV_1", "governor.PGV_5"))
        inverse = through_points(steam_0, [(y, x) for x, y in points])
        valve_0 = if_else(is_curve, inverse, steam_0)
        valve = _valve(m, p, beyond(shaft.w - 1, p.db_1), _blocked(p, valve_0), valve_0)
        steam = if_else(is_curve, through_points(valve, points), valve)
        return _turbine(m, p, steam, steam_0)


def _steam_at_start(m: ModelBuilder, p: Given, P_0: Expr) -> Expr:
    """Steam into the first stage at the operating point [pu, S_n]."""
    whole = sum((getattr(p, f"K_{k}") for k, _ in enumerate(_FRACTIONS, 1)), Expr(0))
    m.require(whole - 1e-3, "governor: at least one turbine fraction K_1 to K_8 must exceed 0")
    return P_0 / fmax(whole, 1e-3)


def _blocked(p: Given, valve_0: Expr) -> tuple[Expr, Expr]:
    """The valve's limits; one of 0 is where the valve starts, as I_block says."""
    of_low, of_high = p.I_block == 1, p.I_block == 2
    of_both = p.I_block == 3
    is_low_set = logic_and(logic_or(of_low, of_both), p.P_MIN == 0)
    is_high_set = logic_and(logic_or(of_high, of_both), p.P_MAX == 0)
    return if_else(is_low_set, valve_0, p.P_MIN), if_else(is_high_set, valve_0, p.P_MAX)


def _valve(
    m: ModelBuilder, p: Given, speed: Expr, limits: tuple[Expr, Expr], valve_0: Expr
) -> Expr:
    """The valve that follows the speed through the controller."""
    m.require(
        if_else(logic_and(p.T_1 <= 0, p.T_2 > 0), -1, 1),
        "governor.T_1 = 0 needs governor.T_2 = 0 as well",
    )
    require_within(m, valve_0, *limits, ("governor.P_MIN", "governor.P_MAX"))
    control = lead_lag(m, "controller", p.K * speed, p.T_2, p.T_1)
    wanted = power_reference(m, valve_0) - control
    return servo(m, wanted, p.T_3, (p.U_c, p.U_o), limits, valve_0)


def _turbine(m: ModelBuilder, p: Given, steam: Expr, steam_0: Expr) -> Expr:
    """The power of four stages in a row, of both shafts."""
    total = Expr(0)
    for stage, name in enumerate(_STAGES):
        steam = low_pass_or_nothing(m, name, steam, getattr(p, f"T_{stage + 4}"), steam_0)
        first = 2 * stage + 1
        total += (getattr(p, f"K_{first}") + getattr(p, f"K_{first + 1}")) * steam
    return total


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

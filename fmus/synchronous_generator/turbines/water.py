"""IEEEG2, IEEEG3 and HYGOV2: governors of water turbines, the water linear at the operating point.

IEEEG2 has a lead and two lags, and a limit that does not hold the lags:

    P_ref − K·(1+sT_2)/((1+sT_1)·(1+sT_3))·(w − 1), within P_MIN and P_MAX → (1−sT_4)/(1+sT_4/2) = P_m

IEEEG3 has a pilot valve, a gate, and a permanent and a transient droop:

    σ·P_ref/a_23 − (w − 1) − σ·g − δ·sT_R/(1+sT_R)·g → 1/(T_G·(1+sT_P)), within U_c and U_o → 1/s = g
    g within P_MIN and P_MAX
    P_m = a_23·(1+(a_11 − a_13·a_21/a_23)·sT_W)/(1+a_11·sT_W)·g

HYGOV2 has a PI controller of the speed before the gate's own:

    R·P_ref/P_MAX − (K_P + K_I/s)·(w − 1) − R·g − r·sT_R/(1+sT_R)·g → K_A·(1+sT_1)/(sT_3) → (1+sT_2)/(1+sT_4),
    within ± V_GMAX → 1/s = g within G_MIN and G_MAX → P_MAX·(1−sT_5)/(1+sT_6) = P_m

Its two integrals before the gate do not stop at the gate's limits, as its diagram has it.

Sources: OpenIPSL at 2be0558a (IEEEG2), OPAL-RT's modelica-ephasor-components at 6dc8ca5 (IEEEG2, IEEEG3), InterPSS
(HYGOV2D, which adds a dead band to HYGOV2)."""

from fmus.synchronous_generator.data_lines import Line, declared, number, power, seconds
from fmus.synchronous_generator.turbines.curves import integral
from fmus.synchronous_generator.turbines.governors import SOURCE, power_reference, require_within
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import (
    clamp,
    held_at_limits,
    lead_lag,
    limited_low_pass,
    low_pass,
    low_pass_or_nothing,
    washout,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

IEEEG2 = (
    power("K", 20.0, "Gain, 1/droop", 0),
    seconds("T_1", 50.0, "Governor, lag; 0 leaves it out"),
    seconds("T_2", 5.0, "Governor, lead"),
    seconds("T_3", 1.0, "Gate, lag; 0 leaves it out"),
    power("P_MAX", 1.0, "Highest power"),
    power("P_MIN", 0.0, "Lowest power"),
    seconds("T_4", 1.5, "Water's starting time; 0 leaves the water out"),
)
IEEEG3 = (
    seconds("T_G", 0.5, "Gate's servo", 1e-3),
    seconds("T_P", 0.04, "Pilot valve; 0 leaves its lag out"),
    number("U_o", 0.15, "Fastest opening of the gate", 1e-6, "pu/s"),
    Line("U_c", -0.15, "Fastest closing of the gate", maximum=-1e-6, unit="pu/s"),
    power("P_MAX", 1.0, "Gate, fully open"),
    power("P_MIN", 0.0, "Gate, closed"),
    number("sigma", 0.05, "Permanent droop", 0),
    number("delta", 0.35, "Transient droop", 0),
    seconds("T_R", 6.0, "Reset of the transient droop", 1e-3),
    seconds("T_W", 1.0, "Water's starting time; 0 leaves the water out"),
    number("a_11", 0.5, "Flow by head", 1e-3),
    number("a_13", 1.0, "Flow by gate"),
    number("a_21", 1.5, "Torque by head"),
    number("a_23", 1.0, "Torque by gate", 1e-3),
)
HYGOV2 = (
    number("K_P", 1.0, "Proportional gain of the speed", 0),
    number("K_I", 0.1, "Integral gain of the speed", 0, "1/s"),
    number("K_A", 5.0, "Gain of the gate's controller", 1e-6),
    seconds("T_1", 1.0, "Gate's controller, first lead"),
    seconds("T_2", 0.0, "Gate's controller, second lead"),
    seconds("T_3", 1.0, "Gate's controller, integral", 1e-3),
    seconds("T_4", 0.05, "Gate's controller, lag", 1e-3),
    seconds("T_5", 1.0, "Water, lead"),
    seconds("T_6", 0.5, "Water, lag", 1e-3),
    seconds("T_R", 5.0, "Reset of the temporary droop", 1e-3),
    number("r", 0.4, "Temporary droop", 0),
    number("R", 0.05, "Permanent droop", 0),
    number("V_GMAX", 0.2, "Fastest movement of the gate", 1e-6, "pu/s"),
    power("G_MAX", 1.0, "Gate, fully open"),
    power("G_MIN", 0.0, "Gate, closed"),
    power("P_MAX", 1.0, "Power at a gate of 1", 1e-3),
)


def ieeeg2(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p, P_0 = declared(m, IEEEG2, SOURCE), shaft.P_m_0
        m.require(
            if_else(logic_and(p.T_1 <= 0, p.T_2 > 0), -1, 1),
            "governor.T_1 = 0 needs governor.T_2 = 0 as well",
        )
        require_within(m, P_0, p.P_MIN, p.P_MAX, ("governor.P_MIN", "governor.P_MAX"))
        control = lead_lag(m, "controller", p.K * (shaft.w - 1), p.T_2, p.T_1)
        slow = low_pass_or_nothing(m, "gate", control, p.T_3)
        gate = clamp(power_reference(m, P_0) - slow, p.P_MIN, p.P_MAX)
        return lead_lag(m, "water", gate, -p.T_4, p.T_4 / 2, P_0)


def ieeeg3(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p, P_0 = declared(m, IEEEG3, SOURCE), shaft.P_m_0
        g_0 = P_0 / p.a_23
        require_within(m, g_0, p.P_MIN, p.P_MAX, ("governor.P_MIN", "governor.P_MAX"))
        x = m.state("gate", g_0, "pu", "Gate", base="S_n")
        gate = clamp(x, p.P_MIN, p.P_MAX)
        droop = p.sigma * gate + p.delta * washout(m, "transient_droop", gate, p.T_R, g_0)
        wanted = p.sigma * power_reference(m, P_0) / p.a_23 - (shaft.w - 1)
        rate = limited_low_pass(m, "pilot", (wanted - droop) / p.T_G, p.T_P, p.U_c, p.U_o)
        m.derivative(x, held_at_limits(x, rate, p.P_MIN, p.P_MAX))
        lead = p.a_11 - p.a_13 * p.a_21 / p.a_23
        return p.a_23 * lead_lag(m, "water", gate, lead * p.T_W, p.a_11 * p.T_W, g_0)


def hygov2(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p, P_0 = declared(m, HYGOV2, SOURCE), shaft.P_m_0
        g_0, speed = P_0 / p.P_MAX, shaft.w - 1
        require_within(m, g_0, p.G_MIN, p.G_MAX, ("governor.G_MIN", "governor.G_MAX"))
        x = m.state("gate", g_0, "pu", "Gate", base="S_n")
        gate = clamp(x, p.G_MIN, p.G_MAX)
        droop = p.R * gate + p.r * washout(m, "temporary_droop", gate, p.T_R, g_0)
        asked = p.K_P * speed + integral(m, "speed", speed, p.K_I, 0.0)
        error = p.R * power_reference(m, P_0) / p.P_MAX - asked - droop
        z = m.state("controller", 0.0, "pu", "Gate's controller, integral", base="S_n")
        m.derivative(z, p.K_A / p.T_3 * error)
        control = lead_lag(m, "lead", z + p.K_A * p.T_1 / p.T_3 * error, p.T_2, p.T_4)
        rate = clamp(control, -p.V_GMAX, p.V_GMAX)
        m.derivative(x, held_at_limits(x, rate, p.G_MIN, p.G_MAX))
        lagged = low_pass(m, "water", gate, p.T_6, g_0)
        return p.P_MAX * (lagged - p.T_5 / p.T_6 * (gate - lagged))

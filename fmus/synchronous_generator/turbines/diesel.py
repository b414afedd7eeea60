"""DEGOV and DEGOV1: a governor of a diesel engine.

    −(w − 1) → (1+sT_3)/(1+sT_1+s²T_1·T_2) → K·(1+sT_4)/(s·(1+sT_5)) → 1/(1+sT_6), held within T_MIN and T_MAX
    → delay T_D → times w = P_m

DEGOV holds the speed without a droop. DEGOV1 adds R·(P_ref − feedback) to the error: the actuator's output, or with
power_droop the electrical power through 1/(1+sT_E). The delay is Padé's of second order.

Sources: OpenIPSL at 2be0558a (DEGOV), PowerSimulationsDynamics.jl at d94d74e (both)."""

from fmus.synchronous_generator.data_lines import declared, number, power, seconds
from fmus.synchronous_generator.turbines.governors import (
    LONGEST_DELAY,
    SOURCE,
    power_reference,
    require_within,
)
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import (
    lead_lag,
    limited_low_pass,
    low_pass_or_nothing,
    second_order,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

DEGOV = (
    seconds("T_1", 0.2, "Electric control box, first lag; 0 leaves it out"),
    seconds("T_2", 0.05, "Electric control box, second lag, with T_1"),
    seconds("T_3", 0.02, "Electric control box, lead"),
    number("K", 15.0, "Gain of the actuator's integral", 1e-3, "1/s"),
    seconds("T_4", 1.0, "Actuator, lead"),
    seconds("T_5", 0.1, "Actuator, lag; 0 leaves the stage out"),
    seconds("T_6", 0.2, "Actuator, last lag; 0 leaves it out"),
    seconds("T_D", 0.01, "Delay of the engine; 0 leaves it out"),
    power("T_MAX", 1.1, "Highest torque"),
    power("T_MIN", 0.0, "Lowest torque"),
)
DROOP = (
    power("R", 0.05, "Droop", 0),
    seconds("T_E", 0.1, "Measurement of the electrical power; 0 leaves it out"),
)


def degov(m: ModelBuilder, shaft: Shaft, *, droop: bool = False) -> Expr:
    """Declare governor and engine and return the mechanical power [pu, S_n].

    ``droop``: whether the error has a droop (DEGOV1)."""
    with m.scope("governor"):
        p, P_0 = declared(m, DEGOV, SOURCE), shaft.P_m_0
        for lead, lag in (("T_3", "T_1"), ("T_4", "T_5")):
            needs = logic_and(getattr(p, lag) <= 0, getattr(p, lead) > 0)
            m.require(if_else(needs, -1, 1), f"governor.{lag} = 0 needs governor.{lead} = 0 too")
        m.require(LONGEST_DELAY - p.T_D, f"governor.T_D must be below {LONGEST_DELAY:g} s")
        require_within(m, P_0, p.T_MIN, p.T_MAX, ("governor.T_MIN", "governor.T_MAX"))
        x = m.state("integral", P_0, "pu", "Integral of the actuator", base="S_n")
        actuated = lead_lag(m, "actuator", x, p.T_4, p.T_5, P_0)
        torque = limited_low_pass(m, "torque", actuated, p.T_6, p.T_MIN, p.T_MAX, initial=P_0)
        error = 1 - shaft.w
        if droop:
            given = declared(m, DROOP, SOURCE)
            by_power = m.switch("power_droop", False, "The droop is of the electrical power")
            measured = low_pass_or_nothing(m, "power", shaft.P_e, given.T_E, shaft.P_e_0)
            feedback = if_else(by_power, measured - shaft.P_e_0, torque - P_0)
            error += given.R * (power_reference(m, P_0) - P_0 - feedback)
        box = second_order(m, "box", error, (p.T_1, p.T_1 * p.T_2), (p.T_3, Expr(0)))
        m.derivative(x, p.K * box)
        delay = p.T_D / 2, p.T_D**2 / 12
        late = P_0 + second_order(m, "engine", torque - P_0, delay, (-delay[0], delay[1]))
        return late * shaft.w


def degov1(m: ModelBuilder, shaft: Shaft) -> Expr:
    """`degov` with a droop."""
    return degov(m, shaft, droop=True)

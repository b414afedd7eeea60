"""GGOV1: a general governor with a gas turbine, an aeroderivative or an engine.

A PID controller of the speed and a limiter of the load, by the exhaust's temperature, ask for fuel; the lower wins:

    P_ref + load controller − (w − 1) − R·feedback → dead band db → within minerr and maxerr
    → K_pgov + K_igov/s + s·K_dgov/(1+sT_dgov)
    ld_ref/K_turb + w_fnl − exhaust → K_pload + K_iload/s, at most 1
    fsr = lower of both, within V_MIN and V_MAX
    T_act·dvalve/dt = fsr − valve, within R_close and R_open
    fuel = valve, times w with fuel_by_speed → delay T_eng
    P_m = (1+sT_c)/(1+sT_b) of K_turb·(fuel − w_fnl), less D_m·(w − 1) with D_m > 0
    exhaust = 1/(1+sT_fload)·(1+sT_sa)/(1+sT_sb) of fuel, times w^D_m with D_m < 0
    load controller = K_imw/s of (P_e0 − P_e), within ± 1.1·R

Feedback (R_select) is the electrical power through 1/(1+sT_pelec) (1), the valve (−1) or none (0). An integrator stops
while its controller asks for more than it gets. Where the operating point lies at ld_ref or above, or asks for a fuel
of 1 or more, the limiter holds a load or a fuel just above it instead, so that the turbine starts in steady state and
gives no more. Powers are on T_rate, or on
S_n where that is 0; the delay is Padé's of second order. A moved reference arrives at R_up and R_down per second at
most. The limiter of the acceleration (a_set, K_a, T_a) is left out: it acts while the speed gains more than a_set per
second.

Sources: IEEE PES-TR1, OpenIPSL at 2be0558a."""

from fmus.synchronous_generator.data_lines import Given, declared, number, power, seconds
from fmus.synchronous_generator.turbines.curves import beyond
from fmus.synchronous_generator.turbines.governors import (
    LONGEST_DELAY,
    SOURCE,
    power_reference,
    require_within,
)
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    clamp,
    held_at_limits,
    lead_lag,
    low_pass_or_nothing,
    second_order,
    washout,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import (
    Expr,
    exp,
    fabs,
    fmax,
    fmin,
    if_else,
    log,
    logic_and,
    logic_or,
)

GGOV1 = (
    number("R_select", 1, "Feedback of the droop: 1 electrical power, -1 valve, 0 none"),
    power("R", 0.04, "Droop", 0),
    seconds("T_pelec", 1.0, "Measurement of the electrical power; 0 leaves it out"),
    power("max_err", 0.05, "Upper limit of the speed's error"),
    power("min_err", -0.05, "Lower limit of the speed's error"),
    number("K_pgov", 10.0, "Proportional gain", 0),
    number("K_igov", 2.0, "Integral gain", 0, "1/s"),
    number("K_dgov", 0.0, "Derivative gain", 0, "s"),
    seconds("T_dgov", 1.0, "Lag of the derivative", 1e-3),
    power("V_MAX", 1.0, "Valve, fully open"),
    power("V_MIN", 0.15, "Valve, closed"),
    seconds("T_act", 0.5, "Actuator", 1e-3),
    number("K_turb", 1.5, "Gain of the turbine", 1e-3),
    power("w_fnl", 0.2, "Fuel at no load"),
    seconds("T_b", 0.1, "Turbine, lag; 0 leaves the stage out"),
    seconds("T_c", 0.0, "Turbine, lead"),
    seconds("T_eng", 0.0, "Delay of an engine; 0 leaves it out"),
    seconds("T_fload", 3.0, "Measurement of the exhaust; 0 leaves it out"),
    number("K_pload", 2.0, "Proportional gain of the load's limiter", 0),
    number("K_iload", 0.67, "Integral gain of the load's limiter", 0, "1/s"),
    power("ld_ref", 1.0, "Load that its limiter holds"),
    power("D_m", 0.0, "Damping of the turbine; below 0 an exponent of the speed"),
    number("R_open", 0.1, "Fastest opening of the valve", 1e-6, "pu/s"),
    number("R_close", -0.1, "Fastest closing of the valve", None, "pu/s"),
    number("K_imw", 0.0, "Integral gain of the load controller", 0, "1/s"),
    number("T_rate", 0.0, "Rating of the turbine; 0: S_n", 0, "MVA"),
    power("db", 0.0, "Dead band of the speed's error", 0),
    seconds("T_sa", 4.0, "Exhaust, lead"),
    seconds("T_sb", 5.0, "Exhaust, lag; 0 leaves the stage out"),
    number("R_up", 99.0, "Fastest rise of the load's reference", 0, "pu/s"),
    number("R_down", -99.0, "Fastest fall of the load's reference", None, "pu/s"),
)

_LEAST_SPEED = 0.1  # pu, below which a power of the speed is not followed
_MOST_FUEL = 1.0  # of the load's limiter [pu]
_LOAD_CONTROLLER = 1.1  # its limit, times the droop
_HEADROOM = (
    1e-3  # fuel [pu] of the load's limiter above an operating point beyond ld_ref: enough for rest
)


def ggov1(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p = declared(m, GGOV1, SOURCE)
        by_speed = m.switch("fuel_by_speed", False, "Fuel is proportional to the speed")
        assert shaft.S_n is not None  # every generator of parts has one
        share = if_else(p.T_rate > 0, p.T_rate / shaft.S_n, 1)  # T_rate over S_n
        P_0 = shaft.P_m_0 / share
        valve_0 = P_0 / p.K_turb + p.w_fnl
        require_within(m, valve_0, p.V_MIN, p.V_MAX, ("governor.V_MIN", "governor.V_MAX"))
        _require(m, p)
        valve = m.state("valve", valve_0, "pu", "Fuel valve", base="S_n")
        opened = clamp(valve, p.V_MIN, p.V_MAX) * if_else(by_speed, shaft.w, 1)
        delay = p.T_eng / 2, p.T_eng**2 / 12
        fuel = valve_0 + second_order(m, "engine", opened - valve_0, delay, (-delay[0], delay[1]))
        fsr = _request(m, p, _error(m, p, shaft, share, valve - valve_0), fuel, shaft.w, valve_0)
        rate = clamp((fsr - valve) / p.T_act, p.R_close, p.R_open)
        m.derivative(valve, held_at_limits(valve, rate, p.V_MIN, p.V_MAX))
        turbine = lead_lag(m, "turbine", p.K_turb * (fuel - p.w_fnl), p.T_c, p.T_b, P_0)
        return share * (turbine - fmax(p.D_m, 0) * (shaft.w - 1))


def _require(m: ModelBuilder, p: Given) -> None:
    for lead, lag in (("T_c", "T_b"), ("T_sa", "T_sb")):
        needs = logic_and(getattr(p, lag) <= 0, getattr(p, lead) > 0)
        m.require(if_else(needs, -1, 1), f"governor.{lag} = 0 needs governor.{lead} = 0 as well")
    whole = fabs(p.R_select * (p.R_select - 1) * (p.R_select + 1))
    m.require(0.5 - whole, "governor.R_select must be 1, -1 or 0")
    m.require(LONGEST_DELAY - p.T_eng, f"governor.T_eng must be below {LONGEST_DELAY:g} s")
    m.require(-p.R_close, "governor.R_close must be below 0")


def _error(m: ModelBuilder, p: Given, shaft: Shaft, share: Expr, valve: Expr) -> Expr:
    """The speed's error with droop and load controller; 0 at the operating point, from which the valve is counted."""
    P_0, P_e_0 = shaft.P_m_0 / share, shaft.P_e_0 / share
    P_e = low_pass_or_nothing(m, "measured_power", shaft.P_e / share, p.T_pelec, P_e_0)
    feedback = if_else(p.R_select > 0.5, P_e - P_e_0, if_else(p.R_select < -0.5, valve, 0))
    z = m.state("load_controller", 0.0, "pu", "Load controller", base="S_n")
    most = _LOAD_CONTROLLER * p.R
    moves = held_at_limits(z, p.K_imw * (P_e_0 - P_e), -most, most)
    m.derivative(z, if_else(p.K_imw > 0, moves, -z / BYPASS_TIME))
    moved = m.state("reference", 0.0, "pu", "Change of the reference, at its rates", base="S_n")
    rest = (power_reference(m, P_0) - P_0 - moved) / BYPASS_TIME
    m.derivative(moved, clamp(rest, p.R_down, p.R_up))
    error = p.R * (moved - feedback) + clamp(z, -most, most) - (shaft.w - 1)
    return clamp(beyond(error, p.db), p.min_err, p.max_err)


def _request(m: ModelBuilder, p: Given, error: Expr, fuel: Expr, w: Expr, valve_0: Expr) -> Expr:
    """Fuel that governor and load's limiter ask for, the lower of both.

    ``fuel``: as it is; ``valve_0``: of the operating point."""
    x = m.state("integral", valve_0, "pu", "Integral of the speed's error", base="S_n")
    slope = p.K_dgov / p.T_dgov * washout(m, "derivative", error, p.T_dgov)
    governed = p.K_pgov * error + x + slope
    of_speed = if_else(p.D_m < 0, exp(p.D_m * log(fmax(w, _LEAST_SPEED))), 1)
    heat = lead_lag(m, "radiation", fuel * of_speed, p.T_sa, p.T_sb, valve_0)
    exhaust = low_pass_or_nothing(m, "exhaust", heat, p.T_fload, valve_0)
    held_fuel = p.ld_ref / p.K_turb + p.w_fnl
    rest = if_else(held_fuel > valve_0, held_fuel, valve_0 + _HEADROOM) - exhaust
    most = if_else(valve_0 < _MOST_FUEL, _MOST_FUEL, valve_0 + _HEADROOM)
    y = m.state("load_limiter", most, "pu", "Integral of the load's limiter", base="S_n")
    asked = p.K_pload * rest + y
    held = logic_and(asked >= most, rest > 0)
    m.derivative(y, if_else(held, (most - y) / BYPASS_TIME, p.K_iload * rest))
    fsr = clamp(fmin(governed, fmin(asked, most)), p.V_MIN, p.V_MAX)
    outward = logic_or(logic_and(governed > fsr, error > 0), logic_and(governed < fsr, error < 0))
    moves = if_else(outward, 0, p.K_igov * error)
    m.derivative(x, if_else(p.K_igov > 0, moves, (valve_0 - x) / BYPASS_TIME))
    return fsr

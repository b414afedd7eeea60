"""PIDGOV, WPIDHY and WSHYGP: water turbines with a PID controller of speed and droop.

PIDGOV's droop is of the electrical power, or of the gate with gate_droop:

    R·(P_ref − feedback) → 1/(1+sT_reg) → − (w − 1) = e
    (K_P + K_I/s + s·K_D)/(1+sT_a)² → gate's servo T_b, within V_MIN and V_MAX, G_MIN and G_MAX
    gate → power (points G_0, G_1, G_2, 1) → (1−sA_TW·T_W)/(1+sA_TW·T_W/2) → − D_turb·(w − 1) = P_m

WPIDHY has the same controller of the power's droop, and reads its output as the gate's speed:

    controller → 1/(1+sT_b), within V_MIN and V_MAX → 1/s = gate within G_MIN and G_MAX
    → power → water, within P_MIN and P_MAX → − D_turb·(w − 1) = P_m

OpenIPSL at 2be0558a has s/(1+sT_b) instead of 1/(1+sT_b) there. With the data of PowerSimulationsDynamics.jl's file,
which were made for PSS/E, that would be unstable by 16 1/s.

WSHYGP has a filter before the controller, a pilot valve, a rating of its own and a curve of five points:

    P_ref − (w − 1 outside of ± db_1) − R·feedback → 1/(1+sT_d) → K_P + K_I/s + s·K_D/(1+sT_f) = c
    c − gate → K_G/(1+sT_P), within −VEL_close and VEL_open → 1/s = gate within P_MIN and P_MAX
    gate → power (points GV, PGV; all 0: as the gate) → (1+sA_turb·T_turb)/(1+sB_turb·T_turb) = P_m/T_rate

Its feedback is the electrical power through 1/(1+sT_t), or c itself where T_t = 0. The hysteresis of its dead band
(err) and the backlash of its gate (db_2) are left out.

Controllers without K_I hold an error in steady state, e = gate/K_P. The controllers do not stop at the gate's limits,
as their diagrams have it.

Sources: OPAL-RT's modelica-ephasor-components at 6dc8ca5 (PIDGOV, WSHYGP), PowerSimulationsDynamics.jl at d94d74e
(PIDGOV, WPIDHY), InterPSS (WPIDHYD), GridPACK at bea5ce1a (WSHYGP)."""

from fmus.synchronous_generator.data_lines import Given, declared, number, power, seconds
from fmus.synchronous_generator.turbines.curves import (
    AT_NO_LOAD,
    Point,
    beyond,
    curve_of_gate,
    derivative_gain,
    integral,
    require_rising_curve,
    share_of_rating,
    through_points,
)
from fmus.synchronous_generator.turbines.governors import (
    SOURCE,
    power_reference,
    require_within,
    servo,
)
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    clamp,
    held_at_limits,
    lead_lag,
    limited_low_pass,
    low_pass_or_nothing,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, if_else

_CONTROLLER = (
    number("K_P", 3.0, "Proportional gain", 0),
    number("K_I", 0.5, "Integral gain", 0, "1/s"),
    number("K_D", 1.0, "Derivative gain", 0, "s"),
    seconds("T_a", 0.05, "Controller, each of two lags; 0 leaves them out, which needs K_D = 0"),
    number("V_MAX", 0.1, "Fastest opening of the gate", 1e-6, "pu/s"),
    number("V_MIN", -0.1, "Fastest closing of the gate", None, "pu/s"),
    power("G_MAX", 1.0, "Gate, fully open"),
    power("G_MIN", 0.0, "Gate, closed"),
    seconds("T_W", 1.0, "Water's starting time; 0 leaves the water out"),
    power("D_turb", 0.0, "Damping of the turbine"),
)
_CURVE = (
    number("G_0", 0.08, "Gate at no load"),
    number("G_1", 0.4, "Gate of the second point"),
    power("P_1", 0.35, "Power of the second point"),
    number("G_2", 0.75, "Gate of the third point"),
    power("P_2", 0.75, "Power of the third point"),
    power("P_3", 1.0, "Power at a gate of 1"),
)
PIDGOV = (
    power("R", 0.05, "Droop", 0),
    seconds("T_reg", 0.05, "Measurement of what the droop is of; 0 leaves it out"),
    seconds("T_b", 0.5, "Gate's servo", 1e-3),
    *_CONTROLLER,
    *_CURVE,
    number("A_TW", 1.0, "Factor of the water's starting time", 0),
)
WPIDHY = (
    seconds("T_reg", 0.05, "Measurement of the electrical power; 0 leaves it out"),
    power("R", 0.05, "Droop"),
    seconds("T_b", 0.1, "Gate's speed; 0 leaves its lag out"),
    *_CONTROLLER,
    power("P_MAX", 1.0, "Highest power of the turbine"),
    power("P_MIN", 0.0, "Lowest power of the turbine"),
    *_CURVE,
)
_POINTS = ((0.0, 0.0), (0.25, 0.2), (0.5, 0.48), (0.75, 0.78), (1.0, 1.0))
WSHYGP = (
    power("db_1", 0.0, "Dead band of the speed", 0),
    seconds("T_d", 0.05, "Filter of the error; 0 leaves it out"),
    number("K_I", 0.5, "Integral gain", 0, "1/s"),
    seconds("T_f", 0.1, "Lag of the derivative; 0 needs K_D = 0"),
    number("K_D", 1.0, "Derivative gain", 0, "s"),
    number("K_P", 3.0, "Proportional gain", 0),
    power("R", 0.05, "Droop", 0),
    seconds(
        "T_t",
        0.0,
        "Measurement of the electrical power; 0: the droop is of the controller's output",
    ),
    number("K_G", 2.0, "Gain of the pilot valve", 1e-3, "1/s"),
    seconds("T_P", 0.05, "Pilot valve; 0 leaves its lag out"),
    number("VEL_open", 0.2, "Fastest opening of the gate", 1e-6, "pu/s"),
    number("VEL_close", 0.2, "Fastest closing of the gate, its sign not used", None, "pu/s"),
    power("P_MAX", 1.0, "Gate, fully open"),
    power("P_MIN", 0.0, "Gate, closed"),
    *(number(f"GV_{k}", x, f"Gate of point {k}") for k, (x, _) in enumerate(_POINTS, 1)),
    *(number(f"PGV_{k}", y, f"Power of point {k}") for k, (_, y) in enumerate(_POINTS, 1)),
    number("A_turb", -1.0, "Turbine, lead over T_turb"),
    number("B_turb", 0.5, "Turbine, lag over T_turb", 1e-3),
    seconds("T_turb", 1.0, "Turbine; 0 leaves the stage out"),
    number("T_rate", 0.0, "Rating of the turbine; 0: S_n", 0, "MVA"),
)


def pidgov(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p, P_0 = declared(m, PIDGOV, SOURCE), shaft.P_m_0
        of_gate = m.switch("gate_droop", False, "The droop is of the gate, not of the power")
        points, g_0 = _start(m, p, P_0)
        gate = m.algebraic("feedback")
        feedback = if_else(of_gate, gate - g_0, shaft.P_e - shaft.P_e_0)
        e_0 = _held_error(m, p, g_0)
        droop = p.R * (power_reference(m, P_0) - P_0 - feedback)
        error = e_0 + low_pass_or_nothing(m, "droop", droop, p.T_reg) - (shaft.w - 1)
        wanted = _controller(m, p, error, e_0, if_else(p.K_I > 0, g_0, 0), g_0)
        moved = servo(m, wanted, p.T_b, (p.V_MIN, p.V_MAX), (p.G_MIN, p.G_MAX), g_0)
        m.close(gate, moved)
        T = p.A_TW * p.T_W
        water = lead_lag(m, "water", through_points(moved, points), -T, T / 2, P_0)
        return water - p.D_turb * (shaft.w - 1)


def wpidhy(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p, P_0 = declared(m, WPIDHY, SOURCE), shaft.P_m_0
        require_within(m, P_0, p.P_MIN, p.P_MAX, ("governor.P_MIN", "governor.P_MAX"))
        points, g_0 = _start(m, p, P_0)
        droop = p.R * (power_reference(m, P_0) - P_0 - (shaft.P_e - shaft.P_e_0))
        error = low_pass_or_nothing(m, "droop", droop, p.T_reg) - (shaft.w - 1)
        asked = _controller(m, p, error, Expr(0), Expr(0), Expr(0))
        rate = clamp(low_pass_or_nothing(m, "velocity", asked, p.T_b), p.V_MIN, p.V_MAX)
        x = m.state("gate", g_0, "pu", "Gate", base="S_n")
        m.derivative(x, held_at_limits(x, rate, p.G_MIN, p.G_MAX))
        of_gate = through_points(clamp(x, p.G_MIN, p.G_MAX), points)
        water = lead_lag(m, "water", of_gate, -p.T_W, p.T_W / 2, P_0)
        return clamp(water, p.P_MIN, p.P_MAX) - p.D_turb * (shaft.w - 1)


def _start(m: ModelBuilder, p: Given, P_0: Expr) -> tuple[list[Point], Expr]:
    """Points of the gate's curve, and the gate of the operating point."""
    points: list[Point] = [(p.G_0, 0.0), (p.G_1, p.P_1), (p.G_2, p.P_2), (1.0, p.P_3)]
    require_rising_curve(m, points, "governor.G_0 to governor.P_3")
    require_within(m, P_0, -AT_NO_LOAD, p.P_3, ("governor.G_0", "governor.P_3"))
    m.require(-p.V_MIN, "governor.V_MIN must be below 0")
    g_0 = through_points(P_0, [(y, x) for x, y in points])
    require_within(m, g_0, p.G_MIN, p.G_MAX, ("governor.G_MIN", "governor.G_MAX"))
    return points, g_0


def _held_error(m: ModelBuilder, p: Given, g_0: Expr) -> Expr:
    """The error in steady state: what a controller without an integral needs for its gate."""
    m.require(
        if_else(p.K_I > 0, 1, if_else(p.K_P > 0, 1, -1)),
        "governor.K_P and governor.K_I are 0, so nothing could hold the gate; give one of them",
    )
    return if_else(p.K_I > 0, 0, g_0 / if_else(p.K_P > 0, p.K_P, 1))


def _controller(m: ModelBuilder, p: Given, error: Expr, e_0: Expr, x_0: Expr, start: Expr) -> Expr:
    """PID through two lags T_a.

    ``e_0``, ``x_0``, ``start``: error, integral and output in steady state."""
    held = p.K_P * error + integral(m, "integral", error - e_0, p.K_I, x_0)
    slow = low_pass_or_nothing(m, "first_lag", held, p.T_a, start)
    slope = derivative_gain(m, "derivative", error - e_0, p.K_D, p.T_a)
    return low_pass_or_nothing(m, "second_lag", slow + slope, p.T_a, start)


def wshygp(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p = declared(m, WSHYGP, SOURCE)
        share = share_of_rating(shaft, p.T_rate)
        P_0 = shaft.P_m_0 / share
        points: list[Point] = [(getattr(p, f"GV_{k}"), getattr(p, f"PGV_{k}")) for k in range(1, 6)]
        is_curve, low, high = curve_of_gate(m, points, (p.P_MIN, p.P_MAX))
        require_within(m, P_0, low, high, ("governor.PGV_1", "governor.PGV_5"))
        inverse = through_points(P_0, [(y, x) for x, y in points])
        g_0 = if_else(is_curve, inverse, P_0)
        require_within(m, g_0, p.P_MIN, p.P_MAX, ("governor.P_MIN", "governor.P_MAX"))
        control = _speed_controller(m, p, shaft, share, g_0)
        x = m.state("gate", g_0, "pu", "Gate", base="S_n")
        gate = clamp(x, p.P_MIN, p.P_MAX)
        asked = p.K_G * (control - gate)
        rate = limited_low_pass(m, "pilot", asked, p.T_P, -fabs(p.VEL_close), p.VEL_open)
        m.derivative(x, held_at_limits(x, rate, p.P_MIN, p.P_MAX))
        of_gate = if_else(is_curve, through_points(gate, points), gate)
        lead, lag = p.A_turb * p.T_turb, p.B_turb * p.T_turb
        return share * lead_lag(m, "turbine", of_gate, lead, lag, P_0)


def _speed_controller(m: ModelBuilder, p: Given, shaft: Shaft, share: Expr, g_0: Expr) -> Expr:
    """The gate that is asked for. Without a filter its own feedback is solved for, as it passes directly."""
    e_0, speed = _held_error(m, p, g_0), shaft.w - 1
    P_0, P_e_0 = shaft.P_m_0 / share, shaft.P_e_0 / share
    measured = low_pass_or_nothing(m, "power", shaft.P_e / share, p.T_t, P_e_0)
    of_power = p.T_t > 0
    known = if_else(of_power, P_e_0 - measured, g_0)
    open_error = e_0 + p.R * (power_reference(m, P_0) - P_0 + known) - beyond(speed, p.db_1)
    own_droop = if_else(of_power, 0, p.R)

    has_slope = p.T_f > 0
    m.require(
        if_else(has_slope, 1, if_else(p.K_D > 0, -1, 1)), "governor.K_D > 0 needs governor.T_f > 0"
    )
    lag = if_else(has_slope, p.T_f, BYPASS_TIME)
    slope = if_else(has_slope, p.K_D / lag, 0)
    filtered = m.state("error", e_0, "pu", "Error through the filter", base="S_n")
    slow = m.state("derivative", e_0, "pu", "Error, its slow part", base="S_n")
    x = m.state("integral", if_else(p.K_I > 0, g_0, 0), "pu", "Integral of the error", base="S_n")
    direct, rest = p.K_P + slope, x - slope * slow
    solved = (open_error - own_droop * rest) / (1 + own_droop * direct)
    is_filtered = p.T_d > 0
    error = if_else(is_filtered, filtered, solved)
    control = direct * error + rest
    m.derivative(
        filtered,
        (open_error - own_droop * control - filtered) / if_else(is_filtered, p.T_d, BYPASS_TIME),
    )
    m.derivative(slow, (error - slow) / lag)
    m.derivative(x, if_else(p.K_I > 0, p.K_I * (error - e_0), -x / BYPASS_TIME))
    return control

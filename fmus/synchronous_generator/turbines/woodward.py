"""WEHGOV: Woodward's electric governor of a water turbine.

    e = P_ref − (w − 1) − feedback, beyond ± db
    feedback: R_gate·gate + R_Pe·P_e/(1+sT_Pe), or with ``feedback_of_control`` R_gate·c
    c = K_P·e + K_D·s/(1+sT_D)·e + K_I/s·e, the last within G_MIN − D_ICN and G_MAX + D_ICN
    c → 1/(1+sT_P), within G_MIN − D_PV and G_MAX + D_PV → − gate → 1/(1+sT_DV), within GTMX_CL·T_g and GTMX_OP·T_g
    → 1/(sT_g) = gate within G_MIN and G_MAX

The turbine has a penstock with inelastic water, the flow that a gate lets through at a head of 1 by five points, and
the power of a flow at that head by ten:

    H = (q/flow(gate))²,  T_W·dq/dt = 1 − H,  P_m = power(q)·H − D_turb·gate·(w − 1)

Sources: OpenIPSL at 2be0558a (equations), PowerWorld's model guide (order of the fields, signs of the limits, dead
band)."""

from collections.abc import Sequence
from itertools import pairwise

from fmus.synchronous_generator.data_lines import Given, Line, declared, number, power, seconds
from fmus.synchronous_generator.turbines.curves import (
    AT_NO_LOAD,
    Point,
    beyond,
    through_points,
)
from fmus.synchronous_generator.turbines.governors import (
    SOURCE,
    power_reference,
    require_within,
)
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    clamp,
    held_at_limits,
    limited_low_pass,
    low_pass_or_nothing,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, fmax, if_else, logic_and

_LEAST_FLOW = 1e-3  # smallest flow through a gate [pu] that the flow is divided by

_OF_GATE = ((0.0, 0.0), (0.25, 0.25), (0.5, 0.5), (0.75, 0.75), (1.0, 1.0))
_OF_FLOW = (
    *((0.0, 0.0), (0.2, 0.0), (0.3, 0.12), (0.4, 0.25), (0.5, 0.38)),
    *((0.6, 0.51), (0.7, 0.64), (0.8, 0.77), (0.9, 0.89), (1.0, 1.0)),
)


def _numbered(name: str, text: str, values: Sequence[float]) -> list[Line]:
    """A parameter for each point of a curve."""
    return [number(f"{name}_{k}", value, f"{text} {k}") for k, value in enumerate(values, 1)]


_FLOWS = _numbered("FlowP", "Flow of power", [x for x, _ in _OF_FLOW])
_POWERS = _numbered("PMECH", "Power of flow", [y for _, y in _OF_FLOW])
WEHGOV = (
    power("R_gate", 0.05, "Droop of gate or controller", 0),
    power("R_Pe", 0.0, "Droop of the electrical power", 0),
    seconds("T_Pe", 0.5, "Measurement of the electrical power; 0 leaves it out"),
    number("K_P", 3.0, "Proportional gain", 0),
    number("K_I", 0.36, "Integral gain", 1e-6, "1/s"),
    number("K_D", 1.5, "Derivative gain", 0, "s"),
    seconds("T_D", 0.1, "Lag of the derivative; 0 needs K_D = 0"),
    seconds("T_P", 0.2, "Pilot valve; 0 leaves its lag out"),
    seconds("T_DV", 0.2, "Distribution valve; 0 leaves its lag out"),
    seconds("T_g", 0.2, "Gate", 1e-3),
    number("GTMX_OP", 0.1, "Fastest opening of the gate", 1e-6, "pu/s"),
    number("GTMX_CL", -0.2, "Fastest closing of the gate, its sign not used", None, "pu/s"),
    power("G_MAX", 1.0, "Gate, fully open"),
    power("G_MIN", 0.0, "Gate, closed", 0),
    power("D_turb", 0.0, "Damping of the turbine"),
    seconds("T_W", 1.2, "Water's starting time", 1e-2),
    power("db", 0.0, "Dead band of the error", 0),
    power("D_PV", 0.0, "How far the pilot valve goes beyond the gate's limits", 0),
    power("D_ICN", 0.05, "How far the integral goes beyond the gate's limits", 0),
    *_numbered("Gate", "Gate of point", [x for x, _ in _OF_GATE]),
    *_numbered("FlowG", "Flow of point", [y for _, y in _OF_GATE]),
    *_FLOWS,
    *_POWERS,
)


def wehgov(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p, P_0, speed = declared(m, WEHGOV, SOURCE), shaft.P_m_0, shaft.w - 1
        of_gate = _points(m, p, ("Gate", "FlowG"), len(_OF_GATE))
        of_flow = _points(m, p, ("FlowP", "PMECH"), len(_OF_FLOW))
        least, most = of_flow[0][1], _largest(of_flow)
        require_within(m, P_0, least - AT_NO_LOAD, most, ("governor.PMECH_1", "governor.PMECH_10"))
        q_0 = _reached(of_flow, P_0)
        g_0 = _reached(of_gate, q_0)
        require_within(m, g_0, p.G_MIN, p.G_MAX, ("governor.G_MIN", "governor.G_MAX"))
        x = m.state("gate", g_0, "pu", "Gate", base="S_n")
        gate = clamp(x, p.G_MIN, p.G_MAX)
        control = _controller(m, p, shaft, gate, g_0)
        wanted = limited_low_pass(
            m, "pilot", control, p.T_P, p.G_MIN - p.D_PV, p.G_MAX + p.D_PV, initial=g_0
        )
        slowest, fastest = -fabs(p.GTMX_CL) * p.T_g, p.GTMX_OP * p.T_g
        moved = limited_low_pass(m, "distribution", wanted - gate, p.T_DV, slowest, fastest)
        m.derivative(x, held_at_limits(x, moved / p.T_g, p.G_MIN, p.G_MAX))
        q = m.state("q", q_0, "pu", "Flow", base="S_n")
        head = (q / fmax(through_points(gate, of_gate), _LEAST_FLOW)) ** 2
        m.derivative(q, (1 - head) / p.T_W)
        return through_points(q, of_flow) * head - p.D_turb * gate * speed


def _controller(m: ModelBuilder, p: Given, shaft: Shaft, gate: Expr, g_0: Expr) -> Expr:
    """The controller's output. Where its own droop is fed back, the error is solved for, as it passes directly."""
    of_control = m.switch(
        "feedback_of_control",
        False,
        "The droop is of the controller's output, not of gate and power",
    )
    measured = low_pass_or_nothing(m, "power", shaft.P_e, p.T_Pe, shaft.P_e_0)
    fed_back = if_else(of_control, 0, p.R_gate * gate + p.R_Pe * measured)
    steady = p.R_gate * g_0 + if_else(of_control, 0, p.R_Pe * shaft.P_e_0)
    moved = power_reference(m, steady)
    has_slope = p.T_D > 0
    m.require(
        if_else(has_slope, 1, if_else(p.K_D > 0, -1, 1)), "governor.K_D > 0 needs governor.T_D > 0"
    )
    lag = if_else(has_slope, p.T_D, BYPASS_TIME)
    slope = if_else(has_slope, p.K_D / lag, 0)
    slow = m.state("derivative", 0.0, "pu", "Error, its slow part", base="S_n")
    x = m.state("integral", g_0, "pu", "Integral of the error", base="S_n")
    low, high = p.G_MIN - p.D_ICN, p.G_MAX + p.D_ICN
    direct, rest = p.K_P + slope, clamp(x, low, high) - slope * slow
    own_droop = if_else(of_control, p.R_gate, 0)
    open_error = moved - (shaft.w - 1) - fed_back - own_droop * rest
    error = beyond(open_error, p.db) / (1 + own_droop * direct)
    m.derivative(slow, (error - slow) / lag)
    m.derivative(x, held_at_limits(x, p.K_I * error, low, high))
    return direct * error + rest


def _points(m: ModelBuilder, p: Given, names: tuple[str, str], count: int) -> list[Point]:
    """The points of a curve; those at its end that are 0 are not there."""
    first, second = names
    points: list[Point] = [
        (getattr(p, f"{first}_{k}"), getattr(p, f"{second}_{k}")) for k in range(1, count + 1)
    ]
    for (x, y), (next_x, next_y) in pairwise(points):
        is_unused = logic_and(Expr(next_x) <= 0, Expr(next_y) <= 0)
        rises = logic_and(Expr(next_x) > x, Expr(next_y) >= y)
        text = (
            f"governor.{first}_1 to governor.{second}_{count}: both must rise from point to point"
        )
        m.require(if_else(is_unused, 1, if_else(rises, 1, -1)), text)
    return points


def _largest(points: Sequence[Point]) -> Expr:
    most = Expr(0)
    for _, y in points:
        most = fmax(most, y)
    return most


def _reached(points: Sequence[Point], wanted: Expr) -> Expr:
    """The x of a wanted y on a rising curve, the largest where the curve is level."""
    last_x, last_y = (Expr(value) for value in points[0])
    x = last_x
    for here_x, here_y in points[1:]:
        exists = Expr(here_x) > last_x
        high = Expr(here_y) - last_y
        share = if_else(
            high > 0, clamp((wanted - last_y) / if_else(high > 0, high, 1), 0, 1), wanted >= last_y
        )
        x += if_else(exists, share * (here_x - last_x), 0)
        last_x, last_y = (if_else(exists, here_x, last_x), if_else(exists, here_y, last_y))
    return x

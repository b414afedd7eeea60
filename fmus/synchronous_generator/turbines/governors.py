"""GAST, TGOV1 and HYGOV: governors with gas, steam and water turbines; and no governor.

Without one, mechanical power or mechanical torque is constant:

    constant_power   P_m = P_ref, so the torque falls with speed, T_m = P_m/w
    constant_torque  T_m = P_ref, so P_m = T_m·w

Between them lies a damping of P_0 per unit of speed: 1/(4H)·P_0 of the swing's decay.

GAST has a gas turbine with a limit of its exhaust's temperature:

    low value of P_ref − (w − 1)/R and A_T + K_T·(A_T − T_exh)
    → 1/(1+sT_1), held within V_MIN and V_MAX → 1/(1+sT_2) → fuel
    P_m = fuel − D_turb·(w − 1),   T_exh = fuel/(1+sT_3)

Where the operating point lies at A_T or above, the limit holds a load just above it instead: the turbine starts in
steady state and gives no more.

TGOV1 has a steam turbine with a reheater:

    P_ref − (w − 1)/R → 1/(1+sT_1), held within V_MIN and V_MAX → (1+sT_2)/(1+sT_3) → − D_t·(w − 1) = P_m

HYGOV has a transient droop, and a penstock with inelastic water; in steady state h = 1 and g = q = P_m/A_t + q_NL:

    R·(c_ref − c) − (w − 1) → 1/(1+sT_f) → (1+sT_r)/(r·T_r·s) = c, held within G_MIN and G_MAX
    T_g·dg/dt = c − g, at most VELM per second
    h = (q/g)²,  T_W·dq/dt = 1 − h,  P_m = A_t·h·(q − q_NL) − D_turb·g·(w − 1)"""

from functools import partial

from fmus.synchronous_generator.declarations import per_unit, require_between, time_constant
from fmus.synchronous_generator.variants import Governor, Shaft
from fmus.toolchain import blocks
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and

SOURCE = "typical data, IEEE PES-TR1"

_HEADROOM = (
    1e-3  # fuel [pu] of GAST's limit above an operating point at A_T or beyond: enough for rest
)
_AT_LIMIT = 1e-6  # power [pu] below A_T that is at it: what rounding of a power flow leaves open

LONGEST_DELAY = 0.25
"""Longest delay of an engine [s]: Padé's fraction of second order keeps its phase within 3 degrees up to 8 rad/s."""


POWER_REFERENCE = "power reference"  # name of a signal that adds to it, in a model's hand-over
LOAD_CONTROL = "load control"  # the same of a slow loop around the governor

power = partial(per_unit, base="S_n", source=SOURCE)
time = partial(time_constant, source=SOURCE)


def power_reference(m: ModelBuilder, P_ref_0: Scalar) -> Expr:
    """Declare the power reference of the operating point and its change; return their sum [pu, S_n].

    What other parts, a POD and a load controller, have handed over adds to it."""
    P_ref = m.calculated(
        "P_ref", P_ref_0, "pu", "Power reference of the operating point", base="S_n"
    )
    reference = P_ref + m.parameter(
        "delta_P_ref", 0.0, "pu", "Change of the power reference", base="S_n", tunable=True
    )
    handed = (m.handed_over(name) for name in (POWER_REFERENCE, LOAD_CONTROL))
    return sum((signal for signal in handed if signal is not None), start=reference)


def read_either_way(governor: Governor) -> Governor:
    """The same governor whose output is the mechanical power, or, by a parameter, the mechanical torque."""

    def declare(m: ModelBuilder, shaft: Shaft) -> Expr:
        output = governor(m, shaft)
        with m.scope("governor"):
            is_torque = m.switch(
                "output_is_torque", False, "The output is the mechanical torque, not the power"
            )
        return output * if_else(is_torque, shaft.w, 1)

    return declare


require_within = partial(
    require_between,
    rule="so the turbine cannot give its power; change the limit or the generator's active power",
)


def constant_power(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare it and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        return power_reference(m, P_m_0)


def constant_torque(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare it and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        return power_reference(m, P_m_0) * w


def servo(
    m: ModelBuilder,
    wanted: Expr,
    T: Expr,
    speed: tuple[Expr, Expr],
    limits: tuple[Expr, Expr],
    initial: Expr,
) -> Expr:
    """Declare the state ``gate`` that follows with the time constant T and no faster than its rates; return it.

    ``T``: [s], above 0; ``speed``: fastest closing, below 0, and opening [pu/s]; ``limits``: lowest and highest, where
    it does not wind up."""
    x = m.state("gate", initial, "pu", "Valve", base="S_n")
    gate = blocks.clamp(x, *limits)
    rate = blocks.clamp((wanted - gate) / T, *speed)
    m.derivative(x, blocks.held_at_limits(x, rate, *limits))
    return gate


_LEAST_GATE = 1e-3  # smallest gate [pu] that the flow is divided by


def hygov(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        R = power(m, "R", 0.05, "Permanent droop", 1e-4)
        r = power(m, "r", 0.3, "Transient droop", 1e-4)
        T_r = time(m, "T_r", 5.0, "Reset of the transient droop", 1e-2)
        T_f = time(m, "T_f", 0.05, "Filter", 1e-3)
        T_g = time(m, "T_g", 0.5, "Gate's servo", 1e-3)
        VELM = m.parameter(
            "VELM", 0.2, "pu/s", "Fastest movement of the gate", minimum=1e-6, source=SOURCE
        )
        high, low = (
            power(m, "G_MAX", 1.0, "Gate, fully open"),
            power(m, "G_MIN", 0.0, "Gate, closed", 0),
        )
        T_W = time(m, "T_W", 1.0, "Water's inertia", 1e-2)
        A_t = m.parameter("A_t", 1.2, "1", "Gain of the turbine", minimum=0.1, source=SOURCE)
        D_turb = power(m, "D_turb", 0.5, "Damping of the turbine", 0)
        q_NL = power(m, "q_NL", 0.08, "Flow at no load", 0)

        def gate_for(P: Expr) -> Expr:
            return P / A_t + q_NL

        g_0 = gate_for(P_m_0)
        require_within(m, g_0, low, high, ("governor.G_MIN", "governor.G_MAX"))
        wanted = gate_for(power_reference(m, P_m_0))
        c = m.algebraic("c")
        filtered = m.state("filtered", 0.0, "pu", "Error through the filter", base="S_n")
        m.derivative(filtered, (R * (wanted - c) - (w - 1) - filtered) / T_f)
        m.close(
            c,
            blocks.limited_proportional_integral(
                m, "c_slow", filtered, 1 / r, 1 / (r * T_r), low=low, high=high, initial=g_0
            ),
        )
        x = m.state("gate", g_0, "pu", "Gate", base="S_n")
        m.derivative(x, blocks.clamp((c - x) / T_g, -VELM, VELM))
        gate = fmax(x, _LEAST_GATE)
        q = m.state("q", g_0, "pu", "Flow", base="S_n")
        h = (q / gate) ** 2
        m.derivative(q, (1 - h) / T_W)
        return A_t * h * (q - q_NL) - D_turb * gate * (w - 1)


def gast(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        R = power(m, "R", 0.05, "Droop", 1e-4)
        T_1 = time(m, "T_1", 0.4, "Governor; 0 leaves the lag out")
        T_2 = time(m, "T_2", 0.1, "Combustion", 1e-3)
        T_3 = time(m, "T_3", 3.0, "Measurement of the exhaust's temperature", 1e-3)
        A_T = power(m, "A_T", 1.0, "Load limit at the ambient temperature")
        K_T = m.parameter(
            "K_T", 2.0, "1", "Gain of the temperature's limiter", minimum=0, source=SOURCE
        )
        high, low = (
            power(m, "V_MAX", 1.0, "Valve, fully open"),
            power(m, "V_MIN", -0.05, "Valve, closed"),
        )
        D_turb = power(m, "D_turb", 0.0, "Damping of the turbine", 0)
        require_within(m, P_m_0, low, high, ("governor.V_MIN", "governor.V_MAX"))
        held = if_else(P_m_0 < A_T - _AT_LIMIT, A_T, P_m_0 + _HEADROOM)
        exhaust = m.state("exhaust", P_m_0, "pu", "Measured temperature of the exhaust", base="S_n")
        wanted = fmin(power_reference(m, P_m_0) - (w - 1) / R, held + K_T * (held - exhaust))
        valve = blocks.limited_low_pass(m, "valve", wanted, T_1, low, high, initial=P_m_0)
        fuel = blocks.low_pass(m, "combustion", valve, T_2, P_m_0)
        m.derivative(exhaust, (fuel - exhaust) / T_3)
        return fuel - D_turb * (w - 1)


def tgov1(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n].

    ``w``: rotor speed [pu, f_n]; ``P_m_0``: mechanical power at the operating point [pu, S_n]."""
    with m.scope("governor"):
        R = power(m, "R", 0.05, "Droop", 1e-4)
        T_1 = time(m, "T_1", 0.5, "Valve; 0 leaves the lag out")
        high, low = (
            power(m, "V_MAX", 1.0, "Valve, fully open"),
            power(m, "V_MIN", 0.0, "Valve, closed"),
        )
        T_2 = time(m, "T_2", 3.0, "Reheater, lead: T_3 times the high-pressure part")
        T_3 = time(m, "T_3", 10.0, "Reheater; 0 leaves the stage out")
        D_t = power(m, "D_t", 0.0, "Damping of the turbine", 0)
        m.require(
            if_else(logic_and(T_3 <= 0, T_2 > 0), -1, 1),
            "governor.T_3 = 0 needs governor.T_2 = 0 as well",
        )
        require_within(m, P_m_0, low, high, ("governor.V_MIN", "governor.V_MAX"))
        valve = blocks.limited_low_pass(
            m, "valve", power_reference(m, P_m_0) - (w - 1) / R, T_1, low, high, initial=P_m_0
        )
        return blocks.lead_lag(m, "reheater", valve, T_2, T_3, P_m_0) - D_t * (w - 1)

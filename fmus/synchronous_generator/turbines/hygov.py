"""HYGOV: a hydro governor with a transient droop, and a penstock with inelastic water.

    R·(c_ref − c) − (w − 1) → 1/(1+sT_f) → (1+sT_r)/(r·T_r·s) = c, held within G_MIN and G_MAX
    T_g·dg/dt = c − g, at most VELM per second
    h = (q/g)²,  T_W·dq/dt = 1 − h,  P_m = A_t·h·(q − q_NL) − D_turb·g·(w − 1)

In steady state h = 1 and g = q = P_m/A_t + q_NL."""

from fmus.synchronous_generator.turbines.common import SOURCE, power, power_reference, require_within, time
from fmus.toolchain.blocks import clamp, limited_proportional_integral
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax

_LEAST_GATE = 1e-3
"""Smallest gate [pu] that the flow is divided by."""


def hygov(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        R = power(m, "R", 0.05, "Permanent droop", 1e-4)
        r = power(m, "r", 0.3, "Transient droop", 1e-4)
        T_r = time(m, "T_r", 5.0, "Reset of the transient droop", 1e-2)
        T_f = time(m, "T_f", 0.05, "Filter", 1e-3)
        T_g = time(m, "T_g", 0.5, "Gate's servo", 1e-3)
        VELM = m.parameter("VELM", 0.2, "pu/s", "Fastest movement of the gate", minimum=1e-6, source=SOURCE)
        high, low = power(m, "G_MAX", 1.0, "Gate, fully open"), power(m, "G_MIN", 0.0, "Gate, closed", 0)
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
        m.close(c, limited_proportional_integral(m, "c_slow", filtered, 1 / r, 1 / (r * T_r), low, high, g_0))
        x = m.state("gate", g_0, "pu", "Gate", base="S_n")
        m.derivative(x, clamp((c - x) / T_g, -VELM, VELM))
        gate = fmax(x, _LEAST_GATE)
        q = m.state("q", g_0, "pu", "Flow", base="S_n")
        h = (q / gate) ** 2
        m.derivative(q, (1 - h) / T_W)
        return A_t * h * (q - q_NL) - D_turb * gate * (w - 1)

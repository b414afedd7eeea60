"""Inner control: voltage PI around current PI, with lagged feed-forwards and a limit on the current reference."""

import casadi as ca

from fmus.converter_parts.current_control import current_control
from fmus.converter_parts.filter import APPENDIX, Filter, SteadyState
from fmus.toolchain.frames import Phasor, QdState, qd_state
from fmus.toolchain.model_builder import ModelBuilder

LIMIT_SOURCE = "Mateu-Barriendos et al. 2024, appendix, current saturation"


def inner_loops(m: ModelBuilder, f: Filter, omega_b: ca.SX, w: ca.SX, u_ref: Phasor) -> Phasor:
    """Declare both loops and return the voltage that the converter applies [pu, S_n].

    Parameters
    ----------
    m
        The converter's model.
    f
        The declared filter.
    omega_b
        Base angular frequency [rad/s].
    w
        Frequency of the converter [pu, f_n].
    u_ref
        Reference of the voltage across the capacitor branch, converter's frame [pu, S_n].
    """
    start = f.initial
    u_lagged, i_g_lagged = _feed_forwards(m, f)
    with m.scope("voltage_control"):
        tau = m.parameter("tau", 0.05, "s", "Response time of the AC-voltage loop", minimum=1e-3, source=APPENDIX)
        xi = m.parameter("xi", 0.707, "1", "Damping ratio of the AC-voltage loop", minimum=0.1, source=APPENDIX)
        i_q_max, i_d_max = declare_current_limits(m, start)
        C_c = f.B_c / omega_b
        omega_n = 4 / (tau * xi)
        k_p = 2 * xi * omega_n * C_c * 100  # the factor 100 is the paper's
        k_i = omega_n**2 * C_c
        x = qd_state(m, "x", start.i_s - Phasor(0, f.B_c) * start.u - start.i_g, "Integrator of the voltage loop")
        error = u_ref - f.u
        demanded = k_p * error + x.value + Phasor(0, w * f.B_c) * f.u + i_g_lagged
        i_ref = demanded.clamped(i_q_max, i_d_max)
        _integrate_unless_clamped(m, x, k_i * error, demanded, i_q_max, i_d_max)
    return current_control(m, f, omega_b, w, i_ref, u_lagged)


def declare_current_limits(m: ModelBuilder, start: SteadyState) -> tuple[ca.SX, ca.SX]:
    """Declare the limits of i_q,ref and i_d,ref; a dispatch beyond them is refused."""
    i_q_max = m.parameter("i_q_max", 1.1, "pu", "Limit of i_q,ref", base="S_n", minimum=0.1, source=LIMIT_SOURCE)
    i_d_max = m.parameter("i_d_max", 1.1, "pu", "Limit of i_d,ref", base="S_n", minimum=0.1, source=LIMIT_SOURCE)
    m.require(
        i_q_max - ca.fabs(start.i_s.re),
        "the power flow asks for more active current than voltage_control.i_q_max: lower P_0 or raise S_n",
    )
    m.require(
        i_d_max - ca.fabs(start.i_s.im),
        "the power flow asks for more reactive current than voltage_control.i_d_max: lower Q_0 or raise S_n",
    )
    return i_q_max, i_d_max


def _feed_forwards(m: ModelBuilder, f: Filter) -> tuple[Phasor, Phasor]:
    """Lagged capacitor voltage, and lagged grid current."""
    with m.scope("feed_forward"):
        tau = m.parameter("tau", 1e-4, "s", "Lag of both feed-forwards", minimum=1e-5, source=APPENDIX)
        m.require(2.5 * tau - m.internal_step, "internal_step must be shorter than 2.5 times feed_forward.tau")
        u = qd_state(m, "u", f.initial.u, "Lagged capacitor voltage")
        i_g = qd_state(m, "i_g", f.initial.i_g, "Lagged grid current")
        u.set_derivative(m, (f.u - u.value) / tau)
        i_g.set_derivative(m, (f.i_g.value - i_g.value) / tau)
    return u.value, i_g.value


def _integrate_unless_clamped(
    m: ModelBuilder, x: QdState, rate: Phasor, demanded: Phasor, i_q_max: ca.SX, i_d_max: ca.SX
) -> None:
    """Freeze each component of the integrator while that component of the reference is at its limit."""
    x.set_derivative(
        m,
        Phasor(
            ca.if_else(ca.fabs(demanded.re) < i_q_max, rate.re, 0),
            ca.if_else(ca.fabs(demanded.im) < i_d_max, rate.im, 0),
        ),
    )

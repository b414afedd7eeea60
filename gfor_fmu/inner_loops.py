"""Inner control: voltage PI around current PI, with lagged feed-forwards and a limit on the current reference."""

from fmus.converter_parts.current_control import current_control
from fmus.converter_parts.filter import APPENDIX, MeasuredFilter
from fmus.toolchain.frames import Phasor, QdState, qd_state
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, fmax, if_else, logic_and
from gfor_fmu.current_limit import (
    BOX,
    CurrentLimit,
    LimitedCurrent,
    declare_current_limit,
    limited_current,
)
from gfor_fmu.phase_limit import PhaseLimit
from gfor_fmu.virtual_impedance import VirtualImpedance, declare_inductive_voltage


def inner_loops(
    m: ModelBuilder,
    f: MeasuredFilter,
    omega_b: Expr,
    w: Expr,
    u_ref: Phasor,
    virtual: VirtualImpedance,
    *,
    beside: Phasor | None = None,
    phases: PhaseLimit | None = None,
) -> tuple[Phasor, LimitedCurrent]:
    """Declare both loops; return the voltage that the converter applies [pu, S_n], and the limit at work.

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
        Reference of the voltage across the capacitor branch and the virtual impedance, converter's frame [pu, S_n].
    virtual
        The virtual impedance.
    beside
        What else the voltage reference falls by, converter's frame [pu, S_n]; nothing by default.
    phases
        What lowers the limit where a phase carries more; nothing by default.
    """
    start = f.initial
    u_lagged, i_g_lagged, slope = _feed_forwards(m, f)
    drop = virtual.drop(w, f.i_g.value) + declare_inductive_voltage(m, virtual, omega_b, slope)
    drop = drop if beside is None else drop + beside
    with m.scope("voltage_control"):
        tau = m.parameter(
            "tau", 0.05, "s", "Response time of the AC-voltage loop", minimum=1e-3, source=APPENDIX
        )
        xi = m.parameter(
            "xi", 0.707, "1", "Damping ratio of the AC-voltage loop", minimum=0.1, source=APPENDIX
        )
        factor = m.parameter(
            "factor",
            100.0,
            "1",
            "Factor of the proportional gain: 100 in the paper, 1 where both gains place the same poles",
            minimum=0.1,
            maximum=1000.0,
            source=APPENDIX,
        )
        C_c = f.B_c / omega_b
        omega_n = 4 / (tau * xi)
        k_p = 2 * xi * omega_n * C_c * factor
        k_i = omega_n**2 * C_c
        x = qd_state(
            m,
            "x",
            start.i_s - Phasor(0, f.B_c) * start.u - start.i_g,
            "Integrator of the voltage loop",
        )
        error = u_ref - drop - f.u
        demanded = k_p * error + x.value + Phasor(0, w * f.B_c) * f.u + i_g_lagged
    limit = declare_current_limit(m, start)
    if phases is not None:
        phases.follow(m, limit.largest)
        limit = limit.lowered(fmax(phases.cut, 0))
    found = limited_current(limit, demanded, k_p)
    _integrate_what_is_left(m, x, limit, found, k_i, error)
    return current_control(m, f, omega_b, w, found.allowed, u_lagged), found


def _feed_forwards(m: ModelBuilder, f: MeasuredFilter) -> tuple[Phasor, Phasor, Phasor]:
    """Lagged capacitor voltage, lagged grid current, and the latter's derivative [pu/s]."""
    with m.scope("feed_forward"):
        tau = m.parameter(
            "tau", 1e-4, "s", "Lag of both feed-forwards", minimum=1e-5, source=APPENDIX
        )
        m.require(
            2.5 * tau - m.internal_step,
            "internal_step must be shorter than 2.5 times feed_forward.tau",
        )
        u = qd_state(m, "u", f.initial.u, "Lagged capacitor voltage")
        i_g = qd_state(m, "i_g", f.initial.i_g, "Lagged grid current")
        u.set_derivative(m, (f.u - u.value) / tau)
        slope = (f.i_g.value - i_g.value) / tau
        i_g.set_derivative(m, slope)
    return u.value, i_g.value, slope


def _integrate_what_is_left(
    m: ModelBuilder,
    x: QdState,
    limit: CurrentLimit,
    found: LimitedCurrent,
    k_i: Expr,
    error: Phasor,
) -> None:
    """Anti-windup. In the paper's box each component stands still while it is clamped; behind the other limits the
    voltage that they take away is no error."""
    box, left = limit.is_kind(BOX), error - found.missing
    q_stops = logic_and(box, fabs(found.demanded.re) >= limit.box.i_q_max)
    d_stops = logic_and(box, fabs(found.demanded.im) >= limit.box.i_d_max)
    x.set_derivative(
        m, Phasor(if_else(q_stops, 0, k_i * left.re), if_else(d_stops, 0, k_i * left.im))
    )

"""Current control: a PI controller in a converter's own frame, with decoupling and a feed-forward of the voltage."""

from dataclasses import dataclass

from fmus.converter_parts.filter import APPENDIX, MeasuredFilter
from fmus.toolchain.frames import Phasor, qd_state
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else


@dataclass(frozen=True)
class FreeGains:
    """Gains of a current control that need not follow from its time constant.

    ``K_P`` [pu] and ``K_I`` [1/s], where 0 is the one from the time constant; ``feed_forward``: part of the measured
    voltage that is added."""

    K_P: Expr
    K_I: Expr
    feed_forward: Expr


def declare_free_gains(m: ModelBuilder) -> FreeGains:
    """Declare the gains; the defaults leave them to the time constant, and add the whole voltage."""
    with m.scope("current_control"):
        K_P = m.parameter(
            *("K_P", 0.0, "pu", "Proportional gain; 0: from tau and filter.X_c"),
            base="S_n",
            minimum=0.0,
        )
        K_I = m.parameter(
            "K_I", 0.0, "1/s", "Integral gain; 0: from tau and filter.R_c", minimum=0.0
        )
    with m.scope("feed_forward"):
        part = m.parameter(
            *("gain", 1.0, "1", "Part of the measured voltage that the current control adds"),
            minimum=0.0,
            maximum=1.0,
        )
    return FreeGains(K_P, K_I, part)


def current_control(
    m: ModelBuilder,
    f: MeasuredFilter,
    omega_b: Expr,
    w: Expr,
    i_ref: Phasor,
    u_lagged: Phasor,
    *,
    gains: FreeGains | None = None,
) -> Phasor:
    """Declare the controller and return the voltage that the converter applies [pu, S_n].

    Its gains L_c/τ and R_c/τ cancel the inductor's pole, so that the current follows its reference as 1/(1 + s·τ).

    ``f``: the declared filter; ``omega_b``: base angular frequency [rad/s]; ``w``: frequency of the converter's frame
    [pu, f_n]; ``i_ref``: reference of the current in the inductor, converter's frame [pu, S_n]; ``u_lagged``: measured
    voltage across the capacitor branch [pu, S_n]; ``gains``: in the place of those from τ."""
    start = f.initial
    with m.scope("current_control"):
        tau = m.parameter(
            "tau", 0.001, "s", "Time constant of the current loop", minimum=2e-4, source=APPENDIX
        )
        L_c = f.X_c / omega_b
        K_P, K_I, added, added_0 = L_c / tau, f.R_c / tau, u_lagged, start.u
        if gains is not None:
            K_P = if_else(gains.K_P > 0, gains.K_P, K_P)
            K_I = if_else(gains.K_I > 0, gains.K_I, K_I)
            added, added_0 = added * gains.feed_forward, added_0 * gains.feed_forward
        i_s = f.i_s.value
        x = qd_state(
            m,
            "x",
            start.v_c - Phasor(0, f.X_c) * start.i_s - added_0,
            "Integrator of the current loop",
        )
        error = i_ref - i_s
        x.set_derivative(m, K_I * error)
        return K_P * error + x.value + Phasor(0, w * f.X_c) * i_s + added

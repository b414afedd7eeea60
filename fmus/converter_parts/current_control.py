"""Current control: a PI controller in a converter's own frame, with decoupling and a feed-forward of the voltage."""

from fmus.converter_parts.filter import APPENDIX, MeasuredFilter
from fmus.toolchain.frames import Phasor, qd_state
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr


def current_control(
    m: ModelBuilder, f: MeasuredFilter, omega_b: Expr, w: Expr, i_ref: Phasor, u_lagged: Phasor
) -> Phasor:
    """Declare the controller and return the voltage that the converter applies [pu, S_n].

    Its gains L_c/τ and R_c/τ cancel the inductor's pole, so that the current follows its reference as 1/(1 + s·τ).

    ``f``: the declared filter; ``omega_b``: base angular frequency [rad/s]; ``w``: frequency of the converter's frame
    [pu, f_n]; ``i_ref``: reference of the current in the inductor, converter's frame [pu, S_n]; ``u_lagged``: measured
    voltage across the capacitor branch [pu, S_n]."""
    start = f.initial
    with m.scope("current_control"):
        tau = m.parameter(
            "tau", 0.001, "s", "Time constant of the current loop", minimum=2e-4, source=APPENDIX
        )
        L_c = f.X_c / omega_b
        i_s = f.i_s.value
        x = qd_state(
            m,
            "x",
            start.v_c - Phasor(0, f.X_c) * start.i_s - start.u,
            "Integrator of the current loop",
        )
        error = i_ref - i_s
        x.set_derivative(m, f.R_c / tau * error)
        return L_c / tau * error + x.value + Phasor(0, w * f.X_c) * i_s + u_lagged

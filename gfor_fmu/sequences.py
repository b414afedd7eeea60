"""Filters that tell the sequences of the grid current apart, in the converter's frame.

The frame turns with the positive sequence. In it the negative one turns backwards at twice the frequency, and a direct
current of the phases at once the frequency. Each of three filters follows what the others leave, one at rest and two
that turn as these do. In steady state the second holds the negative sequence alone."""

from fmus.converter_parts.filter import MeasuredFilter
from fmus.toolchain.frames import ZERO, QdState, qd_state
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr


def declare_sequences(
    m: ModelBuilder, f: MeasuredFilter, omega_b: Expr, w: Expr, tau: Expr | float
) -> tuple[QdState, QdState]:
    """Declare the filters; return the positive and the negative sequence of the grid current [pu, S_n].

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
    tau
        Time constant with which the sequences are told apart [s].
    """
    positive = qd_state(m, "positive", f.initial.i_g, "Positive sequence of the grid current")
    negative = qd_state(m, "negative", ZERO, "Negative sequence of the grid current")
    offset = qd_state(m, "offset", ZERO, "Direct current of its phases")
    left = (f.i_g.value - positive.value - negative.value - offset.value) / tau
    positive.set_derivative(m, left)
    negative.set_derivative(m, left - 2 * w * omega_b * negative.value.times_j())
    offset.set_derivative(m, left - w * omega_b * offset.value.times_j())
    return positive, negative

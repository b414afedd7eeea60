"""Virtual resistance that the negative sequence of the grid current meets, beside what filter and loops are to it.

The converter's frame turns with the positive sequence. In it the negative one turns backwards at twice the frequency,
and a direct current of the phases at once the frequency. Three filters tell them apart: each follows what the others
leave, one at rest and two that turn as these do. In steady state the second holds the negative sequence alone."""

from fmus.converter_parts.filter import MeasuredFilter
from fmus.toolchain.frames import ZERO, Phasor, qd_state
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr

_LARGEST = 2.0  # of the resistance [pu]: eight times the reactance that the negative sequence meets without it


def declare_negative_sequence_drop(
    m: ModelBuilder, f: MeasuredFilter, omega_b: Expr, w: Expr
) -> Phasor:
    """Declare the resistance; return the voltage over it [pu, S_n], converter's frame. With 0, the default, it is 0.

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
    """
    with m.scope("negative_sequence"):
        R = m.parameter(
            "R",
            0.0,
            "pu",
            "Virtual resistance to the negative sequence of the grid current; 0: none",
            base="S_n",
            minimum=0.0,
            maximum=_LARGEST,
        )
        tau = m.parameter(
            "tau",
            0.1,
            "s",
            "Time constant with which the sequences of the grid current are told apart",
            minimum=0.02,
            maximum=10.0,
        )
        positive = qd_state(m, "positive", f.initial.i_g, "Positive sequence of the grid current")
        negative = qd_state(m, "negative", ZERO, "Negative sequence of the grid current")
        offset = qd_state(m, "offset", ZERO, "Direct current of its phases")
        left = (f.i_g.value - positive.value - negative.value - offset.value) / tau
        positive.set_derivative(m, left)
        negative.set_derivative(m, left - 2 * w * omega_b * negative.value.times_j())
        offset.set_derivative(m, left - w * omega_b * offset.value.times_j())
    return R * negative.value

"""Virtual resistance that the negative sequence of the grid current meets, beside what filter and loops are to it."""

from fmus.converter_parts.filter import MeasuredFilter
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr
from gfor_fmu.sequences import declare_sequences

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
        _, negative = declare_sequences(m, f, omega_b, w, tau)
    return R * negative.value

"""Limit of the current in each phase, where a negative sequence makes one phase carry more than the others.

The limit of the current reference is one of both sequences together, and the current follows what swings at twice the
frequency late: one phase then carries more than the limit lets through at balanced voltages. Here the sequences P and N
of the grid current are told apart, and the limit is lowered until |P| + |N|, which no phase exceeds, is within it.
Without a negative sequence nothing is lowered, to the last bit."""

from dataclasses import dataclass

from fmus.converter_parts.filter import MeasuredFilter
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and, logic_or
from gfor_fmu.sequences import declare_sequences

_TAU = 0.02  # time constant with which the sequences are told apart [s]
_GAIN = 60.0  # rate at which the limit falls for 1 pu of current above it [1/s]
_PRESENT = 0.16
"""Negative sequence [pu, S_n] from which it acts, unless a largest current is declared.

It is looked at behind a lag of _TAU. A step of 5 pu of balanced current, which seems to have 5/(2·2π·50·_TAU) = 0.4 pu
of it at first, leaves 0.4/e = 0.15 pu there."""
_GOES = 0.05  # time in which the limit comes back without a negative sequence [s]
_MOST = 0.8  # part of the limit that can be taken away


@dataclass(frozen=True)
class PhaseLimit:
    """The part of the current's limit that is taken away, and what it is taken for.

    Attributes
    ----------
    cut
        That part, 0 to 0.8.
    of_phases
        No phase carries more than this [pu, S_n].
    present
        Size of the negative sequence behind a lag [pu, S_n].
    I_max
        Largest current of a phase as declared; 0: what the limit lets through at balanced voltages [pu, S_n].
    """

    cut: Expr
    of_phases: Expr
    present: Expr
    I_max: Expr

    def follow(self, m: ModelBuilder, largest: Expr) -> None:
        """Declare how the part moves.

        Parameters
        ----------
        m
            The converter's model.
        largest
            Largest current that the limit lets through at balanced voltages [pu, S_n].
        """
        most = if_else(self.I_max > 0, self.I_max, largest)
        over = _GAIN * (self.of_phases - most)
        within = logic_or(
            logic_and(over < 0, self.cut <= 0), logic_and(over > 0, self.cut >= _MOST)
        )
        moves = if_else(within, 0, over)
        acts = logic_or(self.I_max > 0, self.present > _PRESENT)
        m.derivative(self.cut, if_else(acts, moves, -self.cut / _GOES))


def declare_phase_limit(m: ModelBuilder, f: MeasuredFilter, omega_b: Expr, w: Expr) -> PhaseLimit:
    """Declare the filters that tell the sequences of the grid current apart, and the part that is taken away.

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
    with m.scope("phase_limit"):
        I_max = m.parameter(
            "I_max",
            0.0,
            "pu",
            "Largest current of a phase at unbalanced voltages; 0: what the limit lets through at balanced ones",
            base="S_n",
            minimum=0.0,
        )
        positive, negative = declare_sequences(m, f, omega_b, w, _TAU)
        cut = m.state("cut", 0.0, "1", "Part of the current's limit that is taken away")
        present = m.state("present", 0.0, "pu", "Negative sequence behind a lag", base="S_n")
    size = negative.value.magnitude()
    m.derivative(present, (size - present) / _TAU)
    return PhaseLimit(cut, positive.value.magnitude() + size, present, I_max)

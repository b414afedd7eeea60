"""The end of a thyristor bridge: its supply, and a resistance that a negative field current goes through."""

from dataclasses import dataclass

from fmus.synchronous_generator.data_lines import number
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

FIELD_RESISTANCE = number(
    "r_C_over_r_FD", 0.0, "Resistance for negative field currents over the field's; 0: none", 0
)


@dataclass(frozen=True)
class Supply:
    """The voltage behind a bridge: the machine's terminal, or a supply of its own."""

    is_own: Expr

    @classmethod
    def declare(cls, m: ModelBuilder) -> "Supply":
        """Declare the switch between the two, ``own_supply``."""
        return cls(m.switch("own_supply", False, "It has a supply of its own, not the terminal"))

    def times(self, signal: Expr, v_t: Expr) -> Expr:
        """Return what the bridge gives at a signal [pu] and a terminal voltage [pu]."""
        return signal * if_else(self.is_own, 1, v_t)

    def signal_for(self, E_fd: Expr, v_t: Expr) -> Expr:
        """Return the signal [pu] that gives a field voltage [pu]."""
        return E_fd / if_else(self.is_own, 1, v_t)


def through_resistance(E_fd: Expr, I_fd: Expr, r_C_over_r_FD: Expr) -> Expr:
    """Return the field voltage [pu]: that of the bridge, or of the resistance while the field current is negative."""
    return if_else(logic_and(r_C_over_r_FD > 0, I_fd < 0), -r_C_over_r_FD * I_fd, E_fd)

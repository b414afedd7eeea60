"""Without a regulator of its own: a constant field voltage, as in manual excitation, or an exciter outside.

manual    E_fd = E_fd,0 + delta_E_fd
external  the field voltage is an input, and what a regulator measures is shown:
          v_t, I_fd, v_s ──► exciter of another component ──► exciter.E_fd"""

from fmus.synchronous_generator.excitation.common import Regulated
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr


def manual(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        E_0 = m.calculated(
            "E_fd_0", seen.start.E_fd, "pu", "Field voltage of the operating point", base="E_fd"
        )
        delta = m.parameter(
            "delta_E_fd", 0.0, "pu", "Change of the field voltage", base="E_fd", tunable=True
        )
    return E_0 + delta, seen.terminal_voltage(E_0 + delta)


def external(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        m.calculated(
            "E_fd_0", seen.start.E_fd, "pu", "Field voltage of the operating point", base="E_fd"
        )
        m.calculated(
            "v_t_0", seen.start.v_t, "pu", "Terminal voltage of the operating point", base="S_n"
        )
        E_fd = m.input("E_fd", "pu", "Field voltage that the exciter outside gives", base="E_fd")
        m.output(
            "I_fd",
            seen.I_fd,
            "pu",
            "Field current; equal to the field voltage in steady state",
            base="E_fd",
        )
        if isinstance(seen.v_s, Expr):
            m.output("v_s", seen.v_s, "pu", "Stabiliser's signal", base="S_n")
    return E_fd, seen.terminal_voltage(E_fd)

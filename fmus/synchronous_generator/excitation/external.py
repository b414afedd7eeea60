"""An exciter outside: the field voltage is an input, and what a regulator measures is shown.

v_t, I_fd, v_s ──► exciter of another component ──► exciter.E_fd"""

from fmus.synchronous_generator.excitation.common import TerminalVoltage
from fmus.synchronous_generator.machine import Start
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar


def external(
    m: ModelBuilder, start: Start, terminal_voltage: TerminalVoltage, I_fd: Expr, v_s: Scalar = 0.0
) -> tuple[Expr, Expr]:
    """Declare it and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        m.calculated("E_fd_0", start.E_fd, "pu", "Field voltage of the operating point", base="E_fd")
        m.calculated("v_t_0", start.v_t, "pu", "Terminal voltage of the operating point", base="S_n")
        E_fd = m.input("E_fd", "pu", "Field voltage that the exciter outside gives", base="E_fd")
        m.output("I_fd", I_fd, "pu", "Field current; equal to the field voltage in steady state", base="E_fd")
        if isinstance(v_s, Expr):
            m.output("v_s", v_s, "pu", "Stabiliser's signal", base="S_n")
    return E_fd, terminal_voltage(E_fd)

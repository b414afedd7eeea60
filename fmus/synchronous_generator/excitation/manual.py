"""No regulator: a constant field voltage, as in manual excitation.

E_fd = E_fd,0 + delta_E_fd"""

from fmus.synchronous_generator.excitation.common import TerminalVoltage
from fmus.synchronous_generator.machine import Start
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar


def manual(
    m: ModelBuilder, start: Start, terminal_voltage: TerminalVoltage, I_fd: Expr, v_s: Scalar = 0.0
) -> tuple[Expr, Expr]:
    """Declare it and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        E_0 = m.calculated("E_fd_0", start.E_fd, "pu", "Field voltage of the operating point", base="E_fd")
        delta = m.parameter("delta_E_fd", 0.0, "pu", "Change of the field voltage", base="E_fd", tunable=True)
    return E_0 + delta, terminal_voltage(E_0 + delta)

"""SEXS, the simplified excitation system of stability programs.

                ┌─────────┐   ┌─────────┐ E_MAX
V_ref + V_S ─►(+)►│ 1 + s·T_A │─►│    K    │──► E_fd
               ▲−│ 1 + s·T_B │  │ 1 + s·T_E │
              v_m└─────────┘   └─────────┘ E_MIN     (the lag stops at its limits)
"""

from fmus.synchronous_generator.excitation.common import Measurement, TerminalVoltage, gain, require_within, time
from fmus.synchronous_generator.machine import Start
from fmus.toolchain.blocks import lead_lag, limited_low_pass
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, if_else, logic_and


def sexs(
    m: ModelBuilder, start: Start, terminal_voltage: TerminalVoltage, I_fd: Expr, v_s: Scalar = 0.0
) -> tuple[Expr, Expr]:
    """Declare it and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        K = gain(m, "K", 100.0, "Gain", 1e-3)
        T_A = time(m, "T_A", 1.0, "Lead")
        T_B = time(m, "T_B", 10.0, "Lag; 0 leaves the stage out")
        T_E = time(m, "T_E", 0.05, "Exciter; 0 leaves the lag out")
        low, high = gain(m, "E_MIN", 0.0, "Lower ceiling of E_fd"), gain(m, "E_MAX", 5.0, "Upper ceiling of E_fd")
        m.require(if_else(logic_and(T_B <= 0, T_A > 0), -1, 1), "exciter.T_B = 0 needs exciter.T_A = 0 as well")
        require_within(m, start.E_fd, low, high, ("exciter.E_MIN", "exciter.E_MAX"))
        measured = Measurement(m, start, terminal_voltage, I_fd)
        error = measured.error(start.E_fd / K, v_s)
        compensated = lead_lag(m, "lead_lag", error, T_A, T_B, start.E_fd / K)
        return measured.close(limited_low_pass(m, "amplifier", K * compensated, T_E, low, high, start.E_fd))

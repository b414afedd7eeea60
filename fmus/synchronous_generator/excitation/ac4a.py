"""AC4A: an alternator with a controlled rectifier.

V_IMIN ≤ V_ref + V_S − v_m ≤ V_IMAX → (1+sT_C)/(1+sT_B) → K_A/(1+sT_A) = E_fd,
held within V_RMIN and V_RMAX − K_C·I_FD"""

from fmus.synchronous_generator.excitation.common import (
    Measurement,
    TerminalVoltage,
    gain,
    lead_lag_stage,
    require_within,
    time,
)
from fmus.synchronous_generator.machine import Start
from fmus.toolchain.blocks import clamp, limited_low_pass
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax


def ac4a(
    m: ModelBuilder, start: Start, terminal_voltage: TerminalVoltage, I_fd: Expr, v_s: Scalar = 0.0
) -> tuple[Expr, Expr]:
    """Declare it and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        K_A, T_A = gain(m, "K_A", 200.0, "Gain", 1e-3), time(m, "T_A", 0.015, "Amplifier; 0 leaves the lag out")
        I_high, I_low = gain(m, "V_IMAX", 10.0, "Upper limit of the error"), gain(m, "V_IMIN", -10.0, "Lower one")
        high, low = gain(m, "V_RMAX", 5.64, "Upper ceiling of E_fd"), gain(m, "V_RMIN", -4.53, "Lower ceiling of E_fd")
        K_C = gain(m, "K_C", 0.0, "Rectifier loading factor", 0)
        V_I0 = start.E_fd / K_A
        require_within(m, V_I0, I_low, I_high, ("exciter.V_IMIN", "exciter.V_IMAX"))
        require_within(m, start.E_fd, low, high - K_C * start.E_fd, ("exciter.V_RMIN", "exciter.V_RMAX"))
        measured = Measurement(m, start, terminal_voltage, I_fd)
        error = clamp(measured.error(V_I0, v_s), I_low, I_high)
        compensated = lead_lag_stage(m, error, V_I0, lead=1.0)
        ceiling = fmax(high - K_C * I_fd, low)
        return measured.close(limited_low_pass(m, "amplifier", K_A * compensated, T_A, low, ceiling, start.E_fd))

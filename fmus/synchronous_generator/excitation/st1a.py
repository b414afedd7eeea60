"""ST1A: a controlled rectifier fed from the machine's terminal, with a limiter of the field current.

    V_IMIN ≤ V_ref + V_S − v_m − V_F ≤ V_IMAX → (1+sT_C)/(1+sT_B) → (1+sT_C1)/(1+sT_B1)
    → K_A/(1+sT_A) = V_A, held within V_AMIN and V_AMAX → V_A − K_LR·(I_FD − I_LR), only above I_LR = E_fd,
    v_t·V_RMIN ≤ E_fd ≤ v_t·V_RMAX − K_C·I_FD,   V_F = s·K_F/(1+sT_F)·E_fd

The ceilings take v_t from two fixed-point passes, because v_t, behind the transformer, depends weakly on E_fd."""

from fmus.synchronous_generator.excitation.common import (
    Measurement,
    TerminalVoltage,
    gain,
    lead_lag_stage,
    rate_feedback,
    require_within,
    time,
)
from fmus.synchronous_generator.machine import Start
from fmus.toolchain.blocks import clamp, close_limited_low_pass
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, if_else, logic_and


def st1a(
    m: ModelBuilder, start: Start, terminal_voltage: TerminalVoltage, I_fd: Expr, v_s: Scalar = 0.0
) -> tuple[Expr, Expr]:
    """Declare it and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        K_A, T_A = gain(m, "K_A", 200.0, "Gain", 1e-3), time(m, "T_A", 0.0, "Amplifier; 0 leaves the lag out")
        I_high, I_low = gain(m, "V_IMAX", 999.0, "Upper limit of the error"), gain(m, "V_IMIN", -999.0, "Lower one")
        A_high, A_low = gain(m, "V_AMAX", 999.0, "Upper limit of V_A"), gain(m, "V_AMIN", -999.0, "Lower limit of V_A")
        high = gain(m, "V_RMAX", 6.43, "Upper ceiling of E_fd at v_t = 1")
        low = gain(m, "V_RMIN", -6.0, "Lower ceiling of E_fd at v_t = 1")
        K_C = gain(m, "K_C", 0.0, "Rectifier loading factor", 0)
        K_LR = gain(m, "K_LR", 0.0, "Gain of the field current's limiter; 0 leaves it out", 0)
        I_LR = gain(m, "I_LR", 0.0, "Field current where the limiter starts")

        def relieved(field_current: Expr) -> Expr:
            return K_LR * fmax(field_current - I_LR, 0)

        def held(signal: Expr, v_t: Expr) -> Expr:
            floor = v_t * low
            return clamp(signal - relieved(I_fd), floor, fmax(v_t * high - K_C * I_fd, floor))

        V_A0 = start.E_fd + relieved(start.E_fd)
        V_I0 = V_A0 / K_A
        require_within(m, V_I0, I_low, I_high, ("exciter.V_IMIN", "exciter.V_IMAX"))
        require_within(m, V_A0, A_low, A_high, ("exciter.V_AMIN", "exciter.V_AMAX"))
        ceiling = start.v_t * high - K_C * start.E_fd
        require_within(m, start.E_fd, start.v_t * low, ceiling, ("exciter.V_RMIN", "exciter.V_RMAX"))
        measured = Measurement(m, start, terminal_voltage, I_fd)
        amplifier = m.state("amplifier", V_A0, "pu", "first-order lag with limits", base="E_fd")
        V_F, K_F = rate_feedback(m, held(clamp(amplifier, A_low, A_high), measured.nearly), start.E_fd)
        m.require(if_else(logic_and(K_F > 0, T_A <= 0), -1, 1), "exciter.K_F > 0 needs exciter.T_A > 0")
        error = clamp(measured.error(V_I0, v_s) - V_F, I_low, I_high)
        error = lead_lag_stage(m, error, V_I0)
        error = lead_lag_stage(m, error, V_I0, mark="1")
        V_A = close_limited_low_pass(m, amplifier, K_A * error, T_A, A_low, A_high)
        E_fd = held(V_A, terminal_voltage(held(V_A, measured.nearly)))
        return measured.close(E_fd)

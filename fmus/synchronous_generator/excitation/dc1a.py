"""DC1A and IEEE type 1 (IEEET1): a regulated commutator exciter with saturation and rate feedback.

    V_ref + V_S − v_m − V_F → (1+sT_C)/(1+sT_B) → K_A/(1+sT_A) = V_R, held within V_RMIN and V_RMAX
    T_E·dE_fd/dt = V_R − K_E·E_fd − S_E(E_fd)·E_fd
    V_F = s·K_F/(1+sT_F)·E_fd

IEEET1 has no stage (1+sT_C)/(1+sT_B)."""

from functools import partial

from fmus.synchronous_generator.excitation.common import (
    Measurement,
    Regulated,
    exciter_saturation,
    gain,
    lead_lag_stage,
    rate_feedback,
    require_within,
    time,
)
from fmus.toolchain.blocks import limited_low_pass
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr


def dc1a(m: ModelBuilder, seen: Regulated, *, compensated: bool = True) -> tuple[Expr, Expr]:
    """Declare it and return (E_fd, |v_t|) [pu].

    ``compensated``: whether it has the stage (1+sT_C)/(1+sT_B)."""
    with m.scope("exciter"):
        K_A, T_A = gain(m, "K_A", 20.0, "Gain", 1e-3), time(m, "T_A", 0.2, "Amplifier; 0 leaves the lag out")
        high, low = gain(m, "V_RMAX", 5.0, "Upper limit of V_R"), gain(m, "V_RMIN", -5.0, "Lower limit of V_R")
        K_E = gain(m, "K_E", 1.0, "Field resistance, separately excited")
        T_E = time(m, "T_E", 0.314, "Exciter's field", 1e-3)
        curve = exciter_saturation(m, 3.0, 0.41, 4.0, 1.96)
        V_R0 = K_E * seen.start.E_fd + curve.part(seen.start.E_fd)
        require_within(m, V_R0, low, high, ("exciter.V_RMIN", "exciter.V_RMAX"))
        E_fd = m.state("E", seen.start.E_fd, "pu", "Field voltage", base="E_fd")
        V_F, _ = rate_feedback(m, E_fd, seen.start.E_fd, 0.063, 0.35)
        measured = Measurement(m, seen)
        error = measured.error(V_R0 / K_A) - V_F
        if compensated:
            error = lead_lag_stage(m, error, V_R0 / K_A)
        V_R = limited_low_pass(m, "amplifier", K_A * error, T_A, low, high, V_R0)
        m.derivative(E_fd, (V_R - K_E * E_fd - curve.part(E_fd)) / T_E)
        return measured.close(E_fd)


ieeet1 = partial(dc1a, compensated=False)  # DC1A without its lead and lag

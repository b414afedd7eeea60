"""EXNI of NVE (Type NI), a thyristor bridge at the machine's terminal, or one with a supply of its own:

    V_ref + V_S − v_m − V_F → K_A/(1+sT_A) = V_R, held within V_RMIN and V_RMAX (non-windup)
    V_F = s·K_F/((1+sT_F1)(1+sT_F2))·V_R
    E_fd = V_R·v_t; V_R with a supply of its own

With r_C/r_FD > 0 a negative field current goes through that resistance instead, E_fd = −r_C/r_FD·I_FD.

Source: PSS/E's block diagram as OpenIPSL (``PSSE/ES/EXNI.mo``) has it, but for its limits, which stand behind the lag
there; two fixed-point passes take v_t, which depends, behind the transformer, weakly on E_fd."""

from fmus.synchronous_generator.data_lines import declared, number, pu, seconds
from fmus.synchronous_generator.excitation.bridge_supply import (
    FIELD_RESISTANCE,
    Supply,
    through_resistance,
)
from fmus.synchronous_generator.excitation.common import (
    SOURCE,
    Measurement,
    Regulated,
    lag_of_feedback,
    require_within,
)
from fmus.toolchain.blocks import limited_low_pass
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr

EXNI = (
    number("K_A", 150.0, "Gain", 1e-3),
    seconds("T_A", 0.0, "Amplifier; 0 leaves the lag out"),
    pu("V_RMAX", 4.0, "Upper limit of V_R"),
    pu("V_RMIN", -4.0, "Lower limit of V_R"),
    number("K_F", 0.011, "Gain of the rate feedback", 0),
    seconds("T_F1", 0.4, "First lag of the rate feedback"),
    seconds("T_F2", 0.7, "Second lag of the rate feedback"),
    FIELD_RESISTANCE,
)


def exni(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p = declared(m, EXNI, SOURCE)
        supply = Supply.declare(m)
        V_R0 = supply.signal_for(seen.start.E_fd, seen.start.v_t)
        require_within(m, V_R0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        measured = Measurement(m, seen)
        lagged = m.state("feedback_lag", V_R0, "pu", "V_R behind T_F2", base="E_fd")
        washed = m.state("feedback_washout", V_R0, "pu", "V_R behind T_F2 and T_F1", base="E_fd")
        T_F1, T_F2 = (lag_of_feedback(m, T, p.K_F) for T in (p.T_F1, p.T_F2))
        V_F = p.K_F / T_F1 * (lagged - washed)
        error = measured.error(V_R0 / p.K_A) - V_F
        V_R = limited_low_pass(
            m, "amplifier", p.K_A * error, p.T_A, p.V_RMIN, p.V_RMAX, initial=V_R0
        )
        m.derivative(lagged, (V_R - lagged) / T_F2)
        m.derivative(washed, (lagged - washed) / T_F1)
        E = supply.times(V_R, seen.terminal_voltage(supply.times(V_R, measured.nearly)))
        return measured.close(through_resistance(E, seen.I_fd, p.r_C_over_r_FD))

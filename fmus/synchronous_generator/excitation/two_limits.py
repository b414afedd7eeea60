"""BBSEX1, a rectifier fed from the machine's terminal behind a regulator whose limit stops its timing circuit:

    V_ref + V_S − v_m → (1+sT_3)/(1+sT_4) → K·(1+sT_2)/(1+sT_1) = V_R, held within V_RMIN and V_RMAX
    v_t·E_FDMIN ≤ E_fd = V_R ≤ v_t·E_FDMAX

The second lead/lag is a gain with V_R itself, through 1/(1+sT_2), as feedback, so that its state follows V_R while that
stands at a limit. With signal_at_output V_S is added to V_R, behind its limits, and not to the error.

Sources: Dynawo's BbSex1 (2024), the colib of CRESYM, and InterPSS (the record's eleven fields, and where V_S goes)."""

from fmus.synchronous_generator.data_lines import declared, number, pu, seconds
from fmus.synchronous_generator.excitation.common import (
    SOURCE,
    Measurement,
    Regulated,
    require_within,
)
from fmus.toolchain.blocks import clamp, lead_lag
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

BBSEX1 = (
    number("K", 200.0, "Gain", 1e-3),
    seconds("T_1", 6.0, "Lag of the regulator", 1e-3),
    seconds("T_2", 1.0, "Lead of the regulator", 1e-3),
    seconds("T_3", 0.05, "Lead in front of it"),
    seconds("T_4", 0.02, "Lag in front of it; 0 leaves the stage out"),
    pu("V_RMAX", 5.0, "Upper limit of the regulator"),
    pu("V_RMIN", -5.0, "Lower limit of the regulator"),
    pu("E_FDMAX", 5.0, "Upper ceiling of E_fd at v_t = 1"),
    pu("E_FDMIN", -5.0, "Lower ceiling of E_fd at v_t = 1"),
)


def bbsex1(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, E_0, v_0 = declared(m, BBSEX1, SOURCE), seen.start.E_fd, seen.start.v_t
        behind = m.switch(
            "signal_at_output", False, "The stabiliser's signal is added behind the regulator"
        )
        m.require(
            if_else(logic_and(p.T_4 <= 0, p.T_3 > 0), -1, 1),
            "exciter.T_4 = 0 needs exciter.T_3 = 0 as well",
        )
        require_within(m, E_0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        ceilings = v_0 * p.E_FDMIN, v_0 * p.E_FDMAX
        require_within(m, E_0, *ceilings, ("exciter.E_FDMIN", "exciter.E_FDMAX"))

        measured = Measurement(m, seen)
        signal = behind * Expr(seen.v_s)
        error = measured.error(E_0 / p.K) - signal
        before = lead_lag(m, "lead_lag", error, p.T_3, p.T_4, E_0 / p.K)
        slow = m.state("regulator", E_0, "pu", "Regulator's output through T_2", base="E_fd")
        V_R = clamp(slow + p.T_2 / p.T_1 * (p.K * before - slow), p.V_RMIN, p.V_RMAX)
        m.derivative(slow, (V_R - slow) / p.T_2)

        def bound(v_t: Expr) -> Expr:
            return clamp(V_R + signal, v_t * p.E_FDMIN, v_t * p.E_FDMAX)

        return measured.close(bound(seen.terminal_voltage(bound(measured.nearly))))

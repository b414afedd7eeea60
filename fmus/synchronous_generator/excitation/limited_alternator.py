"""ESAC2A, ESAC3A and EXAC3: field-controlled alternators with a rectifier, the first two limited by their field.

Behind the rectifier is the alternator of `alternator`; its V_E ends at (V_FEMAX − K_D·I_FD)/(K_E + S_E). ESAC2A has a
feedback of the field's current and is EXAC2 but for that limit; a limiter of underexcitation acts before V_RMIN:

    V_ref + V_S − v_m − V_F → (1+sT_C)/(1+sT_B) → K_A/(1+sT_A) = V_A, held within V_AMIN and V_AMAX
    V_R = K_B·(V_A − K_H·V_FE), within V_RMIN and V_RMAX,  V_F = s·K_F/(1+sT_F)·V_FE,  V_E ≥ 0

ESAC3A feeds its regulator itself, and its rate feedback has two gains; a limiter acts behind the lead and lag:

    V_ref + V_S − v_m → (1+sT_C)/(1+sT_B) → − V_F → K_A/(1+sT_A) = V_A, held within V_AMIN and V_AMAX
    V_R = K_R·E_fd·V_A,  V_F = s/(1+sT_F) of K_F·E_fd up to E_FDN, and of K_N·E_fd beyond,  V_E ≥ V_EMIN

EXAC3, of 1981, has its rate feedback before the lead and lag, and a limiter of low field voltages behind them instead:

    V_ref + V_S − v_m − V_F → (1+sT_C)/(1+sT_B), at least K_LV·(V_LV − E_fd) → K_A/(1+sT_A) = V_A …,  V_E ≥ 0

Sources: OpenIPSL at 2be0558a (ESAC2A), OPAL-RT's ephasorsim-modelica-library at cba975b8 (all), IEEE 421.5.
OpenIPSL's EXAC3 at c482ff5b has K_F beyond E_FDN; its own texts, OPAL-RT's library and the standard have it below."""

from fmus.synchronous_generator.data_lines import Given, declared, pu, seconds
from fmus.synchronous_generator.excitation.alternator import EXAC2, alternator
from fmus.synchronous_generator.excitation.common import (
    BEFORE,
    BEHIND,
    SOURCE,
    Measurement,
    Regulated,
    lag_of_feedback,
    lead_lag_stage,
    rate_feedback,
    require_within,
)
from fmus.toolchain.blocks import clamp, limited_low_pass
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, fmin

ESAC2A = (
    *(line for line in EXAC2 if line.name not in ("K_L", "V_LR")),
    pu("V_FEMAX", 14.0, "Highest field current, as V_FE"),
)
ESAC3A = (
    pu("K_A", 45.62, "Gain", 1e-3),
    seconds("T_A", 0.013, "Amplifier; 0 leaves the lag out"),
    pu("V_AMAX", 1.0, "Upper limit of V_A"),
    pu("V_AMIN", -0.95, "Lower limit of V_A"),
    pu("V_EMIN", 0.0, "Lower limit of V_E", 0),
    pu("K_R", 3.77, "Constant of the regulator's supply", 1e-3),
    pu("K_F", 0.143, "Rate feedback of E_fd up to E_FDN; 0 leaves it out", 0),
    seconds("T_F", 1.0, "Lag of the rate feedback"),
    pu("K_N", 0.05, "Rate feedback of E_fd beyond E_FDN", 0),
    pu("E_FDN", 2.36, "Field voltage at which the rate feedback changes"),
    pu("V_FEMAX", 16.0, "Highest field current, as V_FE"),
)
EXAC3 = (
    pu("K_LV", 0.167, "Gain of the limiter of low field voltages", 0),
    pu("V_LV", 0.46, "Field voltage from which downward that limiter acts"),
    *(line for line in ESAC3A if line.name not in ("V_EMIN", "V_FEMAX")),
)


def esac2a(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, behind = declared(m, ESAC2A, SOURCE), alternator(m, seen)
        V_R0 = behind.V_FE_0
        V_A0 = V_R0 / p.K_B + p.K_H * V_R0
        require_within(m, V_A0, p.V_AMIN, p.V_AMAX, ("exciter.V_AMIN", "exciter.V_AMAX"))
        require_within(m, V_R0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        V_F, _ = rate_feedback(m, behind.V_FE, V_R0, 0.03, 1.0)
        measured = Measurement(m, seen)
        error = lead_lag_stage(m, measured.error(V_A0 / p.K_A) - V_F, V_A0 / p.K_A)
        V_A = limited_low_pass(
            m, "amplifier", p.K_A * error, p.T_A, p.V_AMIN, p.V_AMAX, initial=V_A0
        )
        driven = seen.lifted(p.K_B * (V_A - p.K_H * behind.V_FE), BEHIND, V_R0)
        behind.drive_up_to(p.V_FEMAX, clamp(driven, p.V_RMIN, p.V_RMAX))
        return measured.close(behind.E_fd)


def esac3a(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, behind, E_0 = declared(m, ESAC3A, SOURCE), alternator(m, seen), seen.start.E_fd
        V_A0 = behind.V_FE_0 / (p.K_R * E_0)
        require_within(m, V_A0, p.V_AMIN, p.V_AMAX, ("exciter.V_AMIN", "exciter.V_AMAX"))
        E_fd = behind.E_fd
        V_F = _rate_feedback_of_two_gains(m, p, E_fd, E_0)
        measured = Measurement(m, seen)
        error = lead_lag_stage(m, measured.error(V_A0 / p.K_A), V_A0 / p.K_A)
        rest = seen.lifted(error, BEFORE, V_A0 / p.K_A) - V_F
        V_A = limited_low_pass(
            m, "amplifier", p.K_A * rest, p.T_A, p.V_AMIN, p.V_AMAX, initial=V_A0
        )
        behind.drive_up_to(p.V_FEMAX, p.K_R * E_fd * V_A, p.V_EMIN)
        return measured.close(E_fd)


def exac3(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, behind, E_0 = declared(m, EXAC3, SOURCE), alternator(m, seen), seen.start.E_fd
        V_A0 = behind.V_FE_0 / (p.K_R * E_0)
        require_within(m, V_A0, p.V_AMIN, p.V_AMAX, ("exciter.V_AMIN", "exciter.V_AMAX"))
        m.require(
            V_A0 / p.K_A - p.K_LV * (p.V_LV - E_0),
            "exciter.V_LV: the operating point lies where the limiter of low field voltages acts; lower it",
        )
        E_fd = behind.E_fd
        V_F = _rate_feedback_of_two_gains(m, p, E_fd, E_0)
        measured = Measurement(m, seen)
        error = lead_lag_stage(m, measured.error(V_A0 / p.K_A) - V_F, V_A0 / p.K_A)
        raised = fmax(error, p.K_LV * (p.V_LV - E_fd))
        V_A = limited_low_pass(
            m, "amplifier", p.K_A * raised, p.T_A, p.V_AMIN, p.V_AMAX, initial=V_A0
        )
        behind.drive(p.K_R * E_fd * V_A)
        return measured.close(E_fd)


def _rate_feedback_of_two_gains(m: ModelBuilder, p: Given, E_fd: Expr, E_0: Expr) -> Expr:
    """Declare s/(1+sT_F) of the field voltage, weighed by K_F up to E_FDN and by K_N beyond."""

    def weighed(E: Expr) -> Expr:
        return p.K_F * fmin(E, p.E_FDN) + p.K_N * fmax(E - p.E_FDN, 0)

    x = m.state("feedback", weighed(E_0), "pu", "rate feedback, slow part", base="E_fd")
    V_F = (weighed(E_fd) - x) / lag_of_feedback(m, p.T_F, p.K_F + p.K_N)
    m.derivative(x, V_F)
    return V_F

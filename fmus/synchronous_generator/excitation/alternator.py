"""EXAC2, ESAC6A, AC8B and EXBAS: alternators with a rotating rectifier, field-controlled.

What they share is the alternator behind the rectifier, driven by V_R:

    T_E·dV_E/dt = V_R − V_FE,  V_E within its limits,  V_FE = (K_E + S_E(V_E))·V_E + K_D·I_FD
    E_fd = V_E·F_EX(K_C·I_FD/V_E)

EXAC2 has a feedback and a limiter of the field's current, as a low-value gate (LV) on voltages:

    V_ref + V_S − v_m − V_F → (1+sT_C)/(1+sT_B) → K_A/(1+sT_A) = V_A, held within V_AMIN and V_AMAX
    V_R = K_B·LV(V_A − K_H·V_FE, K_L·(V_LR − V_FE)), within V_RMIN and V_RMAX,  V_F = s·K_F/(1+sT_F)·V_FE

ESAC6A has a limiter of the field's current behind a lead/lag:

    V_ref + V_S − v_m → K_A·(1+sT_K)/(1+sT_A) → (1+sT_C)/(1+sT_B), within V_AMIN and V_AMAX → − V_H
    v_t·V_RMIN ≤ V_R ≤ v_t·V_RMAX,  V_H = (1+sT_J)/(1+sT_H) of K_H·(V_FE − V_FELIM) within 0 and V_HMAX

AC8B has a PID controller, and limits of V_E by the field's current; ESAC8B is the same without a rectifier:

    V_ref + V_S − v_m → K_PR + K_IR/s + s·K_DR/(1+sT_DR), within V_PIDMIN and V_PIDMAX
    → K_A/(1+sT_A) = V_R, held within V_RMIN and V_RMAX,  V_EMIN ≤ V_E ≤ (V_FEMAX − K_D·I_FD)/(K_E + S_E)

EXBAS has a PI controller, and a rate feedback of V_R with a lead and a lag:

    V_ref + V_S − v_m − V_F → K_PR + K_IR/s → (1+sT_C)/(1+sT_B) → K_A/(1+sT_A) = V_R, held within V_RMIN and V_RMAX
    V_F = s·K_F·(1+sT_F1)/((1+sT_F)·(1+sT_F2))·V_R

Sources: OpenIPSL at 2be0558a (EXAC2, AC8B, EXBAS), ANDES 2.0.0 (EXAC2, AC8B), IEEE 421.5 (AC6A)."""

from dataclasses import dataclass

from fmus.synchronous_generator.data_lines import Given, declared, number, pu, seconds
from fmus.synchronous_generator.excitation.common import (
    SOURCE,
    Controller,
    ExciterSaturation,
    Measurement,
    Regulated,
    exciter_saturation,
    lead_lag_stage,
    rate_feedback,
    rectifier,
    require_within,
    voltage_before_rectifier,
)
from fmus.toolchain.blocks import (
    clamp,
    close_limited_low_pass,
    held_at_limits,
    lead_lag,
    limited_low_pass,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and

_MOST = 1e9  # no upper limit of V_E [pu]
_LEAST = 1e-3  # smallest V_E [pu], and smallest K_E + S_E, that something is divided by

ALTERNATOR = (
    pu("K_E", 1.0, "Exciter constant"),
    seconds("T_E", 0.8, "Exciter's field", 1e-3),
    pu("K_C", 0.2, "Rectifier loading factor", 0),
    pu("K_D", 0.38, "Demagnetising factor", 0),
)
EXAC2 = (
    pu("K_A", 400.0, "Gain", 1e-3),
    seconds("T_A", 0.02, "Amplifier; 0 leaves the lag out"),
    pu("V_AMAX", 9.0, "Upper limit of V_A"),
    pu("V_AMIN", -5.43, "Lower limit of V_A"),
    pu("K_B", 1.0, "Gain of the second stage", 1e-3),
    pu("V_RMAX", 9.0, "Upper limit of V_R"),
    pu("V_RMIN", -5.43, "Lower limit of V_R"),
    pu("K_L", 10.0, "Gain of the field current's limiter", 0),
    pu("K_H", 0.0, "Feedback of the field current", 0),
    pu("V_LR", 99.0, "Field current that the limiter holds, as V_FE"),
)
ESAC6A = (
    pu("K_A", 536.0, "Gain", 1e-3),
    seconds("T_A", 0.086, "Amplifier, lag; 0 leaves the stage out"),
    seconds("T_K", 0.18, "Amplifier, lead"),
    pu("V_AMAX", 75.0, "Upper limit of V_A"),
    pu("V_AMIN", -75.0, "Lower limit of V_A"),
    pu("V_RMAX", 44.0, "Upper limit of V_R at v_t = 1"),
    pu("V_RMIN", -36.0, "Lower limit of V_R at v_t = 1"),
    pu("V_FELIM", 19.0, "Field current where the limiter starts, as V_FE"),
    pu("K_H", 92.0, "Gain of the limiter", 0),
    pu("V_HMAX", 75.0, "Upper limit of V_H", 0),
    seconds("T_H", 0.08, "Limiter, lag; 0 leaves the stage out"),
    seconds("T_J", 0.02, "Limiter, lead"),
)
AC8B = (
    pu("K_PR", 100.0, "Proportional gain", 0),
    number("K_IR", 5.0, "Integral gain", 0, "1/s"),
    number("K_DR", 10.0, "Derivative gain", 0, "s"),
    seconds("T_DR", 0.1, "Lag of the derivative; 0 leaves the derivative out"),
    pu("V_PIDMAX", 999.0, "Upper limit of the controller"),
    pu("V_PIDMIN", -999.0, "Lower limit of the controller"),
    pu("K_A", 1.0, "Gain", 1e-3),
    seconds("T_A", 0.0, "Amplifier; 0 leaves the lag out"),
    pu("V_RMAX", 35.0, "Upper limit of V_R"),
    pu("V_RMIN", 0.0, "Lower limit of V_R"),
    pu("V_FEMAX", 999.0, "Highest field current, as V_FE"),
    pu("V_EMIN", 0.0, "Lower limit of V_E", 0),
)
EXBAS = (
    pu("K_PR", 1.0, "Proportional gain", 0),
    number("K_IR", 0.0, "Integral gain", 0, "1/s"),
    pu("K_A", 355.0, "Gain", 1e-3),
    seconds("T_A", 0.01, "Amplifier; 0 leaves the lag out"),
    pu("V_RMAX", 8.33, "Upper limit of V_R"),
    pu("V_RMIN", -6.66, "Lower limit of V_R"),
    seconds("T_F1", 0.043, "Lead of the rate feedback"),
    seconds("T_F2", 0.19, "Second lag of the rate feedback; 0 leaves the stage out"),
)


@dataclass(frozen=True)
class Alternator:
    """An alternator and its rectifier; the state is V_E."""

    m: ModelBuilder
    seen: Regulated
    p: Given
    curve: ExciterSaturation
    state: Expr
    V_E_0: Expr
    V_FE_0: Expr

    @property
    def V_E(self) -> Expr:
        """Voltage before the rectifier [pu]; it does not turn round."""
        return fmax(self.state, 0)

    @property
    def V_FE(self) -> Expr:
        """The exciter's field current [pu], as the voltage that holds it."""
        return self.p.K_E * self.V_E + self.curve.part(self.V_E) + self.p.K_D * self.seen.I_fd

    @property
    def constant(self) -> Expr:
        """K_E + S_E(V_E) [pu]."""
        return self._constant(self.V_E)

    @property
    def constant_0(self) -> Expr:
        """K_E + S_E(V_E) [pu] in steady state."""
        return self._constant(self.V_E_0)

    @property
    def E_fd(self) -> Expr:
        """Field voltage of the machine [pu]."""
        return self.V_E * rectifier(self.p.K_C * self.seen.I_fd / fmax(self.V_E, _LEAST))

    def _constant(self, V_E: Expr) -> Expr:
        return self.p.K_E + self.curve.part(V_E) / fmax(V_E, _LEAST)

    def drive(self, V_R: Expr, low: Scalar = 0.0, high: Scalar = _MOST) -> None:
        """Close V_E, driven by V_R, within its limits."""
        rate = (V_R - self.V_FE) / self.p.T_E
        self.m.derivative(self.state, held_at_limits(self.state, rate, low, high))

    def drive_up_to(self, V_FEMAX: Expr, V_R: Expr, V_EMIN: Expr | None = None) -> None:
        """Close V_E, driven by V_R, from V_EMIN or 0 to where the field current is V_FEMAX; the start lies between."""
        self.m.require(
            V_FEMAX - self.V_FE_0,
            "exciter.V_FEMAX must exceed the exciter's field current at the start",
        )
        low: Scalar = 0.0
        if V_EMIN is not None:
            low = V_EMIN
            names = ("exciter.V_EMIN", "exciter.V_EMIN")
            require_within(self.m, self.V_E_0, low, _MOST, names)
        highest = (V_FEMAX - self.p.K_D * self.seen.I_fd) / fmax(self.constant, _LEAST)
        self.drive(V_R, low, fmax(highest, low))


def alternator(m: ModelBuilder, seen: Regulated) -> Alternator:
    """Declare it at the operating point."""
    p = declared(m, ALTERNATOR, SOURCE)
    curve = exciter_saturation(m, 4.18, 0.1, 3.14, 0.03)
    E_0 = seen.start.E_fd
    V_E_0 = voltage_before_rectifier(E_0, p.K_C * E_0)
    V_FE_0 = p.K_E * V_E_0 + curve.part(V_E_0) + p.K_D * E_0
    state = m.state("V_E", V_E_0, "pu", "Voltage before the rectifier", base="E_fd")
    return Alternator(m=m, seen=seen, p=p, curve=curve, state=state, V_E_0=V_E_0, V_FE_0=V_FE_0)


def exac2(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, behind = declared(m, EXAC2, SOURCE), alternator(m, seen)
        V_R0 = behind.V_FE_0
        V_A0 = V_R0 / p.K_B + p.K_H * V_R0
        require_within(m, V_A0, p.V_AMIN, p.V_AMAX, ("exciter.V_AMIN", "exciter.V_AMAX"))
        require_within(m, V_R0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        m.require(
            p.K_L * (p.V_LR - V_R0) - V_R0 / p.K_B,
            "exciter.V_LR: the operating point of the power flow lies at or above what the field current's limiter "
            "holds; raise it, or lower the generator's reactive power",
        )
        V_F, _ = rate_feedback(m, behind.V_FE, V_R0, 0.03, 1.0)
        measured = Measurement(m, seen)
        error = lead_lag_stage(m, measured.error(V_A0 / p.K_A) - V_F, V_A0 / p.K_A)
        V_A = limited_low_pass(
            m, "amplifier", p.K_A * error, p.T_A, p.V_AMIN, p.V_AMAX, initial=V_A0
        )
        gate = fmin(V_A - p.K_H * behind.V_FE, p.K_L * (p.V_LR - behind.V_FE))
        behind.drive(clamp(p.K_B * gate, p.V_RMIN, p.V_RMAX))
        return measured.close(behind.E_fd)


def esac6a(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, behind = declared(m, ESAC6A, SOURCE), alternator(m, seen)
        V_R0, v_0 = behind.V_FE_0, seen.start.v_t
        V_H0 = clamp(p.K_H * (V_R0 - p.V_FELIM), 0, p.V_HMAX)
        V_A0 = V_R0 + V_H0
        require_within(m, V_A0, p.V_AMIN, p.V_AMAX, ("exciter.V_AMIN", "exciter.V_AMAX"))
        limits = v_0 * p.V_RMIN, v_0 * p.V_RMAX
        require_within(m, V_R0, *limits, ("exciter.V_RMIN", "exciter.V_RMAX"))
        measured = Measurement(m, seen)
        error = measured.error(V_A0 / p.K_A)
        amplified = lead_lag(m, "amplifier", p.K_A * error, p.T_K, p.T_A, V_A0)
        V_A = clamp(lead_lag_stage(m, amplified, V_A0), p.V_AMIN, p.V_AMAX)
        above = clamp(p.K_H * (behind.V_FE - p.V_FELIM), 0, p.V_HMAX)
        V_H = lead_lag(m, "limiter", above, p.T_J, p.T_H, V_H0)
        v_t = seen.terminal_voltage(behind.E_fd)
        behind.drive(clamp(V_A - V_H, v_t * p.V_RMIN, v_t * p.V_RMAX))
        return measured.close(behind.E_fd)


def ac8b(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, behind = declared(m, AC8B, SOURCE), alternator(m, seen)
        V_R0 = behind.V_FE_0
        PID_0 = V_R0 / p.K_A
        require_within(m, V_R0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        require_within(m, PID_0, p.V_PIDMIN, p.V_PIDMAX, ("exciter.V_PIDMIN", "exciter.V_PIDMAX"))
        measured = Measurement(m, seen)
        control = Controller(m, p, PID_0, (p.V_PIDMIN, p.V_PIDMAX))
        PID = control(measured.error(control.error_at_start))
        V_R = limited_low_pass(m, "amplifier", p.K_A * PID, p.T_A, p.V_RMIN, p.V_RMAX, initial=V_R0)
        behind.drive_up_to(p.V_FEMAX, V_R, p.V_EMIN)
        return measured.close(behind.E_fd)


def exbas(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, behind = declared(m, EXBAS, SOURCE), alternator(m, seen)
        V_R0 = behind.V_FE_0
        PI_0 = V_R0 / p.K_A
        require_within(m, V_R0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        amplifier = m.state("amplifier", V_R0, "pu", "first-order lag with limits", base="E_fd")
        V_R = clamp(amplifier, p.V_RMIN, p.V_RMAX)
        fast, K_F = rate_feedback(m, V_R, V_R0, 0.029, 2.6)
        V_F = lead_lag(m, "feedback_2", fast, p.T_F1, p.T_F2)
        m.require(
            if_else(logic_and(K_F > 0, p.T_A <= 0), -1, 1), "exciter.K_F > 0 needs exciter.T_A > 0"
        )
        m.require(
            if_else(logic_and(p.T_F2 <= 0, p.T_F1 > 0), -1, 1),
            "exciter.T_F2 = 0 needs exciter.T_F1 = 0 as well",
        )
        measured = Measurement(m, seen)
        control = Controller(m, p, PI_0)
        signal = control(measured.error(control.error_at_start) - V_F)
        compensated = lead_lag_stage(m, signal, PI_0)
        close_limited_low_pass(m, amplifier, p.K_A * compensated, p.T_A, p.V_RMIN, p.V_RMAX)
        behind.drive(V_R)
        return measured.close(behind.E_fd)

"""DC1A, DC2A, IEEE types 1 and 2 (IEEET1, IEEET2), AC1A, AC4A and AC5A: exciters on the machine's shaft.

DC1A is a regulated commutator exciter with saturation and rate feedback; IEEET1 has no stage (1+sT_C)/(1+sT_B), and
DC2A, fed from the machine's terminal, the limits v_t·V_RMIN and v_t·V_RMAX:

    V_ref + V_S − v_m − V_F → (1+sT_C)/(1+sT_B) → K_A/(1+sT_A) = V_R, held within V_RMIN and V_RMAX
    T_E·dE_fd/dt = V_R − K_E·E_fd − S_E(E_fd)·E_fd
    V_F = s·K_F/(1+sT_F)·E_fd

IEEET2 has no such stage either, and its rate feedback is of the regulator's voltage:

    V_F = s·K_F/((1+sT_F)·(1+sT_F2))·V_R

IEEEX2 is IEEET2 with the stage (1+sT_C)/(1+sT_B) before the amplifier.

AC5A is a simplified alternator: IEEET2 with a lead in the rate feedback, and without negative field voltages:

    V_F = s·K_F·(1+sT_F3)/((1+sT_F)·(1+sT_F2))·V_R,  E_fd ≥ 0

AC1A is an alternator, field-controlled, with a rotating rectifier, uncontrolled, and rate feedback:

    V_ref + V_S − v_m − V_F → (1+sT_C)/(1+sT_B) → K_A/(1+sT_A), held within V_AMIN and V_AMAX → V_RMIN ≤ V_R ≤ V_RMAX
    T_E·dV_E/dt = V_R − V_FE,  V_E ≥ 0,  V_FE = (K_E + S_E(V_E))·V_E + K_D·I_FD
    E_fd = V_E·F_EX(K_C·I_FD/V_E),  V_F = s·K_F/(1+sT_F)·V_FE

AC4A is an alternator with a controlled rectifier:

    V_IMIN ≤ V_ref + V_S − v_m ≤ V_IMAX → (1+sT_C)/(1+sT_B) → K_A/(1+sT_A) = E_fd,
    held within V_RMIN and V_RMAX − K_C·I_FD"""

from functools import partial

from fmus.synchronous_generator.excitation.common import (
    BEFORE,
    BEHIND,
    Measurement,
    Regulated,
    constant_of_field,
    exciter_saturation,
    gain,
    lead_lag_stage,
    rate_feedback,
    rectifier,
    require_within,
    time,
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
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and

_MOST = 1e9  # no upper limit of V_E [pu]
_LEAST = 1e-3  # smallest V_E [pu] that the rectifier's loading is divided by


def dc1a(
    m: ModelBuilder, seen: Regulated, *, compensated: bool = True, bus_fed: bool = False
) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu].

    ``compensated``: whether it has the stage (1+sT_C)/(1+sT_B); ``bus_fed``: whether its limits are times v_t."""
    with m.scope("exciter"):
        K_A, T_A = (
            gain(m, "K_A", 20.0, "Gain", 1e-3),
            time(m, "T_A", 0.2, "Amplifier; 0 leaves the lag out"),
        )
        high, low = (
            gain(m, "V_RMAX", 5.0, "Upper limit of V_R"),
            gain(m, "V_RMIN", -5.0, "Lower limit of V_R"),
        )
        given_K_E = gain(m, "K_E", 1.0, "Field resistance, separately excited")
        T_E = time(m, "T_E", 0.314, "Exciter's field", 1e-3)
        curve = exciter_saturation(m, 3.0, 0.41, 4.0, 1.96)
        K_E = constant_of_field(m, given_K_E, high, curve, seen.start.E_fd)
        V_R0 = K_E * seen.start.E_fd + curve.part(seen.start.E_fd)
        v_0 = seen.start.v_t if bus_fed else Expr(1)
        require_within(m, V_R0, v_0 * low, v_0 * high, ("exciter.V_RMIN", "exciter.V_RMAX"))
        E_fd = m.state("E", seen.start.E_fd, "pu", "Field voltage", base="E_fd")
        V_F, _ = rate_feedback(m, E_fd, seen.start.E_fd, 0.063, 0.35)
        measured = Measurement(m, seen)
        error = measured.error(V_R0 / K_A) - V_F
        if compensated:
            error = lead_lag_stage(m, error, V_R0 / K_A)
        error = seen.lifted(error, BEFORE, V_R0 / K_A)
        v = seen.terminal_voltage(E_fd) if bus_fed else Expr(1)
        V_R = limited_low_pass(m, "amplifier", K_A * error, T_A, v * low, v * high, initial=V_R0)
        m.derivative(E_fd, (V_R - K_E * E_fd - curve.part(E_fd)) / T_E)
        return measured.close(E_fd)


ieeet1 = partial(dc1a, compensated=False)  # DC1A without its lead and lag
dc2a = partial(dc1a, bus_fed=True)  # DC1A fed from the machine's terminal


def ieeet2(
    m: ModelBuilder, seen: Regulated, *, alternator: bool = False, compensated: bool = False
) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu].

    ``alternator``: whether it is AC5A, with a lead in its rate feedback and no negative field voltage; ``compensated``:
    whether it is IEEEX2, with a lead and a lag before the amplifier."""
    with m.scope("exciter"):
        K_A, T_A = gain(m, "K_A", 200.0, "Gain", 1e-3), time(m, "T_A", 0.02, "Amplifier", 1e-3)
        high = gain(m, "V_RMAX", 6.08, "Upper limit of V_R")
        low = gain(m, "V_RMIN", -6.08, "Lower limit of V_R")
        given_K_E = gain(m, "K_E", 1.0, "Field resistance, separately excited")
        T_E = time(m, "T_E", 0.55, "Exciter's field", 1e-3)
        curve = exciter_saturation(m, 2.85, 0.3, 3.8, 0.6)
        K_E = constant_of_field(m, given_K_E, high, curve, seen.start.E_fd)
        V_R0 = K_E * seen.start.E_fd + curve.part(seen.start.E_fd)
        require_within(m, V_R0, low, high, ("exciter.V_RMIN", "exciter.V_RMAX"))
        E = m.state("E", seen.start.E_fd, "pu", "Field voltage", base="E_fd")
        E_fd = fmax(E, 0) if alternator else E
        amplifier = m.state("amplifier", V_R0, "pu", "first-order lag with limits", base="E_fd")
        V_R = clamp(amplifier, low, high)
        fast, _ = rate_feedback(m, V_R, V_R0, 0.06, 0.3)
        T_F2 = time(m, "T_F2", 0.6, "Second lag of the rate feedback; 0 leaves it out")
        T_F3 = time(m, "T_F3", 0.0, "Lead of the rate feedback") if alternator else Expr(0)
        if alternator:
            m.require(
                if_else(logic_and(T_F2 <= 0, T_F3 > 0), -1, 1),
                "exciter.T_F2 = 0 needs exciter.T_F3 = 0 as well",
            )
        V_F = lead_lag(m, "feedback_2", fast, T_F3, T_F2)
        measured = Measurement(m, seen)
        error = measured.error(V_R0 / K_A) - V_F
        if compensated:
            error = lead_lag_stage(m, error, V_R0 / K_A)
        close_limited_low_pass(m, amplifier, K_A * error, T_A, low, high)
        rate = (V_R - K_E * E_fd - curve.part(E_fd)) / T_E
        m.derivative(E, held_at_limits(E, rate, 0, _MOST) if alternator else rate)
        return measured.close(E_fd)


ieeex2 = partial(ieeet2, compensated=True)  # IEEET2 with DC1A's lead and lag
ac5a = partial(ieeet2, alternator=True)  # IEEET2 with a lead in its feedback, and E_fd >= 0


def ac1a(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        K_A, T_A = (
            gain(m, "K_A", 400.0, "Gain", 1e-3),
            time(m, "T_A", 0.02, "Amplifier; 0 leaves the lag out"),
        )
        A_high, A_low = (
            gain(m, "V_AMAX", 14.5, "Upper limit of V_A"),
            gain(m, "V_AMIN", -14.5, "Lower limit of V_A"),
        )
        R_high, R_low = (
            gain(m, "V_RMAX", 6.03, "Upper limit of V_R"),
            gain(m, "V_RMIN", -5.43, "Lower limit of V_R"),
        )
        K_E, T_E = (
            gain(m, "K_E", 1.0, "Exciter constant"),
            time(m, "T_E", 0.8, "Exciter's field", 1e-3),
        )
        K_C = gain(m, "K_C", 0.2, "Rectifier loading factor", 0)
        K_D = gain(m, "K_D", 0.38, "Demagnetising factor", 0)
        curve = exciter_saturation(m, 4.18, 0.1, 3.14, 0.03)
        V_E0 = voltage_before_rectifier(seen.start.E_fd, K_C * seen.start.E_fd)
        V_R0 = K_E * V_E0 + curve.part(V_E0) + K_D * seen.start.E_fd
        require_within(m, V_R0, A_low, A_high, ("exciter.V_AMIN", "exciter.V_AMAX"))
        require_within(m, V_R0, R_low, R_high, ("exciter.V_RMIN", "exciter.V_RMAX"))
        x = m.state("V_E", V_E0, "pu", "Voltage before the rectifier", base="E_fd")
        V_E = fmax(x, 0)
        V_FE = K_E * V_E + curve.part(V_E) + K_D * seen.I_fd
        V_F, _ = rate_feedback(m, V_FE, V_R0, 0.03, 1.0)
        measured = Measurement(m, seen)
        error = lead_lag_stage(m, measured.error(V_R0 / K_A) - V_F, V_R0 / K_A)
        V_A = limited_low_pass(m, "amplifier", K_A * error, T_A, A_low, A_high, initial=V_R0)
        V_R = clamp(seen.lifted(V_A, BEHIND, V_R0), R_low, R_high)
        m.derivative(x, held_at_limits(x, (V_R - V_FE) / T_E, 0.0, _MOST))
        return measured.close(V_E * rectifier(K_C * seen.I_fd / fmax(V_E, _LEAST)))


def ac4a(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        K_A, T_A = (
            gain(m, "K_A", 200.0, "Gain", 1e-3),
            time(m, "T_A", 0.015, "Amplifier; 0 leaves the lag out"),
        )
        I_high, I_low = (
            gain(m, "V_IMAX", 10.0, "Upper limit of the error"),
            gain(m, "V_IMIN", -10.0, "Lower one"),
        )
        high, low = (
            gain(m, "V_RMAX", 5.64, "Upper ceiling of E_fd"),
            gain(m, "V_RMIN", -4.53, "Lower ceiling of E_fd"),
        )
        K_C = gain(m, "K_C", 0.0, "Rectifier loading factor", 0)
        V_I0 = seen.start.E_fd / K_A
        require_within(m, V_I0, I_low, I_high, ("exciter.V_IMIN", "exciter.V_IMAX"))
        require_within(
            m,
            seen.start.E_fd,
            low,
            high - K_C * seen.start.E_fd,
            ("exciter.V_RMIN", "exciter.V_RMAX"),
        )
        measured = Measurement(m, seen)
        error = clamp(measured.error(V_I0), I_low, I_high)
        compensated = seen.lifted(lead_lag_stage(m, error, V_I0, lead=1.0), BEFORE, V_I0)
        ceiling = fmax(high - K_C * seen.I_fd, low)
        return measured.close(
            limited_low_pass(
                m, "amplifier", K_A * compensated, T_A, low, ceiling, initial=seen.start.E_fd
            )
        )

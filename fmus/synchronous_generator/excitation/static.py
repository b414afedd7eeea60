"""ST1A and ST4B, rectifiers fed from the machine's terminal, and SEXS and SCRX, simplified exciters.

SEXS is a lead/lag and a lag that stops at its limits:

    V_ref + V_S − v_m → (1+sT_A)/(1+sT_B) → K/(1+sT_E) = E_fd, held within E_MIN and E_MAX

SCRX is SEXS with E_fd = v_t times that lag unless it is fed from a supply of its own; with r_C/r_FD > 0 a negative
field current goes through that resistance instead, E_fd = −r_C/r_FD·I_FD.

ST1A is controlled, with a limiter of the field current:

    V_IMIN ≤ V_ref + V_S − v_m − V_F ≤ V_IMAX → (1+sT_C)/(1+sT_B) → (1+sT_C1)/(1+sT_B1)
    → K_A/(1+sT_A) = V_A, held within V_AMIN and V_AMAX → V_A − K_LR·(I_FD − I_LR), only above I_LR = V_X,
    v_t·V_RMIN ≤ E_fd = V_X ≤ v_t·V_RMAX − K_C·I_FD,   V_F = s·K_F/(1+sT_F)·V_X

The rate feedback starts before the ceilings, so it goes on while E_fd stands at one.

ST4B has two PI controllers behind the source V_B of `sources`; an integrator stops while its output is at a limit:

    V_ref + V_S − v_m → K_PR + K_IR/s within V_RMIN and V_RMAX → 1/(1+sT_A) → − K_G·E_fd
    → K_PM + K_IM/s within V_MMIN and V_MMAX = V_M
    E_fd = V_M·V_B

Two fixed-point passes take the ceilings' v_t, because it depends, behind the transformer, weakly on E_fd."""

from dataclasses import dataclass

from fmus.synchronous_generator.data_lines import declared, pu, seconds
from fmus.synchronous_generator.excitation.bridge_supply import (
    FIELD_RESISTANCE,
    Supply,
    through_resistance,
)
from fmus.synchronous_generator.excitation.common import (
    BEFORE,
    BEHIND,
    SOURCE,
    Measurement,
    Regulated,
    gain,
    lead_lag_stage,
    rate_feedback,
    require_within,
    time,
)
from fmus.synchronous_generator.excitation.sources import compound_source
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    clamp,
    close_limited_low_pass,
    lead_lag,
    limited_low_pass,
    limited_proportional_integral,
    low_pass_or_nothing,
)
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and, logic_or

SCRX = (
    pu("K", 100.0, "Gain", 1e-3),
    seconds("T_A", 1.0, "Lead"),
    seconds("T_B", 10.0, "Lag; 0 leaves the stage out"),
    seconds("T_E", 0.05, "Exciter; 0 leaves the lag out"),
    pu("E_MIN", 0.0, "Lower ceiling, of E_fd at v_t = 1"),
    pu("E_MAX", 5.0, "Upper ceiling, of E_fd at v_t = 1"),
    FIELD_RESISTANCE,
)


def st1a(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        K_A, T_A = (
            gain(m, "K_A", 200.0, "Gain", 1e-3),
            time(m, "T_A", 0.0, "Amplifier; 0 leaves the lag out"),
        )
        I_high, I_low = (
            gain(m, "V_IMAX", 999.0, "Upper limit of the error"),
            gain(m, "V_IMIN", -999.0, "Lower one"),
        )
        A_high, A_low = (
            gain(m, "V_AMAX", 999.0, "Upper limit of V_A"),
            gain(m, "V_AMIN", -999.0, "Lower limit of V_A"),
        )
        high = gain(m, "V_RMAX", 6.43, "Upper ceiling of E_fd at v_t = 1")
        low = gain(m, "V_RMIN", -6.0, "Lower ceiling of E_fd at v_t = 1")
        K_C = gain(m, "K_C", 0.0, "Rectifier loading factor", 0)
        K_LR = gain(m, "K_LR", 0.0, "Gain of the field current's limiter; 0 leaves it out", 0)
        I_LR = gain(m, "I_LR", 0.0, "Field current where the limiter starts")

        def relieved(field_current: Expr) -> Expr:
            return K_LR * fmax(field_current - I_LR, 0)

        def between_ceilings(signal: Expr, v_t: Expr) -> Expr:
            floor = v_t * low
            return clamp(signal, floor, fmax(v_t * high - K_C * seen.I_fd, floor))

        V_A0 = seen.start.E_fd + relieved(seen.start.E_fd)
        V_I0 = V_A0 / K_A
        require_within(m, V_I0, I_low, I_high, ("exciter.V_IMIN", "exciter.V_IMAX"))
        require_within(m, V_A0, A_low, A_high, ("exciter.V_AMIN", "exciter.V_AMAX"))
        ceiling = seen.start.v_t * high - K_C * seen.start.E_fd
        require_within(
            m, seen.start.E_fd, seen.start.v_t * low, ceiling, ("exciter.V_RMIN", "exciter.V_RMAX")
        )
        measured = Measurement(m, seen)
        amplifier = m.state("amplifier", V_A0, "pu", "first-order lag with limits", base="E_fd")
        before_ceilings = clamp(amplifier, A_low, A_high) - relieved(seen.I_fd)
        V_F, K_F = rate_feedback(m, before_ceilings, seen.start.E_fd)
        m.require(
            if_else(logic_and(K_F > 0, T_A <= 0), -1, 1), "exciter.K_F > 0 needs exciter.T_A > 0"
        )
        error = seen.lifted(clamp(measured.error(V_I0) - V_F, I_low, I_high), BEFORE, V_I0)
        error = lead_lag_stage(m, error, V_I0)
        error = lead_lag_stage(m, error, V_I0, mark="1")
        V_A = close_limited_low_pass(m, amplifier, K_A * error, T_A, A_low, A_high)
        V_X = seen.lifted(V_A - relieved(seen.I_fd), BEHIND, seen.start.E_fd)
        E_fd = between_ceilings(V_X, seen.terminal_voltage(between_ceilings(V_X, measured.nearly)))
        return measured.close(E_fd)


@dataclass(frozen=True)
class _Inner:
    """The inner controller: gains, limits, and its value in steady state."""

    K_G: Expr
    K_PM: Expr
    K_IM: Expr
    low: Expr
    high: Expr
    at_start: Expr


def st4b(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        K_PR = gain(m, "K_PR", 3.15, "Proportional gain", 0)
        K_IR = m.parameter("K_IR", 3.15, "1/s", "Integral gain", minimum=1e-6)
        high, low = (
            gain(m, "V_RMAX", 1.0, "Upper limit of V_R"),
            gain(m, "V_RMIN", -0.87, "Lower limit of V_R"),
        )
        T_A = time(m, "T_A", 0.02, "Bridge; 0 leaves the lag out")
        source = compound_source(m, seen)
        inner = _inner(m, seen.start.E_fd / source.at_start)
        V_A0 = (
            if_else(inner.K_IM > 0, 0, inner.at_start / fmax(inner.K_PM, 1e-9))
            + inner.K_G * seen.start.E_fd
        )
        require_within(m, V_A0, low, high, ("exciter.V_RMIN", "exciter.V_RMAX"))
        measured = Measurement(m, seen)
        error = measured.error(0.0)
        V_R = limited_proportional_integral(
            m, "regulator", error, K_PR, K_IR, low=low, high=high, initial=V_A0
        )
        V_A = low_pass_or_nothing(m, "bridge", V_R, T_A, V_A0)
        x = m.state(
            "inner",
            if_else(inner.K_IM > 0, inner.at_start, 0),
            "pu",
            "integrator with limits",
            base="E_fd",
        )

        def field_voltage(v_t: Phasor) -> Expr:
            V_B = source.available(v_t)
            free = (inner.K_PM * V_A + x) / (1 + V_B * inner.K_PM * inner.K_G)
            return V_B * clamp(free, inner.low, inner.high)

        # v_t depends on E_fd, and E_fd on v_t, weakly: two rounds from I_fd, the value of E_fd at rest
        E_fd = field_voltage(seen.terminal(field_voltage(seen.terminal(seen.I_fd))))
        rest = V_A - inner.K_G * E_fd
        free = inner.K_PM * rest + x
        outward = logic_or(
            logic_and(free > inner.high, rest > 0), logic_and(free < inner.low, rest < 0)
        )
        without = -x / BYPASS_TIME  # no integrator, and no eigenvalue of 0
        m.derivative(x, if_else(inner.K_IM > 0, if_else(outward, 0, inner.K_IM * rest), without))
        return measured.close(E_fd)


def _inner(m: ModelBuilder, V_M0: Expr) -> _Inner:
    inner = _Inner(
        gain(m, "K_G", 0.0, "Feedback of E_fd", 0),
        gain(m, "K_PM", 1.0, "Proportional gain of the inner controller", 0),
        m.parameter("K_IM", 0.0, "1/s", "Integral gain of the inner controller", minimum=0),
        gain(m, "V_MMIN", -0.87, "Lower limit of V_M"),
        gain(m, "V_MMAX", 1.0, "Upper limit of V_M"),
        V_M0,
    )
    m.require(inner.K_PM + inner.K_IM - 1e-9, "exciter: one of K_PM and K_IM must exceed 0")
    require_within(m, V_M0, inner.low, inner.high, ("exciter.V_MMIN", "exciter.V_MMAX"))
    return inner


def sexs(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        K = gain(m, "K", 100.0, "Gain", 1e-3)
        T_A = time(m, "T_A", 1.0, "Lead")
        T_B = time(m, "T_B", 10.0, "Lag; 0 leaves the stage out")
        T_E = time(m, "T_E", 0.05, "Exciter; 0 leaves the lag out")
        low, high = (
            gain(m, "E_MIN", 0.0, "Lower ceiling of E_fd"),
            gain(m, "E_MAX", 5.0, "Upper ceiling of E_fd"),
        )
        m.require(
            if_else(logic_and(T_B <= 0, T_A > 0), -1, 1),
            "exciter.T_B = 0 needs exciter.T_A = 0 as well",
        )
        require_within(m, seen.start.E_fd, low, high, ("exciter.E_MIN", "exciter.E_MAX"))
        measured = Measurement(m, seen)
        error = measured.error(seen.start.E_fd / K)
        compensated = lead_lag(m, "lead_lag", error, T_A, T_B, seen.start.E_fd / K)
        return measured.close(
            limited_low_pass(
                m, "amplifier", K * compensated, T_E, low, high, initial=seen.start.E_fd
            )
        )


def scrx(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p = declared(m, SCRX, SOURCE)
        supply = Supply.declare(m)
        m.require(
            if_else(logic_and(p.T_B <= 0, p.T_A > 0), -1, 1),
            "exciter.T_B = 0 needs exciter.T_A = 0 as well",
        )

        x_0 = supply.signal_for(seen.start.E_fd, seen.start.v_t)
        require_within(m, x_0, p.E_MIN, p.E_MAX, ("exciter.E_MIN", "exciter.E_MAX"))
        measured = Measurement(m, seen)
        compensated = lead_lag(m, "lead_lag", measured.error(x_0 / p.K), p.T_A, p.T_B, x_0 / p.K)
        x = limited_low_pass(
            m, "amplifier", p.K * compensated, p.T_E, p.E_MIN, p.E_MAX, initial=x_0
        )
        E = supply.times(x, seen.terminal_voltage(supply.times(x, measured.nearly)))
        return measured.close(through_resistance(E, seen.I_fd, p.r_C_over_r_FD))

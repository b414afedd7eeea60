"""ST5B, ST6B, ST7B and ST8C: rectifiers with the limits of IEEE 421.5 of 2005 and 2016.

ST5B has two limited leads and lags; its paths for limiters outside are left out:

    V_ref + V_S − v_m → (1+sT_C1)/(1+sT_B1) → (1+sT_C2)/(1+sT_B2), each within V_RMIN/K_R and V_RMAX/K_R
    → K_R within V_RMIN and V_RMAX → − K_C·I_FD → 1/(1+sT_1) = E_fd, held within v_t·V_RMIN and v_t·V_RMAX

ST6B has a PID controller, a feedback of the field voltage and a limiter of the field current:

    V_ref + V_S − v_m → K_PR + K_IR/s + s·K_DR/(1+sT_DR) = V_A, within V_AMIN and V_AMAX
    V_R = K_FF·V_A + K_M·(V_A − K_G/(1+sT_G)·E_fd), within V_RMIN and V_RMAX,
    at most K_LR·(K_CI·I_LR − I_FD), itself at least V_RMIN; without K_LR no such limit;  E_fd = V_R·v_t

ST7B is a PI controller by a positive feedback, V_FB = K_IA/(1+sT_IA)·E_fd:

    V_MIN ≤ V_ref ≤ V_MAX → + V_S − v_m·(1+sT_G)/(1+sT_F) → K_PA
    → at least v_t·V_RMIN − K_H·V_FB, then at most v_t·V_RMAX − K_L·V_FB → (1+sT_C)/(1+sT_B)
    → + V_FB = E_fd, within v_t·V_RMIN and v_t·V_RMAX

ST8C has an inner controller of the field current, and two rectifiers in series:

    V_ref + V_S − v_m → K_PR + K_IR/s within V_PIMIN and V_PIMAX → − K_F/(1+sT_F)·I_FD
    → K_PA + K_IA/s within V_AMIN and V_AMAX → K_A/(1+sT_A) = V_R, held within V_RMIN and V_RMAX
    E_fd = V_R·V_B1 + V_B2,  V_B1 as in `sources` of the terminal (SW1 = 1) or of K_P alone,
    V_B2 = K_I2·|i|·F_EX(K_C2·I_FD/(K_I2·|i|)), at most V_B2MAX

The sign of ST7B's feedback is the one for which it is the PI controller that the standard speaks of, and for which
K_H = K_L = 1 keeps E_fd within its limits; dynawo at 0981fec and InterPSS subtract it. Sources: Opal-RT's library of
phasor models at 6dc8ca5 (ST5B, ST6B, ST7B), OpenIPSL at 2be0558a (ST5B), PowerSimulationsDynamics.jl at d94d74e (ST6B,
ST8C), IEEE 421.5."""

from fmus.synchronous_generator.data_lines import declared, number, pu, seconds
from fmus.synchronous_generator.excitation.common import (
    SOURCE,
    Controller,
    Measurement,
    Regulated,
    require_within,
)
from fmus.synchronous_generator.excitation.integral import PID
from fmus.synchronous_generator.excitation.sources import behind_rectifier, compound_source
from fmus.toolchain.blocks import (
    clamp,
    lead_lag,
    limited_lead_lag,
    limited_low_pass,
    limited_proportional_integral,
    low_pass_or_nothing,
)
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, fmax, fmin, if_else

CEILINGS = (
    pu("V_RMAX", 5.0, "Upper ceiling of E_fd at v_t = 1"),
    pu("V_RMIN", -4.0, "Lower ceiling of E_fd at v_t = 1"),
)
ST5B = (
    seconds("T_C1", 0.8, "Lead of the first stage"),
    seconds("T_B1", 6.0, "Lag of the first stage; 0 leaves the stage out"),
    seconds("T_C2", 0.08, "Lead of the second stage"),
    seconds("T_B2", 0.01, "Lag of the second stage; 0 leaves the stage out"),
    pu("K_R", 200.0, "Gain", 1e-3),
    seconds("T_1", 0.004, "Bridge; 0 leaves the lag out"),
    pu("K_C", 0.004, "Rectifier loading factor", 0),
)
ST6B = (
    pu("V_AMAX", 4.81, "Upper limit of V_A"),
    pu("V_AMIN", -3.85, "Lower limit of V_A"),
    pu("K_FF", 1.0, "Gain past the inner regulator", 0),
    pu("K_M", 1.0, "Gain of the inner regulator", 0),
    pu("K_G", 1.0, "Feedback of E_fd", 0),
    seconds("T_G", 0.02, "Lag of that feedback", 1e-3),
    pu("K_CI", 1.06, "Gain of the field current's limit", 0),
    pu("K_LR", 0.0, "Gain of the limiter of the field current; 0: none", 0),
    pu("I_LR", 4.164, "Field current that the limiter holds"),
)
ST7B = (
    pu("V_MAX", 1.1, "Upper limit of the reference", base="S_n"),
    pu("V_MIN", 0.9, "Lower limit of the reference", base="S_n"),
    seconds("T_G", 1.0, "Lead of the measured voltage"),
    seconds("T_F", 1.0, "Lag of the measured voltage; 0 leaves the stage out"),
    pu("K_PA", 40.0, "Proportional gain", 1e-3),
    pu("K_H", 1.0, "Feedback in the gate of the lower limit", 0),
    pu("K_L", 1.0, "Feedback in the gate of the upper limit", 0),
    seconds("T_C", 1.0, "Lead"),
    seconds("T_B", 1.0, "Lag; 0 leaves the stage out"),
    pu("K_IA", 1.0, "Feedback of E_fd, 1 for a PI controller", 0),
    seconds("T_IA", 3.0, "Lag of that feedback", 1e-3),
)
ST8C = (
    pu("K_PR", 5.0, "Proportional gain of the voltage controller", 0),
    number("K_IR", 5.0, "Integral gain of the voltage controller", 1e-6, "1/s"),
    pu("V_PIMAX", 99.0, "Upper limit of the voltage controller"),
    pu("V_PIMIN", -99.0, "Lower limit of the voltage controller"),
    pu("K_PA", 4.0, "Proportional gain of the field current's controller", 0),
    number("K_IA", 0.1, "Integral gain of the field current's controller", 1e-6, "1/s"),
    pu("V_AMAX", 99.0, "Upper limit of the field current's controller"),
    pu("V_AMIN", -99.0, "Lower limit of the field current's controller"),
    pu("K_A", 1.35, "Gain of the bridge", 1e-3),
    seconds("T_A", 0.003, "Bridge; 0 leaves the lag out"),
    pu("V_RMAX", 99.0, "Upper limit of V_R"),
    pu("V_RMIN", -99.0, "Lower limit of V_R"),
    pu("K_F", 0.5, "Feedback of the field current", 0),
    seconds("T_F", 0.005, "Lag of that feedback; 0 leaves it out"),
    number("SW1", 0.0, "Source of the first rectifier: 1 the terminal; else K_P alone"),
    pu("K_C2", 0.0, "Loading factor of the second rectifier", 0),
    pu("K_I2", 0.0, "Gain of the stator's current in the second rectifier", 0),
    pu("V_B2MAX", 99.0, "Upper limit of V_B2", 0),
)


def st5b(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, limits, E_0 = declared(m, ST5B, SOURCE), declared(m, CEILINGS, SOURCE), seen.start.E_fd
        low, high = limits.V_RMIN, limits.V_RMAX
        V_R0, v_0 = E_0 + p.K_C * E_0, seen.start.v_t
        names = ("exciter.V_RMIN", "exciter.V_RMAX")
        require_within(m, V_R0, low, high, names)
        require_within(m, E_0, v_0 * low, v_0 * high, names)
        measured = Measurement(m, seen)
        signal = measured.error(V_R0 / p.K_R)
        for stage, lead, lag in ((1, p.T_C1, p.T_B1), (2, p.T_C2, p.T_B2)):
            signal = limited_lead_lag(
                m,
                f"lead_lag{stage}",
                signal,
                lead,
                lag,
                low=low / p.K_R,
                high=high / p.K_R,
                initial=V_R0 / p.K_R,
            )
        V_R = clamp(p.K_R * signal, low, high) - p.K_C * seen.I_fd
        v_t = measured.nearly
        return measured.close(
            limited_low_pass(m, "bridge", V_R, p.T_1, v_t * low, v_t * high, initial=E_0)
        )


def st6b(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        gains, p = declared(m, PID, SOURCE, {"K_PR": 18.0, "K_IR": 45.0}), declared(m, ST6B, SOURCE)
        limits, E_0 = declared(m, CEILINGS, SOURCE), seen.start.E_fd
        m.require(p.K_FF + p.K_M - 1e-9, "exciter: one of K_FF and K_M must exceed 0")
        V_R0 = E_0 / seen.start.v_t
        V_A0 = (V_R0 + p.K_M * p.K_G * E_0) / fmax(p.K_FF + p.K_M, 1e-9)

        def hold(signal: Expr, I_fd: Expr) -> Expr:
            highest = fmax(p.K_LR * (p.K_CI * p.I_LR - I_fd), limits.V_RMIN)
            limited = clamp(signal, limits.V_RMIN, limits.V_RMAX)
            return if_else(p.K_LR > 0, fmin(limited, highest), limited)

        m.require(
            if_else(p.K_LR > 0, p.K_LR * (p.K_CI * p.I_LR - E_0) - V_R0, 1),
            "exciter.I_LR: the operating point of the power flow lies at or above what the field current's limiter "
            "holds; raise it, or lower the generator's reactive power",
        )
        require_within(m, V_A0, p.V_AMIN, p.V_AMAX, ("exciter.V_AMIN", "exciter.V_AMAX"))
        require_within(m, V_R0, limits.V_RMIN, limits.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        measured = Measurement(m, seen)
        control = Controller(m, gains, V_A0, (p.V_AMIN, p.V_AMAX))
        V_A = control(measured.error(control.error_at_start))
        V_G = m.state("feedback", p.K_G * E_0, "pu", "Field voltage through T_G", base="E_fd")
        V_R = hold(p.K_FF * V_A + p.K_M * (V_A - V_G), seen.I_fd)
        E_fd = V_R * seen.terminal_voltage(V_R * measured.nearly)
        m.derivative(V_G, (p.K_G * E_fd - V_G) / p.T_G)
        return measured.close(E_fd)


def st7b(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, limits, E_0 = declared(m, ST7B, SOURCE), declared(m, CEILINGS, SOURCE), seen.start.E_fd
        low, high, v_0 = limits.V_RMIN, limits.V_RMAX, seen.start.v_t
        V_FB0 = p.K_IA * E_0
        rest_0 = E_0 - V_FB0
        names = ("exciter.V_RMIN", "exciter.V_RMAX")
        require_within(m, E_0, v_0 * low, v_0 * high, names)
        require_within(m, rest_0, v_0 * low - p.K_H * V_FB0, v_0 * high - p.K_L * V_FB0, names)
        V_FB = m.state("feedback", V_FB0, "pu", "Field voltage through T_IA", base="E_fd")
        measured = Measurement(m, seen)
        reference = measured.reference(rest_0 / p.K_PA)
        require_within(m, measured.at_start, p.V_MIN, p.V_MAX, ("exciter.V_MIN", "exciter.V_MAX"))
        led = lead_lag(m, "input", measured.value, p.T_G, p.T_F, measured.at_start)
        amplified = p.K_PA * (clamp(reference, p.V_MIN, p.V_MAX) + seen.v_s - led)
        x = m.state("lead_lag", rest_0, "pu", "lead/lag", base="S_n")

        def field_voltage(v_t: Expr) -> tuple[Expr, Expr]:
            gated = fmin(fmax(amplified, v_t * low - p.K_H * V_FB), v_t * high - p.K_L * V_FB)
            T_B = fmax(p.T_B, 1e-3)
            behind = if_else(p.T_B > 0, x + p.T_C / T_B * (gated - x), gated)
            return gated, clamp(behind + V_FB, v_t * low, v_t * high)

        _, first = field_voltage(measured.nearly)
        gated, E_fd = field_voltage(seen.terminal_voltage(first))
        m.derivative(x, (gated - x) / if_else(p.T_B > 0, p.T_B, 0.01))
        m.derivative(V_FB, (p.K_IA * E_fd - V_FB) / p.T_IA)
        return measured.close(E_fd)


def st8c(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, E_0 = declared(m, ST8C, SOURCE), seen.start.E_fd
        first = compound_source(m, seen, 4.0, 0.1, 99.0)
        fed_by_terminal = fabs(p.SW1 - 1) < 0.5  # numbers of sources are whole

        def available(v_t: Phasor, i: Phasor, I_fd: Expr) -> tuple[Expr, Expr]:
            V_E = if_else(fed_by_terminal, first.voltage(v_t, i), first.p.K_P)
            V_B1 = fmin(behind_rectifier(V_E, first.p.K_C * I_fd), first.p.V_BMAX)
            current = behind_rectifier(p.K_I2 * i.magnitude(), p.K_C2 * I_fd)
            return V_B1, if_else(p.K_I2 > 0, fmin(current, p.V_B2MAX), 0)

        V_B10, V_B20 = available(seen.v_0, seen.start.i, E_0)
        V_R0 = (E_0 - V_B20) / V_B10
        V_A0, reference_0 = V_R0 / p.K_A, p.K_F * E_0
        for value, low, high, name in (
            (reference_0, p.V_PIMIN, p.V_PIMAX, "V_PI"),
            (V_A0, p.V_AMIN, p.V_AMAX, "V_A"),
            (V_R0, p.V_RMIN, p.V_RMAX, "V_R"),
        ):
            require_within(m, value, low, high, (f"exciter.{name}MIN", f"exciter.{name}MAX"))
        measured = Measurement(m, seen)
        wanted = limited_proportional_integral(
            m,
            "regulator",
            measured.error(0.0),
            p.K_PR,
            p.K_IR,
            low=p.V_PIMIN,
            high=p.V_PIMAX,
            initial=reference_0,
        )
        back = low_pass_or_nothing(m, "feedback", p.K_F * seen.I_fd, p.T_F, reference_0)
        V_A = limited_proportional_integral(
            m,
            "inner",
            wanted - back,
            p.K_PA,
            p.K_IA,
            low=p.V_AMIN,
            high=p.V_AMAX,
            initial=V_A0,
        )
        V_R = limited_low_pass(m, "bridge", p.K_A * V_A, p.T_A, p.V_RMIN, p.V_RMAX, initial=V_R0)
        V_B1, V_B2 = available(seen.terminal(seen.I_fd), seen.i, seen.I_fd)
        V_B1, V_B2 = available(seen.terminal(V_R * V_B1 + V_B2), seen.i, seen.I_fd)
        return measured.close(V_R * V_B1 + V_B2)

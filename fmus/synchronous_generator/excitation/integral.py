"""EXPIC1, DC4B and AC7B: exciters whose regulator integrates, so that the voltage is at its reference at rest.

EXPIC1 has a PI controller, and an exciter or, with T_E = 0, none; V_B is the source of `sources`, 1 with K_P = K_I = 0:

    V_ref + V_S − v_m − V_F → K_A·(1+sT_A1)/s, within V_R2 and V_R1 → (1+sT_A3)/((1+sT_A2)·(1+sT_A4))
    → within V_RMIN and V_RMAX → times V_B → within E_FDMIN and E_FDMAX
    T_E·dE_fd/dt = … − (K_E + S_E(E_fd))·E_fd,  V_F = s·K_F/((1+sT_F1)·(1+sT_F2))·E_fd

DC4B has a PID controller and a commutator exciter:

    V_ref + V_S − v_m − V_F → K_PR + K_IR/s + s·K_DR/(1+sT_DR), within V_RMIN/K_A and V_RMAX/K_A → K_A/(1+sT_A) = V_R
    v_t·V_RMIN ≤ V_R ≤ v_t·V_RMAX,  T_E·dE_fd/dt = V_R − (K_E + S_E(E_fd))·E_fd ≥ …,  E_fd ≥ V_EMIN
    V_F = s·K_F/(1+sT_F)·E_fd

AC7B has a PID and a PI controller, and the alternator of `alternator`:

    V_ref + V_S − v_m − V_F → PID, within V_RMIN and V_RMAX → − K_F1·E_fd − K_F2·V_FE
    → K_PA + K_IA/s, within V_AMIN and V_AMAX → times K_P·v_t, at least −K_L·V_FE = V_R
    V_EMIN ≤ V_E ≤ (V_FEMAX − K_D·I_FD)/(K_E + S_E),  V_F = s·K_F3/(1+sT_F3)·V_FE

Sources: IEEE 421.5 (DC4B, AC7B), OpenIPSL at 2be0558a
(DC4B, AC7B), the CIM's description of ExcPIC."""

from fmus.synchronous_generator.data_lines import declared, number, pu, seconds
from fmus.synchronous_generator.excitation.alternator import alternator
from fmus.synchronous_generator.excitation.common import (
    SOURCE,
    Controller,
    Measurement,
    Regulated,
    exciter_saturation,
    lag_of_feedback,
    rate_feedback,
    require_within,
)
from fmus.synchronous_generator.excitation.sources import COMPOUND, LOADED, Source
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    clamp,
    held_at_limits,
    limited_low_pass,
    limited_proportional_integral,
    second_order,
)
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and

_MOST = 1e9  # no upper limit [pu]

EXPIC1 = (
    number("K_A", 50.0, "Integral gain", 1e-6, "1/s"),
    seconds("T_A1", 0.1, "Lead of the integral"),
    pu("V_R1", 9.0, "Upper limit of the controller"),
    pu("V_R2", -9.0, "Lower limit of the controller"),
    seconds("T_A2", 0.02, "First lag; 0 leaves it out"),
    seconds("T_A3", 0.0, "Lead"),
    seconds("T_A4", 0.0, "Second lag; 0 leaves it out"),
    pu("V_RMAX", 9.0, "Upper limit of V_R"),
    pu("V_RMIN", -9.0, "Lower limit of V_R"),
    pu("K_F", 0.0, "Rate feedback; 0 leaves it out", 0),
    seconds("T_F1", 1.0, "First lag of the rate feedback"),
    seconds("T_F2", 0.0, "Second lag of the rate feedback; 0 leaves it out"),
    pu("E_FDMAX", 9.0, "Highest voltage into the exciter"),
    pu("E_FDMIN", -9.0, "Lowest voltage into the exciter"),
    pu("K_E", 1.0, "Exciter constant"),
    seconds("T_E", 0.5, "Exciter's field; 0: there is no exciter"),
)
PID = (
    pu("K_PR", 20.0, "Proportional gain", 0),
    number("K_IR", 20.0, "Integral gain", 0, "1/s"),
    number("K_DR", 0.0, "Derivative gain", 0, "s"),
    seconds("T_DR", 0.1, "Lag of the derivative; 0 leaves the derivative out"),
)
DC4B = (
    pu("V_RMAX", 10.8, "Upper limit of V_R at v_t = 1"),
    pu("V_RMIN", -7.0, "Lower limit of V_R at v_t = 1"),
    pu("K_A", 1.0, "Gain", 1e-3),
    seconds("T_A", 0.02, "Amplifier; 0 leaves the lag out"),
    pu("K_E", 1.0, "Exciter constant"),
    seconds("T_E", 0.8, "Exciter's field", 1e-3),
    pu("V_EMIN", 0.0, "Lower limit of E_fd"),
)
AC7B = (
    pu("V_RMAX", 5.8, "Upper limit of the first controller"),
    pu("V_RMIN", -5.8, "Lower limit of the first controller"),
    pu("K_PA", 65.0, "Proportional gain of the second controller", 0),
    number("K_IA", 60.0, "Integral gain of the second controller", 1e-6, "1/s"),
    pu("V_AMAX", 1.0, "Upper limit of the second controller"),
    pu("V_AMIN", -0.95, "Lower limit of the second controller"),
    pu("K_P", 5.0, "Potential source gain", 0.1),
    pu("K_L", 10.0, "V_R is at least minus this times the field current", 0),
    pu("K_F1", 0.2, "Feedback of E_fd", 0),
    pu("K_F2", 0.0, "Feedback of the field current", 0),
    pu("K_F3", 0.0, "Rate feedback of the field current; 0 leaves it out", 0),
    seconds("T_F3", 1.0, "Lag of the rate feedback"),
    pu("V_FEMAX", 999.0, "Highest field current, as V_FE"),
    pu("V_EMIN", 0.0, "Lower limit of V_E", 0),
)


def expic1(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, E_0 = declared(m, EXPIC1, SOURCE), seen.start.E_fd
        curve = exciter_saturation(m, 2.85, 0.3, 3.8, 0.6)
        rotates = p.T_E > 0

        source = Source(declared(m, (*COMPOUND[:2], LOADED[0]), SOURCE, {"K_P": 0.0}), seen)
        into_0 = if_else(rotates, p.K_E * E_0 + curve.part(E_0), E_0)
        V_R0 = into_0 / source.at_start
        require_within(m, V_R0, p.V_R2, p.V_R1, ("exciter.V_R2", "exciter.V_R1"))
        require_within(m, V_R0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        require_within(m, into_0, p.E_FDMIN, p.E_FDMAX, ("exciter.E_FDMIN", "exciter.E_FDMAX"))
        E = m.state("E", E_0, "pu", "Field voltage", base="E_fd")
        slow = m.state("feedback_2", E_0, "pu", "Field voltage through T_F2", base="E_fd")
        seen_by_rate = if_else(p.T_F2 > 0, slow, E)
        x = m.state("feedback", E_0, "pu", "rate feedback, slow part of the signal", base="E_fd")
        T_F1 = lag_of_feedback(m, p.T_F1, p.K_F)
        m.derivative(x, (seen_by_rate - x) / T_F1)
        m.require(
            if_else(logic_and(p.K_F > 0, p.T_E + p.T_F2 <= 0), -1, 1),
            "exciter.K_F > 0 needs exciter.T_E > 0 or exciter.T_F2 > 0",
        )
        measured = Measurement(m, seen)
        error = measured.error(0.0) - p.K_F / T_F1 * (seen_by_rate - x)
        V_A = limited_proportional_integral(
            m, "regulator", error, p.K_A * p.T_A1, p.K_A, low=p.V_R2, high=p.V_R1, initial=V_R0
        )
        lags = p.T_A2 + p.T_A4, p.T_A2 * p.T_A4
        m.require(
            if_else(logic_and(p.T_A3 > 0, lags[0] <= 0), -1, 1), "exciter.T_A3 > 0 needs a lag"
        )
        V_R = V_R0 + second_order(m, "lags", V_A - V_R0, lags, (p.T_A3, Expr(0)))
        V_R = clamp(V_R, p.V_RMIN, p.V_RMAX)

        def into(v_t: Phasor) -> Expr:
            return clamp(V_R * source.available(v_t), p.E_FDMIN, p.E_FDMAX)

        # v_t depends on E_fd, and E_fd on v_t if T_E = 0, weakly: two rounds from I_fd, the value of E_fd at rest
        driven = into(seen.terminal(into(seen.terminal(seen.I_fd))))
        T_E = if_else(rotates, p.T_E, BYPASS_TIME)
        back = if_else(rotates, p.K_E * E + curve.part(E), E)
        m.derivative(E, (driven - back) / T_E)
        E_fd = if_else(rotates, E, driven)
        m.derivative(slow, (E_fd - slow) / if_else(p.T_F2 > 0, p.T_F2, BYPASS_TIME))
        return measured.close(E_fd)


def dc4b(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        gains, p, E_0 = declared(m, PID, SOURCE), declared(m, DC4B, SOURCE), seen.start.E_fd
        curve = exciter_saturation(m, 2.4, 0.03, 5.0, 0.5)
        V_R0, v_0 = p.K_E * E_0 + curve.part(E_0), seen.start.v_t
        limits = v_0 * p.V_RMIN, v_0 * p.V_RMAX
        require_within(m, V_R0, *limits, ("exciter.V_RMIN", "exciter.V_RMAX"))
        require_within(m, E_0, p.V_EMIN, _MOST, ("exciter.V_EMIN", "exciter.V_EMIN"))
        x = m.state("E", E_0, "pu", "Field voltage", base="E_fd")
        E_fd = fmax(x, p.V_EMIN)
        V_F, _ = rate_feedback(m, E_fd, E_0, 0.0, 1.0)
        measured = Measurement(m, seen)
        control = Controller(m, gains, V_R0 / p.K_A, (p.V_RMIN / p.K_A, p.V_RMAX / p.K_A))
        signal = control(measured.error(control.error_at_start) - V_F)
        v_t = seen.terminal_voltage(E_fd)
        V_R = limited_low_pass(
            m, "amplifier", p.K_A * signal, p.T_A, v_t * p.V_RMIN, v_t * p.V_RMAX, initial=V_R0
        )
        rate = (V_R - p.K_E * E_fd - curve.part(E_fd)) / p.T_E
        m.derivative(x, held_at_limits(x, rate, p.V_EMIN, _MOST))
        return measured.close(E_fd)


def ac7b(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        gains, p = declared(m, PID, SOURCE), declared(m, AC7B, SOURCE)
        behind, E_0 = alternator(m, seen), seen.start.E_fd
        V_R0 = behind.V_FE_0
        V_A0, first_0 = V_R0 / (p.K_P * seen.start.v_t), p.K_F1 * E_0 + p.K_F2 * V_R0
        require_within(m, V_A0, p.V_AMIN, p.V_AMAX, ("exciter.V_AMIN", "exciter.V_AMAX"))
        require_within(m, first_0, p.V_RMIN, p.V_RMAX, ("exciter.V_RMIN", "exciter.V_RMAX"))
        x = m.state("feedback", V_R0, "pu", "rate feedback, slow part of the signal", base="E_fd")
        T_F3 = lag_of_feedback(m, p.T_F3, p.K_F3)
        m.derivative(x, (behind.V_FE - x) / T_F3)
        V_F = p.K_F3 / T_F3 * (behind.V_FE - x)
        measured = Measurement(m, seen)
        control = Controller(m, gains, first_0, (p.V_RMIN, p.V_RMAX))
        first = control(measured.error(control.error_at_start) - V_F)
        rest = first - p.K_F1 * behind.E_fd - p.K_F2 * behind.V_FE
        V_A = limited_proportional_integral(
            m, "second", rest, p.K_PA, p.K_IA, low=p.V_AMIN, high=p.V_AMAX, initial=V_A0
        )
        V_R = fmax(V_A * p.K_P * seen.terminal_voltage(behind.E_fd), -p.K_L * behind.V_FE)
        behind.drive_up_to(p.V_FEMAX, V_R, p.V_EMIN)
        return measured.close(behind.E_fd)

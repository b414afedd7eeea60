"""Excitation systems AC4A, ST1 and ST4B without ceilings (IEEE 421.5 structures), those of the case studies.

Each takes the machine's terminal voltage as a function of its own E_fd, because the transformer in
series makes |v_t| depend, weakly, on E_fd itself; returned are E_fd and the |v_t| that belongs to it."""

from fmus.synchronous_generator.data import NTS631, PAPER, STAMP
from fmus.synchronous_generator.excitation.common import Regulated
from fmus.toolchain.blocks import lead_lag, low_pass, proportional_integral
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, if_else, logic_and

# fixed-point passes for the algebraic loop of ST4B; each shrinks its error more than fiftyfold
LOOP_PASSES = 4


def ac4a(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """(1+sT_C)/(1+sT_B) → K_A/(1+sT_A)."""
    with m.scope("exciter"):
        K_A = m.parameter("K_A", 200, "pu", "Gain", base="E_fd", minimum=1, source=PAPER)
        T_A = m.parameter("T_A", 0.015, "s", "Amplifier", minimum=1e-3, source=PAPER)
        v_m, error = _measured_error(
            m, seen, seen.start.v_t + seen.start.E_fd / K_A, T_R=0.01, source=STAMP
        )
        compensated = _transient_gain_reduction(m, error, seen.start.E_fd / K_A, PAPER)
        E_fd = low_pass(m, "amplifier", K_A * compensated, T_A, seen.start.E_fd)
        return _close_measurement(m, v_m, E_fd, seen)


def st1(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """(1+sT_C)/(1+sT_B) → K_A: as AC4A, with an amplifier that has no lag."""
    with m.scope("exciter"):
        K_A = m.parameter("K_A", 200, "pu", "Gain", base="E_fd", minimum=1, source=NTS631)
        v_m, error = _measured_error(
            m, seen, seen.start.v_t + seen.start.E_fd / K_A, T_R=0.01, source=NTS631
        )
        E_fd = K_A * _transient_gain_reduction(m, error, seen.start.E_fd / K_A, NTS631)
        return _close_measurement(m, v_m, E_fd, seen)


def st4b(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """PI → 1/(1+sT_A) → × K_P·|v_t|·f_ex, fed from the machine's own terminal through a rectifier."""
    with m.scope("exciter"):
        K_PR = m.parameter(
            "K_PR", 3.15, "pu", "Proportional gain", base="E_fd", minimum=0, source=NTS631
        )
        K_IR = m.parameter("K_IR", 3.15, "1/s", "Integral gain", minimum=1e-6, source=NTS631)
        T_A = m.parameter("T_A", 0.02, "s", "Bridge", minimum=1e-3, source=NTS631)
        K_P = m.parameter(
            "K_P", 6.5, "pu", "Potential source gain", base="E_fd", minimum=0.1, source=NTS631
        )
        K_C = m.parameter(
            "K_C", -0.08, "pu", "Rectifier loading factor", base="E_fd", source=NTS631
        )

        def bridge(v_t: Expr, field_current: Expr) -> Expr:
            f_ex = 1 - 0.577 * K_C * field_current / (K_P * v_t)
            return K_P * v_t * f_ex

        control_0 = seen.start.E_fd / bridge(seen.start.v_t, seen.start.E_fd)
        v_m, error = _measured_error(m, seen, seen.start.v_t, T_R=0.02, source=NTS631)
        control = proportional_integral(m, "regulator", error, K_PR, K_IR, control_0)
        control = low_pass(m, "bridge", control, T_A, control_0)
        E_fd = seen.I_fd  # equal in steady state: a good first guess
        for _ in range(LOOP_PASSES):
            E_fd = control * bridge(seen.terminal_voltage(E_fd), seen.I_fd)
        return _close_measurement(m, v_m, E_fd, seen)


def _measured_error(
    m: ModelBuilder, seen: Regulated, V_ref_0: Scalar, *, T_R: float, source: str
) -> tuple[tuple[Expr, Expr], Expr]:
    """Declare the voltage measurement and the reference; return the measurement (state, T_R) and the error."""
    T = m.parameter("T_R", T_R, "s", "Voltage measurement", minimum=1e-3, source=source)
    V_ref = m.calculated(
        "V_ref", V_ref_0, "pu", "Voltage reference of the operating point", base="S_n"
    )
    delta = m.parameter(
        "delta_V_ref", 0.0, "pu", "Change of the voltage reference", base="S_n", tunable=True
    )
    v_m = m.state("v_m", seen.start.v_t, "pu", "Measured terminal voltage", base="S_n")
    return (v_m, T), V_ref + delta + seen.v_s - v_m


def _transient_gain_reduction(m: ModelBuilder, error: Expr, initial: Scalar, source: str) -> Expr:
    T_C = m.parameter("T_C", 1.0, "s", "Transient gain reduction, lead", minimum=0, source=source)
    T_B = m.parameter("T_B", 10.0, "s", "Transient gain reduction, lag", minimum=0, source=source)
    m.require(
        if_else(logic_and(T_B <= 0, T_C > 0), -1, 1),
        "exciter.T_B = 0 needs exciter.T_C = 0 as well",
    )
    return lead_lag(m, "lead_lag", error, T_C, T_B, initial)


def _close_measurement(
    m: ModelBuilder, measurement: tuple[Expr, Expr], E_fd: Expr, seen: Regulated
) -> tuple[Expr, Expr]:
    v_m, T_R = measurement
    v_t = seen.terminal_voltage(E_fd)
    m.derivative(v_m, (v_t - v_m) / T_R)
    return E_fd, v_t

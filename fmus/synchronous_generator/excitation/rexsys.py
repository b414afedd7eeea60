"""REXSYS, a general exciter on the machine's shaft with a voltage regulator and a regulator of the exciter's field.

    V_ref + V_S − v_m − V_F, within ±V_IMAX → K_VP + K_VI/s → (1+sT_C1)/(1+sT_B1) → (1+sT_C2)/(1+sT_B2)
    → 1/(1+sT_A) = V_R, held within F·V_RMIN and F·V_RMAX
    V_R − K_H·V_FE → K_IP + K_II/s → 1/(1+sT_P) = V_C, held within F·V_FMIN and F·V_FMAX
    T_E·dV_E/dt = V_C − V_FE,  V_E ≥ 0,  V_FE = (K_E + S_E(V_E))·V_E + K_D·I_FD
    E_fd = V_E·F_EX(K_C·I_FD/V_E)
    V_F = s·K_F·(1+sT_F1)/((1+sT_F)·(1+sT_F2)) of V_R, V_FE or E_fd, as F_BF = 0, 1 or 2 says
    F = (1 + F_1IMF·(v_t − 1))·(K_E + K_D + S_E(V_E)), by which limits follow the supply

With F_BF = 1, K_IP = 1, T_A alone and neither integral nor K_H it is AC1A; with K_H EXAC2 without its limiter; with
F_BF = 2 and neither K_C nor K_D DC1A.

Sources: OpenIPSL's REXSYS at c482ff5b, after PSS/E's manual, which has F of the start alone and lets the lag before the
limits V_FMIN and V_FMAX wind up; OPAL-RT's ephasorsim-modelica-library at cba975b8, whose diagrams have V_IMAX before
the regulator and V_E ≥ 0. InterPSS has the limits times v_t where F_1IMF = 1, without K_E + K_D + S_E."""

from fmus.synchronous_generator.data_lines import declared, number, power, pu, seconds
from fmus.synchronous_generator.excitation.alternator import Alternator, alternator
from fmus.synchronous_generator.excitation.common import (
    SOURCE,
    Measurement,
    Regulated,
    lead_lag_stage,
    rate_feedback,
    require_within,
)
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    clamp,
    close_limited_low_pass,
    lead_lag,
    limited_low_pass,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, if_else, logic_and

REXSYS = (
    pu("K_VP", 350.0, "Proportional gain of the voltage regulator", 0),
    number("K_VI", 0.0, "Integral gain of the voltage regulator", 0, "1/s"),
    power("V_IMAX", 999.0, "Limit of the error, to both sides", 0),
    seconds("T_A", 0.02, "Amplifier; 0 leaves the lag out"),
    pu("V_RMAX", 101.6, "Upper limit of V_R where F = 1"),
    pu("V_RMIN", -101.6, "Lower limit of V_R where F = 1"),
    seconds("T_F1", 0.0, "Lead of the rate feedback"),
    seconds("T_F2", 0.0, "Second lag of the rate feedback; 0 leaves the stage out"),
    number("F_BF", 1.0, "Rate feedback of V_R (0), of the field current (1), of E_fd (2)", 0),
    pu("K_IP", 1.0, "Proportional gain of the field current's regulator", 0),
    number("K_II", 0.0, "Integral gain of the field current's regulator", 0, "1/s"),
    seconds("T_P", 0.0, "Bridge; 0 leaves the lag out"),
    pu("V_FMAX", 999.0, "Upper limit of the exciter's field where F = 1"),
    pu("V_FMIN", -999.0, "Lower limit of the exciter's field where F = 1"),
    pu("K_H", 0.0, "Feedback of the field current", 0),
    number("F_1IMF", 0.0, "How limits follow the terminal voltage: 0 not, 1 in proportion", 0),
)

_OF_REGULATOR = 0.5  # value of F_BF below which the rate feedback is of V_R
_OF_FIELD_VOLTAGE = 1.5  # value of F_BF above which it is of E_fd
_NO_GAIN = 1e-9  # gain that is none


def rexsys(m: ModelBuilder, seen: Regulated) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        p, behind = declared(m, REXSYS, SOURCE), alternator(m, seen)
        E_0, V_C0 = seen.start.E_fd, behind.V_FE_0
        scale_0 = _scale(behind, p.F_1IMF, seen.start.v_t, behind.constant_0)
        m.require(
            behind.constant_0 + behind.p.K_D - _NO_GAIN,
            "exciter: K_E + K_D + S_E must exceed 0 at the start, as its limits are times it; raise K_E",
        )
        m.require(p.K_VP + p.K_VI - _NO_GAIN, "exciter: one of K_VP and K_VI must exceed 0")
        m.require(p.K_IP + p.K_II - _NO_GAIN, "exciter: one of K_IP and K_II must exceed 0")
        V_R0 = p.K_H * V_C0 + _input_at_start(V_C0, p.K_IP, p.K_II)
        of_regulator = (scale_0 * p.V_RMIN, scale_0 * p.V_RMAX)
        require_within(m, V_R0, *of_regulator, ("exciter.V_RMIN", "exciter.V_RMAX"))
        of_field = (scale_0 * p.V_FMIN, scale_0 * p.V_FMAX)
        require_within(m, V_C0, *of_field, ("exciter.V_FMIN", "exciter.V_FMAX"))
        error_0 = _input_at_start(V_R0, p.K_VP, p.K_VI)
        require_within(m, error_0, -p.V_IMAX, p.V_IMAX, ("exciter.V_IMAX", "exciter.V_IMAX"))

        E_fd = behind.E_fd
        v_t = seen.terminal_voltage(E_fd)
        scale = _scale(behind, p.F_1IMF, v_t, behind.constant)
        low, high = scale * p.V_RMIN, scale * p.V_RMAX
        amplifier = m.state("amplifier", V_R0, "pu", "first-order lag with limits", base="E_fd")
        fed_back = _fed_back(p.F_BF, clamp(amplifier, low, high), behind.V_FE, E_fd)
        fast, K_F = rate_feedback(m, fed_back, _fed_back(p.F_BF, V_R0, V_C0, E_0), 0.0487, 2.0)
        V_F = lead_lag(m, "feedback_2", fast, p.T_F1, p.T_F2)
        loop = logic_and(logic_and(K_F > 0, p.F_BF < _OF_REGULATOR), p.T_A <= 0)
        m.require(
            if_else(loop, -1, 1), "exciter.F_BF = 0 with exciter.K_F > 0 needs exciter.T_A > 0"
        )
        m.require(
            if_else(logic_and(p.T_F2 <= 0, p.T_F1 > 0), -1, 1),
            "exciter.T_F2 = 0 needs exciter.T_F1 = 0 as well",
        )

        measured = Measurement(m, seen)
        error = clamp(measured.error(error_0) - V_F, -p.V_IMAX, p.V_IMAX)
        signal = _regulated(m, "regulator", error, (p.K_VP, p.K_VI), V_R0)
        first = lead_lag_stage(m, signal, V_R0, "1")
        second = lead_lag_stage(m, first, V_R0, "2")
        V_R = close_limited_low_pass(m, amplifier, second, p.T_A, low, high)

        rest = V_R - p.K_H * behind.V_FE
        driven = _regulated(m, "field_regulator", rest, (p.K_IP, p.K_II), V_C0)
        low, high = scale * p.V_FMIN, scale * p.V_FMAX
        behind.drive(limited_low_pass(m, "bridge", driven, p.T_P, low, high, initial=V_C0))
        return measured.close(E_fd)


def _scale(behind: Alternator, share: Expr, v_t: Expr, constant: Expr) -> Expr:
    """F, by which the limits are multiplied; ``constant``: K_E + S_E(V_E) [pu]."""
    return fmax(1 + share * (v_t - 1), 0) * fmax(constant + behind.p.K_D, 0)


def _input_at_start(output: Expr, K_P: Expr, K_I: Expr) -> Expr:
    """Return the input of a proportional part in steady state: nothing beside an integral."""
    return if_else(K_I > 0, 0, output / fmax(K_P, _NO_GAIN))


def _regulated(
    m: ModelBuilder, name: str, error: Expr, gains: tuple[Expr, Expr], at_start: Expr
) -> Expr:
    """K_P + K_I/s of an error; ``gains``: K_P and K_I, at 0 without an integral; ``at_start``: its output."""
    K_P, K_I = gains
    x = m.state(name, if_else(K_I > 0, at_start, 0), "pu", "integrator", base="E_fd")
    m.derivative(x, if_else(K_I > 0, K_I * error, -x / BYPASS_TIME))
    return K_P * error + x


def _fed_back(choice: Expr, V_R: Expr, V_FE: Expr, E_fd: Expr) -> Expr:
    """The signal that F_BF chooses."""
    others = if_else(choice > _OF_FIELD_VOLTAGE, E_fd, V_FE)
    return if_else(choice < _OF_REGULATOR, V_R, others)

"""ST4B: two PI controllers and a rectifier fed from the machine's terminal (potential source).

    V_ref + V_S − v_m → K_PR + K_IR/s within V_RMIN and V_RMAX → 1/(1+sT_A) → − K_G·E_fd
    → K_PM + K_IM/s within V_MMIN and V_MMAX = V_M
    E_fd = V_M·V_B,  V_B = min(V_E·F_EX(K_C·I_FD/V_E), V_BMAX),  V_E = K_P·v_t

The standard's source from the stator current (K_I, X_L, θ_P) is left out. An integrator stops while its output is at a
limit. Two fixed-point passes close the loop through v_t."""

from collections.abc import Callable
from dataclasses import dataclass

from fmus.synchronous_generator.excitation.common import (
    Measurement,
    TerminalVoltage,
    gain,
    rectifier,
    require_within,
    time,
)
from fmus.synchronous_generator.machine import Start
from fmus.toolchain.blocks import BYPASS_TIME, clamp, limited_proportional_integral, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and, logic_or


@dataclass(frozen=True)
class _Inner:
    """The inner controller: gains, limits, and its value in steady state."""

    K_G: Expr
    K_PM: Expr
    K_IM: Expr
    low: Expr
    high: Expr
    at_start: Expr


def st4b(
    m: ModelBuilder, start: Start, terminal_voltage: TerminalVoltage, I_fd: Expr, v_s: Scalar = 0.0
) -> tuple[Expr, Expr]:
    """Declare it and return (E_fd, |v_t|) [pu]."""
    with m.scope("exciter"):
        K_PR = gain(m, "K_PR", 3.15, "Proportional gain", 0)
        K_IR = m.parameter("K_IR", 3.15, "1/s", "Integral gain", minimum=1e-6)
        high, low = gain(m, "V_RMAX", 1.0, "Upper limit of V_R"), gain(m, "V_RMIN", -0.87, "Lower limit of V_R")
        T_A = time(m, "T_A", 0.02, "Bridge; 0 leaves the lag out")
        source = _source(m)
        inner = _inner(m, start.E_fd / source(start.v_t, start.E_fd))
        V_A0 = if_else(inner.K_IM > 0, 0, inner.at_start / fmax(inner.K_PM, 1e-9)) + inner.K_G * start.E_fd
        require_within(m, V_A0, low, high, ("exciter.V_RMIN", "exciter.V_RMAX"))
        measured = Measurement(m, start, terminal_voltage, I_fd)
        error = measured.error(0.0, v_s)
        V_R = limited_proportional_integral(m, "regulator", error, K_PR, K_IR, low, high, V_A0)
        V_A = low_pass_or_nothing(m, "bridge", V_R, T_A, V_A0)
        x = m.state("inner", if_else(inner.K_IM > 0, inner.at_start, 0), "pu", "integrator with limits", base="E_fd")

        def field_voltage(v_t: Expr) -> Expr:
            V_B = source(v_t, I_fd)
            free = (inner.K_PM * V_A + x) / (1 + V_B * inner.K_PM * inner.K_G)
            return V_B * clamp(free, inner.low, inner.high)

        E_fd = field_voltage(terminal_voltage(field_voltage(measured.nearly)))
        rest = V_A - inner.K_G * E_fd
        free = inner.K_PM * rest + x
        outward = logic_or(logic_and(free > inner.high, rest > 0), logic_and(free < inner.low, rest < 0))
        without = -x / BYPASS_TIME  # no integrator, and no eigenvalue of 0
        m.derivative(x, if_else(inner.K_IM > 0, if_else(outward, 0, inner.K_IM * rest), without))
        return measured.close(E_fd)


def _source(m: ModelBuilder) -> Callable[[Expr, Expr], Expr]:
    """V_B [pu] of |v_t| and field current."""
    K_P = gain(m, "K_P", 6.5, "Potential source gain", 0.1)
    K_C = gain(m, "K_C", 0.08, "Rectifier loading factor", 0)
    V_BMAX = gain(m, "V_BMAX", 8.0, "Upper limit of V_B", 0.1)

    def V_B(v_t: Expr, field_current: Expr) -> Expr:
        V_E = fmax(K_P * v_t, 1e-3)
        return fmin(V_E * rectifier(K_C * field_current / V_E), V_BMAX)

    return V_B


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

"""OEL3C (IEEE 421.5-2016): a limiter of overexcitation whose integral is its inverse time and its control.

    I = K_scale·u through 1/(1+sT_F), u = E_fd where the input is 1, else I_fd
    e = K_oel·(I_TFpu^K_1 − I^K_1)
    dx/dt = e/T_oel, within V_OELMIN1 and V_OELMAX1
    V_OEL = x + (K_P·e while x < 0, else 0), within V_OELMIN2 and V_OELMAX2, added to the voltage reference

At rest x is V_OELMAX1: beyond the pickup it falls, and it limits from x = 0 on, after T_oel·V_OELMAX1/(−e). An
operating point beyond I_TFpu rests too, and a warning says so: the pickup is taken 1 % above it. T_F = 0 lets the
field current pass; the field voltage keeps a lag of `BYPASS_TIME`.

Sources: the equations are those of Dynawo's Oel3c at 202fe610, which was read and not run; sample data those of the
page of CRESYM's library. Dynawo starts at x = 0, with the pickup at the operating point. The order of the record's
fields, and with it the place of its flag, is that of the parameters in PowerWorld's help, which has the same order as
PSS/E for OEL2C but for a flag at its end; OEL3C has one flag, which is first in both. The help calls an input of 0 the
field current, 1 the field voltage and 2 the exciter's field current; no other public source has OEL3C's inputs."""

from fmus.synchronous_generator.data_lines import declared, number, power, seconds
from fmus.synchronous_generator.excitation.common import Regulated
from fmus.synchronous_generator.limiters.common import (
    Limited,
    limit_that_rests,
    rate_within_limits,
    sensed_field,
)
from fmus.toolchain.blocks import clamp
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, fmin, if_else, logic_or

OEL3C = (
    number("input", 0.0, "1: it limits the field voltage; else the field current", 0),
    number("I_TFpu", 3.7, "Pickup of the inverse time [pu of the input]", 1e-4),
    number("K_scale", 1.0, "Scale of the input", 1e-4),
    seconds("T_F", 0.02, "Lag of the input; 0 leaves it out"),
    number("K_1", 1.0, "Exponent of the error", 1e-3),
    number("K_oel", 1.0, "Gain of the error", 1e-4),
    seconds("T_oel", 24.0, "Time constant of the integral", 1e-3),
    number("K_P", 1.0, "Proportional gain, while the integral is below 0", 0),
    power("V_OELMAX1", 0.66, "Upper limit of the integral", 0),
    power("V_OELMIN1", -1.0, "Lower limit of the integral"),
    power("V_OELMAX2", 0.0, "Largest signal", 0),
    power("V_OELMIN2", -1.0, "Least signal"),
)
_SOURCE = "CRESYM's library, sample data"

_OF_VOLTAGE = (0.5, 1.5)  # values of the input between which it is the field voltage
_LEAST_INPUT = 1e-6  # input [pu of it] that is raised to a power: 0 has no rate of change


def oel3c(m: ModelBuilder, seen: Regulated) -> Limited:
    """Declare the limiter and return its signal to the voltage reference [pu]."""
    p = declared(m, OEL3C, _SOURCE)
    for lower in ("V_OELMIN1", "V_OELMIN2"):
        is_below = if_else(getattr(p, lower) <= 0, 1, -1)
        m.require(is_below, f"oel.{lower} must not exceed 0")
    pickup = m.calculated(
        "I_TFpu_taken",
        limit_that_rests(p.I_TFpu, p.K_scale * seen.start.E_fd),
        "1",
        "I_TFpu, or 1 % above the operating point where that is beyond it [pu of the input]",
    )
    of_current = logic_or(p.input <= _OF_VOLTAGE[0], p.input >= _OF_VOLTAGE[1])
    I_now, close = sensed_field(m, seen, of_current, p.K_scale, p.T_F)
    e = p.K_oel * (pickup**p.K_1 - _raised(I_now, p.K_1))
    x = m.state("integrator", p.V_OELMAX1, "pu", "Integral of the error", base="S_n")
    m.derivative(x, rate_within_limits(x, e / p.T_oel, p.V_OELMIN1, p.V_OELMAX1))
    signal = clamp(x + if_else(x < 0, p.K_P * e, 0), p.V_OELMIN2, p.V_OELMAX2)
    at_rest = fmin(p.V_OELMAX1, p.V_OELMAX2)
    return Limited(signal, at_rest, close, at_rest)


def _raised(value: Expr, exponent: Expr) -> Expr:
    return fmax(value, _LEAST_INPUT) ** exponent

"""LCFB1: a slow outer loop that moves a governor's reference until the machine feeds again what it fed at the start.

    e = P_e,0 − P_e/(1+sT_pelec), while `power_control`, less F_b·(w − 1), while `frequency_bias`
    e beyond ± db, within ± E_max → K_P + K_I/s, its integral and the sum within ± Ir_max, added to the reference

Powers are per unit of the rating, and what it adds is too, as STEPS has it; PSLF's LCFB1 scales it by the kind of its
governor's reference. Within the deadband the integral rests where it is.

Sources: STEPS at e5579d20 (`lcfb1.cpp`: diagram, and order of the record's fields; its K_P·e is always 0, by a
condition that always holds); IEC 61970-302's TurbLCFB1; PowerWorld's help on LCFB1_PTI."""

from fmus.synchronous_generator.data_lines import declared, number, power, seconds
from fmus.synchronous_generator.limiters.common import rate_within_limits
from fmus.synchronous_generator.turbines.governors import LOAD_CONTROL
from fmus.synchronous_generator.variants import Governor, Shaft
from fmus.toolchain.blocks import BYPASS_TIME, limit, low_pass_or_nothing
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, fmin, if_else, logic_and, logic_or

_SOURCE = "IEC 61970-302, typical values"
LCFB1 = (
    number("F_b", 0.0, "Frequency bias [pu of power by pu of speed]", 0),
    seconds("T_pelec", 0.0, "Lag of the measured power; 0 leaves it out"),
    power("db", 0.0, "Half of the deadband of the error", 0),
    power("E_max", 0.02, "Largest error", 0),
    number("K_P", 0.0, "Proportional gain", 0),
    number("K_I", 0.01, "Integral gain", 0, "1/s"),
    power("Ir_max", 1.0, "Largest change of the reference", 0),
)


def with_load_control(governor: Governor) -> Governor:
    """The same governor with a load controller LCFB1 at its power reference."""

    def declare(m: ModelBuilder, shaft: Shaft) -> Expr:
        with m.scope("governor"), m.scope("lcfb1"):
            signal = _signal(m, shaft)
        m.hand_over(LOAD_CONTROL, signal)
        return governor(m, shaft)

    return declare


def _signal(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare the controller and return what it adds to the reference [pu, S_n]."""
    p = declared(m, LCFB1, _SOURCE)
    of_power = m.switch("power_control", True, "Holds the electrical power of the start")
    of_speed = m.switch("frequency_bias", False, "Gives power by the deviation of the speed")
    measured = low_pass_or_nothing(m, "P_measured", shaft.P_e, p.T_pelec, shaft.P_e_0)
    error = of_power * (shaft.P_e_0 - measured) - of_speed * p.F_b * (shaft.w - 1)
    beyond = limit(fmax(error - p.db, 0) + fmin(error + p.db, 0), p.E_max)
    x = m.state("integral", 0.0, "pu", "Integral of the error", base="S_n")
    waits = logic_or(p.K_I <= 0, logic_and(of_power < 1, of_speed < 1))
    rate = if_else(waits, -x / BYPASS_TIME, p.K_I * beyond)
    m.derivative(x, rate_within_limits(x, rate, -p.Ir_max, p.Ir_max))
    return limit(p.K_P * beyond + x, p.Ir_max)

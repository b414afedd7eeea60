"""OEL4C (IEEE 421.5-2016): a limiter of the machine's reactive power.

    Q: reactive power at the terminal, per unit of S_n
    e = Q_ref − Q once it has been negative for T_delay without a break, else 0; with T_delay = 0 e = Q_ref − Q always
    V_OEL = (K_P + K_I/s)·e, within V_min and 0, where the integral waits, added to the voltage reference

Where Q falls below Q_ref the proportional part goes, and the integral stays as it is: the limiter does not let go by
itself unless T_delay is 0. The machine rests at the start: an operating point beyond Q_ref rests too, with Q_ref moved,
and a warning says so.

Sources: the equations are those of Dynawo's Oel4c at 3344a239, which was read and not run, the data those of the page
of CRESYM's library. The order of the record's fields is that of the parameters in PowerWorld's help, which has no flag
among them; a Q_ref of 0 means the power flow's greatest reactive power there."""

from fmus.synchronous_generator.data_lines import declared, number, power
from fmus.synchronous_generator.excitation.common import Regulated
from fmus.synchronous_generator.limiters.common import Limited, moved_edge, time_that_lasts
from fmus.toolchain.blocks import RETURN_TIME, clamp
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, if_else, logic_and, logic_or

OEL4C = (
    power("Q_ref", 0.6, "Reactive power from which it limits"),
    number("T_delay", 20.0, "Time beyond it after which the limiter starts", 0, "s"),
    number("K_P", 1.0, "Proportional gain", 0),
    number("K_I", 1.0, "Integral gain", 0, "1/s"),
    power("V_min", -0.2, "Least signal"),
)
_SOURCE = "CRESYM's library, sample data; Q_ref: power factor 0.8"

_NO_GAIN = 1e-9  # gain that is none
_NEAR = 5e-4
"""Distance [pu] from its rest within which an integral that waits returns there, so that a linear model can be made."""


def oel4c(m: ModelBuilder, seen: Regulated) -> Limited:
    """Declare the limiter and return its signal to the voltage reference [pu]."""
    p = declared(m, OEL4C, _SOURCE)
    m.require(if_else(p.V_min <= 0, 1, -1), "oel.V_min must not exceed 0")
    m.require(p.K_P + p.K_I - _NO_GAIN, "oel: one of K_P and K_I must exceed 0")
    Q_0 = (seen.v_0 * seen.start.i.conjugate()).im
    moved = moved_edge(m, Q_0 - p.Q_ref, Expr(1))
    Q = (seen.terminal(seen.I_fd) * seen.i.conjugate()).im
    excess = Expr(Q) - p.Q_ref - moved
    m.output("excess", excess, "pu", "Reactive power beyond Q_ref", base="S_n")
    lasted = time_that_lasts(m, "beyond_for", excess > 0, p.T_delay)
    e = if_else(lasted >= p.T_delay, -excess, 0)
    x = m.state("integrator", 0.0, "pu", "Integral of the error", base="S_n")
    wanted = p.K_P * e + x
    above, below = logic_and(wanted > 0, e > 0), logic_and(wanted < p.V_min, e < 0)
    waits = logic_or(logic_or(above, below), fabs(p.K_I * e) <= 0)
    back = if_else(fabs(x) < _NEAR, -x / RETURN_TIME, 0)
    m.derivative(x, if_else(waits, back, p.K_I * e))
    return Limited(clamp(wanted, p.V_min, 0), 0.0, lambda E_fd: None)

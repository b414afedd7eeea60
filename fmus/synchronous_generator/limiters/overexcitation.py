"""MAXEX1 and MAXEX2: limiters of the field voltage or the field current with an inverse time.

    u = E_fd, or I_fd where MAXEX2's switch says so, per unit of EFDRATED
    u > EFD1: dz/dt = 1/T(u), T through (EFD1, TIME1), (EFD2, TIME2), (EFD3, TIME3), TIME3 beyond; else z = 0
    from z = 1 on, until V_OEL is within 0.1 % of VLOW again:
    dV_OEL/dt = KMX·EFDRATED·(EFDDES − u), held within VLOW and 0; else V_OEL = 0

V_OEL is added to the voltage reference. An operating point beyond EFD1 may last, so that the machine rests there: the
time then runs from 1 % above it, and a warning says so. The time is forgotten at once where u falls to EFD1; Dynawo
forgets it at 98 % of that. KMX is a gain, as in Dynawo and in CIM's OverexcLimX2 (typically 0.002); the page of RAMSES
writes its inverse.

Sources: STEPSS' page of RAMSES' exciters (timer, latch, limited integrator), IEC 61970-302's OverexcLimX1 and
OverexcLimX2, Dynawo's MAXEX2 at 289313a. PSS/E's own text is not public: what it does while the time is forgotten, or
while the limiter lets go, is not known."""

from functools import partial

from fmus.synchronous_generator.data_lines import Given, declared, number, pu
from fmus.synchronous_generator.excitation.common import Regulated
from fmus.synchronous_generator.limiters.common import Limited, rate_within_limits
from fmus.toolchain.blocks import RETURN_TIME, clamp
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, fmin, if_else, logic_or

SOURCE = "typical data, IEC 61970-302"
MAXEX = (
    pu("EFDRATED", 2.5, "Rated field voltage, or current", 1e-3),
    number("EFD1", 1.1, "First point of the inverse time [of EFDRATED]", 0),
    number("TIME1", 120.0, "Time at the first point", 0, "s"),
    number("EFD2", 1.2, "Second point of the inverse time [of EFDRATED]", 0),
    number("TIME2", 40.0, "Time at the second point", 0, "s"),
    number("EFD3", 1.5, "Third point of the inverse time [of EFDRATED]", 0),
    number("TIME3", 15.0, "Time at the third point, and beyond it", 0, "s"),
    number("EFDDES", 1.0, "Field voltage, or current, that it brings about [of EFDRATED]", 0),
    number("KMX", 0.002, "Gain of the integrator", 0, "1/s"),
    number("VLOW", -0.5, "Least signal [pu of the voltage]"),
)

_MOST = (
    2.0  # share of its time that the limiter counts to: it acts from 1 on, which is then no edge
)
_LET_GO = (
    1e-3  # share of VLOW within which the limiter lets go: its signal then returns to 0 at once
)
_ALLOWED = 1.01  # of an operating point beyond the limit, which may last: further than rounding
_APART = 1e-9  # least distance of two points of the inverse time that is divided by


def maxex2(m: ModelBuilder, seen: Regulated, *, chooses: bool = True) -> Limited:
    """Declare the limiter and return its signal; ``chooses``: whether it may limit the field current."""
    of_current = Expr(0)
    if chooses:
        of_current = m.switch("of_current", True, "Limits the field current; else the voltage")
    p = declared(m, MAXEX, SOURCE)
    m.require(if_else(p.VLOW <= 0, 1, -1), "oel.VLOW must not exceed 0")
    at_start = seen.start.E_fd / p.EFDRATED
    first = m.calculated(
        "first_point",
        if_else(at_start > p.EFD1, _ALLOWED * at_start, p.EFD1),
        "1",
        "EFD1, or 1 % above the operating point where that is beyond EFD1 [of EFDRATED]",
    )
    time = m.state("time", 0.0, "1", "Share of the inverse time that has elapsed")
    x = m.state("integrator", 0.0, "pu", "Signal of the limiter", base="S_n")

    def close(E_fd: Expr) -> None:
        u = if_else(of_current > 0, seen.I_fd, E_fd) / p.EFDRATED
        rate = 1 / fmax(_inverse_time(p, u), RETURN_TIME)
        counted = fmin(rate, (_MOST - time) / RETURN_TIME)
        m.derivative(time, if_else(u > first, counted, -time / RETURN_TIME))
        integrates = logic_or(time >= 1, x < _LET_GO * p.VLOW)
        reduces = p.KMX * p.EFDRATED * (p.EFDDES - u)
        moves = if_else(integrates, reduces, -x / RETURN_TIME)
        m.derivative(x, rate_within_limits(x, moves, p.VLOW, 0.0))

    return Limited(clamp(x, p.VLOW, 0.0), 0.0, close)


maxex1 = partial(maxex2, chooses=False)  # MAXEX2 of the field voltage alone


def _inverse_time(p: Given, u: Expr) -> Expr:
    """Time [s] that the limiter waits at a steady field voltage or current."""

    def between(u_1: Expr, t_1: Expr, u_2: Expr, t_2: Expr) -> Expr:
        return t_1 + (t_2 - t_1) * clamp((u - u_1) / fmax(u_2 - u_1, _APART), 0, 1)

    first = between(p.EFD1, p.TIME1, p.EFD2, p.TIME2)
    return if_else(u < p.EFD2, first, between(p.EFD2, p.TIME2, p.EFD3, p.TIME3))

"""OEL2C (IEEE 421.5-2016): a limiter of overexcitation with an inverse time and two limits of the field current.

    I = K_scale·u through 1/(1+sT_R), u = E_fd, or I_fd where the input is 2; I_act = K_act·I; r = I/I_TFpu
    timer:      dT/dt = w − K_FB·T, within T_min and T_max
                w = K_2·(r^c_2 − 1) within V_INVMIN and V_INVMAX, plus FIXED_ru for r ≤ 1, FIXED_rd above
    reference:  dI_ref/dt = K_ru for T_FCL − T ≥ K_ZRU·T_FCL, K_rd for T ≥ T_FCL, else 0, within I_lim and I_inst;
                with SW = 2 both rates are K_1·(r^c_1 − 1)
    activation: it is set for T ≥ T_FCL, for I_act > I_ref during T_en, and always for T_en = 0; it is released for
                I_ref = I_inst and I_ref − I_act > I_THoff during T_off; until it is set I_bias = I_reset, then 0
    signal:     e = I_bias + I_ref/(1+sT_A) − I_act → K_P + K_I/s + sK_D/(1+sT_D), within V_OELMIN3 and V_OELMAX3,
                where the integral waits → (1+sT_C2)/(1+sT_B2), within V_OELMIN2 and V_OELMAX2
                → (1+sT_C1)/(1+sT_B1), within V_OELMIN1 and V_OELMAX1 = V_OEL, added to the voltage reference

The machine rests at the start: the timer where it would end up, the integral where the upper limit is reached. An
operating point beyond I_TFpu, I_inst, or beyond I_lim where the timer has run out, rests too, and a warning says so:
that limit is taken 1 % above it. T_R = 0 lets the field current pass; the field voltage keeps a lag of `BYPASS_TIME`.

Sources: the order of the fields, what the flags do, and activation as InterPSS has them (`Oel2cData`,
`Oel2cOverExcitationLimiter`), which it holds against PSS/E; timer, reference and typical data as Dynawo's Oel2c and
the page of CRESYM's library have them after the standard. Which of FIXED_ru and FIXED_rd counts below I_TFpu is so in
both. The rated field current of the record is in neither."""

from dataclasses import dataclass

from fmus.synchronous_generator.data_lines import Given, declared, number, power, seconds
from fmus.synchronous_generator.excitation.common import Regulated
from fmus.synchronous_generator.limiters.common import (
    Limited,
    limit_that_rests,
    rate_within_limits,
    sensed_field,
    time_that_lasts,
)
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    RETURN_TIME,
    clamp,
    lead_lag,
    low_pass_or_nothing,
    washout,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fabs, fmax, fmin, if_else, logic_and, logic_or

OEL2C = (
    number("input", 2.0, "1: it limits the field voltage; 2: the field current", 0),
    number("SW", 1.0, "1: the reference moves at fixed rates; 2: as the current says", 0),
    seconds("T_C1", 0.1, "Lead of the last stage"),
    seconds("T_B1", 0.1, "Lag of the last stage; 0 leaves it out"),
    seconds("T_C2", 0.1, "Lead of the stage before"),
    seconds("T_B2", 0.1, "Lag of the stage before; 0 leaves it out"),
    number("K_P", 0.3, "Proportional gain", 0),
    number("K_I", 1.0, "Integral gain", 0, "1/s"),
    number("K_D", 0.0, "Derivative gain", 0, "s"),
    seconds("T_D", 0.1, "Lag of the derivative; 0 leaves it out"),
    power("V_OELMAX3", 0.0, "Upper limit of the controller"),
    power("V_OELMIN3", -100.0, "Lower limit of the controller"),
    power("V_OELMAX2", 0.0, "Upper limit behind the first stage"),
    power("V_OELMIN2", -100.0, "Lower limit behind the first stage"),
    power("V_OELMAX1", 0.0, "Largest signal"),
    power("V_OELMIN1", -10.0, "Least signal"),
    number("I_reset", 100.0, "What is added to the reference until it is set [pu of the input]"),
    number("T_en", 0.2, "Time above the reference after which it is set", 0, "s"),
    number("T_off", 5.0, "Time below the reference after which it is released", 0, "s"),
    number("I_THoff", 0.05, "Distance below the reference that releases it [pu of the input]"),
    number("K_scale", 1.0, "Scale of the input", 1e-4),
    seconds("T_R", 0.01, "Lag of the input; 0 leaves it out"),
    number("K_act", 1.0, "Scale of the input that is compared with the reference", 1e-4),
    number("I_TFpu", 3.0, "Pickup of the inverse time [pu of the input]", 1e-4),
    number("I_inst", 6.0, "Instantaneous limit [pu of the input]"),
    number("I_lim", 3.0, "Thermal limit [pu of the input]"),
    seconds("T_A", 0.04, "Lag of the reference; 0 leaves it out"),
    number("c_1", 0.0, "Exponent of the reference's rate"),
    number("K_1", 0.0, "Gain of the reference's rate"),
    number("c_2", 2.0, "Exponent of the inverse time"),
    number("K_2", 0.296, "Gain of the inverse time"),
    number("V_INVMAX", 100.0, "Upper limit of the inverse time's rate"),
    number("V_INVMIN", 0.0, "Lower limit of the inverse time's rate"),
    number("FIXED_ru", 0.0, "Rate of the timer below the pickup, beside the inverse time's"),
    number("FIXED_rd", -0.001, "Rate of the timer above the pickup, beside the inverse time's"),
    number("T_FCL", 10.0, "Timer from which the thermal limit holds", unit="s"),
    number("T_max", 10.0, "Largest value of the timer", unit="s"),
    number("T_min", 0.0, "Least value of the timer", unit="s"),
    number("K_FB", 0.0, "Feedback of the timer", 0, "1/s"),
    number("K_rd", -1000.0, "Rate at which the reference falls [pu of the input]", unit="1/s"),
    number("K_ru", 1000.0, "Rate at which the reference rises [pu of the input]", unit="1/s"),
    number("K_ZRU", 0.99, "Share of T_FCL left from which the reference rises"),
)
_SOURCE = "IEEE 421.5-2016, sample data"

_OF_CURRENT = (1.5, 2.5)  # values of the input between which it is the field current
_BY_CURRENT = 1.5  # value of SW from which the current gives the reference's rate: 1 or 2
_SET = 0.5  # value of the latch above which the limiter is set
_LEAST_RATIO = 1e-6  # share of the pickup that is raised to a power: 0 has no rate of change
_REACHED = 1e-4  # distance [s, pu of the input] from a limit at which it counts as reached
_NO_RATE = 1e-12  # rate [1, 1/s] that is rounding
_NEAR = 5e-4
"""Distance [pu, s] from its start within which a state that waits returns there, so that a linear model can be made."""
_BEYOND = 1e-2  # part [pu, S_n] by which the controller rests beyond its upper limit


@dataclass(frozen=True)
class _Rest:
    """The limits that are taken, and where the limiter rests at the start."""

    act: Expr
    pickup: Expr
    instantaneous: Expr
    thermal: Expr
    timer: Expr
    reference: Expr
    is_set: Expr


def oel2c(m: ModelBuilder, seen: Regulated) -> Limited:
    """Declare the limiter and return its signal to the voltage reference [pu]."""
    p = declared(m, OEL2C, _SOURCE)
    rest = _rest(m, p, p.K_scale * seen.start.E_fd)
    of_current = logic_and(p.input > _OF_CURRENT[0], p.input < _OF_CURRENT[1])
    I_now, close = sensed_field(m, seen, of_current, p.K_scale, p.T_R)
    ratio, act = I_now / rest.pickup, p.K_act * I_now
    left = p.T_FCL - _timer(m, p, ratio, rest.timer)
    reference = m.state("reference", rest.reference, "1", "Reference of the field current")
    ramp = _ramp(p, ratio, left)
    moves = rate_within_limits(reference, ramp, rest.thermal, rest.instantaneous)
    waits = _back(reference, rest.reference)
    m.derivative(reference, if_else(fabs(ramp) > _NO_RATE, moves, waits))
    bias = _bias(m, p, rest, (act, reference, left))
    lagged = low_pass_or_nothing(m, "reference_lag", reference, p.T_A, rest.reference)
    bias_0 = if_else(rest.is_set > _SET, 0, p.I_reset)
    signal, at_start = _signal(m, p, bias + lagged - act, bias_0 + rest.reference - rest.act)
    return Limited(signal, at_start, close, fmin(fmin(p.V_OELMAX3, p.V_OELMAX2), p.V_OELMAX1))


def _rest(m: ModelBuilder, p: Given, I_0: Expr) -> _Rest:
    """Declare the limits that are taken at an input of the start."""
    act = p.K_act * I_0

    def declare(limit: str, value: Expr) -> Expr:
        text = f"{limit}, or 1 % above the operating point where that is beyond it"
        return m.calculated(f"{limit}_taken", value, "1", f"{text} [pu of the input]")

    pickup = declare("I_TFpu", limit_that_rests(p.I_TFpu, I_0))
    ratio = I_0 / pickup
    w = _timer_rate(p, ratio)
    fed = clamp(w / if_else(p.K_FB > 0, p.K_FB, 1), p.T_min, p.T_max)
    timer = if_else(p.K_FB > 0, fed, if_else(w > _NO_RATE, p.T_max, p.T_min))
    left = p.T_FCL - timer
    falls = _ramp(p, ratio, left) < -_NO_RATE
    thermal = declare("I_lim", if_else(falls, limit_that_rests(p.I_lim, act), p.I_lim))
    instantaneous = declare("I_inst", fmax(limit_that_rests(p.I_inst, act), thermal))
    reference = if_else(falls, thermal, instantaneous)
    is_set = if_else(logic_or(left <= _REACHED, p.T_en <= 0), 1, 0)
    return _Rest(
        act=act,
        pickup=pickup,
        instantaneous=instantaneous,
        thermal=thermal,
        timer=timer,
        reference=reference,
        is_set=is_set,
    )


def _timer_rate(p: Given, ratio: Expr) -> Expr:
    """Rate [1] at which the timer runs without its feedback."""
    inverse = clamp(p.K_2 * _excess(ratio, p.c_2), p.V_INVMIN, p.V_INVMAX)
    return inverse + if_else(ratio <= 1, p.FIXED_ru, p.FIXED_rd)


def _excess(ratio: Expr, exponent: Expr) -> Expr:
    return fmax(ratio, _LEAST_RATIO) ** exponent - 1


def _timer(m: ModelBuilder, p: Given, ratio: Expr, at_start: Expr) -> Expr:
    """Declare the timer [s]; without rate or feedback it stands still."""
    timer = m.state("timer", at_start, "s", "Timer of the inverse time")
    w = _timer_rate(p, ratio)
    stands = logic_and(p.K_FB <= 0, fabs(w) <= _NO_RATE)
    runs = rate_within_limits(timer, w - p.K_FB * timer, p.T_min, p.T_max)
    m.derivative(timer, if_else(stands, _back(timer, at_start), runs))
    return timer


def _ramp(p: Given, ratio: Expr, left: Expr) -> Expr:
    """Rate [1/s] of the reference without its limits; ``left``: on the timer [s]."""
    by_current = p.K_1 * _excess(ratio, p.c_1)
    is_fixed = p.SW < _BY_CURRENT
    up, down = (if_else(is_fixed, fixed, by_current) for fixed in (p.K_ru, p.K_rd))
    return if_else(left >= p.K_ZRU * p.T_FCL, up, if_else(left <= _REACHED, down, 0))


def _bias(m: ModelBuilder, p: Given, rest: _Rest, now: tuple[Expr, Expr, Expr]) -> Expr:
    """Declare the activation and return what is added to the reference.

    ``now``: current [pu of the input], reference [the same], and what is left on the timer [s]."""
    act, reference, left = now
    latch = m.state("latch", rest.is_set, "1", "The limiter is set; it holds above 0.5")
    is_set, late = latch > _SET, left <= _REACHED
    over = act > reference
    at_top = reference >= rest.instantaneous - _REACHED
    below = logic_and(at_top, reference - act > p.I_THoff)
    releases = logic_and(logic_and(is_set, below), logic_and(p.T_en > 0, left > _REACHED))
    over_for = time_that_lasts(m, "over_for", over, p.T_en)
    below_for = time_that_lasts(m, "below_for", releases, p.T_off)
    sets = logic_or(logic_or(late, p.T_en <= 0), logic_and(over, over_for >= p.T_en))
    holds = logic_and(is_set, 1 - logic_and(releases, below_for >= p.T_off))
    m.derivative(latch, (if_else(logic_or(sets, holds), 1, 0) - latch) / RETURN_TIME)
    return if_else(is_set, 0, p.I_reset)


def _signal(m: ModelBuilder, p: Given, e: Expr, e_0: Expr) -> tuple[Expr, Expr]:
    """The signal [pu] of an error, and of its value at the start."""
    x_0 = if_else(p.K_I > 0, fmax(0, p.V_OELMAX3 + _BEYOND - p.K_P * e_0), 0)
    x = m.state("integrator", x_0, "pu", "Integral of the error", base="S_n")
    with_derivative = p.T_D > 0
    T_D = if_else(with_derivative, p.T_D, BYPASS_TIME)
    changed = washout(m, "derivative", e, T_D, e_0)
    wanted = p.K_P * e + x + if_else(with_derivative, p.K_D / T_D * changed, 0)
    above = logic_and(wanted >= p.V_OELMAX3, e > 0)
    below = logic_and(wanted <= p.V_OELMIN3, e < 0)
    waits = logic_or(logic_or(above, below), p.K_I <= 0)
    m.derivative(x, if_else(waits, _back(x, x_0), p.K_I * e))

    controlled_0 = clamp(p.K_P * e_0 + x_0, p.V_OELMIN3, p.V_OELMAX3)
    first_0 = clamp(controlled_0, p.V_OELMIN2, p.V_OELMAX2)
    controlled = clamp(wanted, p.V_OELMIN3, p.V_OELMAX3)
    staged = lead_lag(m, "lead_lag_2", controlled, p.T_C2, p.T_B2, controlled_0)
    first = clamp(staged, p.V_OELMIN2, p.V_OELMAX2)
    second = lead_lag(m, "lead_lag_1", first, p.T_C1, p.T_B1, first_0)
    return (
        clamp(second, p.V_OELMIN1, p.V_OELMAX1),
        clamp(first_0, p.V_OELMIN1, p.V_OELMAX1),
    )


def _back(x: Expr, at_start: Scalar) -> Expr:
    """The rate of a state that waits: nothing, unless it is nearly where it was at the start."""
    return if_else(fabs(x - at_start) < _NEAR, (at_start - x) / RETURN_TIME, 0)

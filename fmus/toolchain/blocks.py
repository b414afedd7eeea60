"""Transfer-function blocks: each gives its equation and its own steady state.

A block declares its state in the builder's current scope and returns its output signal. ``initial``
is the steady-state value of its input (of `proportional_integral`: of its output), an expression of
parameters. Where a block may be left out by a time constant of zero, as the block diagrams of the
literature mean it, it passes its input through; its state then follows the input with `BYPASS_TIME`
and is seen by nobody."""

from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and, logic_or, sqrt

# time constant [s] with which the unused state of a left-out block follows its input
BYPASS_TIME = 0.01

RETURN_TIME = 2e-3
"""Time constant [s] with which a state returns to the limit that it lies beyond: as long as the longest internal step
of any model, so that no stage of Runge-Kutta's method lands below the limit again."""

ROUNDING = 1e-9
"""How far beyond a limit [pu] lies what a power flow puts at the limit to its accuracy."""


def washout(m: ModelBuilder, name: str, u: Expr, T_W: Scalar, initial: Scalar = 0.0) -> Expr:
    """s·T_W/(1 + s·T_W); its output is 0 in steady state.

    ``T_W``: time constant [s]."""
    x = m.state(name, initial, "pu", "washout, slow part of the signal", base="S_n")
    m.derivative(x, (u - x) / T_W)
    return u - x


def low_pass(m: ModelBuilder, name: str, u: Expr, T: Scalar, initial: Scalar = 0.0) -> Expr:
    """1/(1 + s·T), T > 0: the output is a state, so nothing passes directly.

    ``T``: time constant [s]."""
    x = m.state(name, initial, "pu", "first-order lag", base="S_n")
    m.derivative(x, (u - x) / T)
    return x


def low_pass_or_nothing(
    m: ModelBuilder, name: str, u: Expr, T: Scalar, initial: Scalar = 0.0
) -> Expr:
    """1/(1 + s·T); passed through where T = 0.

    ``T``: time constant [s], 0 or more."""
    x = m.state(name, initial, "pu", "first-order lag", base="S_n")
    left_out = _is_zero(T)
    m.derivative(x, (u - x) / if_else(left_out, BYPASS_TIME, T))
    return if_else(left_out, u, x)


def washout_or_nothing(
    m: ModelBuilder, name: str, u: Expr, T_W: Expr, initial: Scalar = 0.0
) -> Expr:
    """s·T_W/(1 + s·T_W); passed through where T_W = 0, and then ``initial`` must be 0 or be taken off later.

    ``T_W``: time constant [s], 0 or more."""
    left_out = _is_zero(T_W)
    return if_else(left_out, u, washout(m, name, u, if_else(left_out, BYPASS_TIME, T_W), initial))


def lead_lag(
    m: ModelBuilder, name: str, u: Expr, T_lead: Scalar, T_lag: Scalar, initial: Scalar = 0.0
) -> Expr:
    """(1 + s·T_lead)/(1 + s·T_lag); passed through where T_lag = 0.

    ``T_lead``, ``T_lag``: time constants [s], 0 or more."""
    x = m.state(name, initial, "pu", "lead/lag", base="S_n")
    left_out = _is_zero(T_lag)
    T = if_else(left_out, BYPASS_TIME, T_lag)
    m.derivative(x, (u - x) / T)
    return if_else(left_out, u, x + (T_lead / T) * (u - x))


def limited_lead_lag(
    m: ModelBuilder,
    name: str,
    u: Expr,
    T_lead: Scalar,
    T_lag: Scalar,
    low: Scalar,
    high: Scalar,
    initial: Scalar = 0.0,
) -> Expr:
    """(1 + s·T_lead)/(1 + s·T_lag) whose output is limited, and whose state waits while the output is at a limit.

    ``T_lead``, ``T_lag``: time constants [s], 0 or more; T_lag = 0: a limiter; ``low``, ``high``: limits of the
    output."""
    x = m.state(name, initial, "pu", "lead/lag with limits", base="S_n")
    left_out = _is_zero(T_lag)
    T = if_else(left_out, BYPASS_TIME, T_lag)
    y = if_else(left_out, u, x + (T_lead / T) * (u - x))
    outward = logic_or(logic_and(y > high, u > x), logic_and(y < low, u < x))
    m.derivative(x, if_else(logic_and(outward, T_lag > 0), 0, (u - x) / T))
    return clamp(y, low, high)


def second_order(
    m: ModelBuilder, name: str, u: Expr, lags: tuple[Expr, Expr], leads: tuple[Expr, Expr]
) -> Expr:
    """(1 + b_1·s + b_2·s²)/(1 + a_1·s + a_2·s²); a_2 = 0 leaves one lag, a_1 = 0 as well passes the input through.

    ``u``: what goes in; 0 in steady state; ``lags``: a_1 [s] and a_2 [s²]; ``leads``: b_1, which needs a_1, and b_2,
    which needs a_2."""
    (a_1, a_2), (b_1, b_2) = lags, leads
    second = a_2 > 0
    root = sqrt(if_else(second, a_2, 1))
    x = m.state(name, 0.0, "pu", "filter", base="S_n")
    y = m.state(
        f"{name}_rate", 0.0, "pu", "filter, its rate times the square root of a_2", base="S_n"
    )
    lag = if_else(a_1 > 0, a_1, BYPASS_TIME)
    first, rest = (u - x) / lag, u - x - a_1 * y / root
    m.derivative(x, if_else(second, y / root, first))
    m.derivative(y, if_else(second, rest / root, -y / BYPASS_TIME))
    of_second = x + b_1 * y / root + b_2 * rest / root**2
    return if_else(second, of_second, if_else(a_1 > 0, x + b_1 * first, u))


def proportional_integral(
    m: ModelBuilder, name: str, error: Expr, K_P: Scalar, K_I: Scalar, initial: Scalar
) -> Expr:
    """K_P + K_I/s.

    ``error``: what goes in; 0 in steady state; ``K_P``: proportional gain; ``K_I``: integral gain [1/s, times the unit
    of K_P]; ``initial``: of the output, in steady state; the integrator carries it."""
    x = m.state(name, initial, "pu", "integrator", base="S_n")
    m.derivative(x, K_I * error)
    return K_P * error + x


def limit(u: Expr, magnitude: Scalar) -> Expr:
    return fmin(fmax(u, -magnitude), magnitude)


def clamp(u: Scalar, low: Scalar, high: Scalar) -> Expr:
    """The value, or the limit that it is beyond."""
    return fmin(fmax(u, low), high)


def limited_low_pass(
    m: ModelBuilder, name: str, u: Expr, T: Scalar, low: Scalar, high: Scalar, initial: Scalar = 0.0
) -> Expr:
    """1/(1 + s·T) that stops at its limits and leaves them as soon as its input does (non-windup); T = 0: a limiter.

    ``T``: time constant [s], 0 or more; ``low``, ``high``: limits of the output."""
    x = m.state(name, initial, "pu", "first-order lag with limits", base="S_n")
    return close_limited_low_pass(m, x, u, T, low, high)


def close_limited_low_pass(
    m: ModelBuilder, x: Expr, u: Expr, T: Scalar, low: Scalar, high: Scalar
) -> Expr:
    """`limited_low_pass` with a state that is declared already, for what the input is fed back from."""
    left_out = _is_zero(T)
    lag = if_else(left_out, BYPASS_TIME, T)
    held = held_at_limits(x, (u - reached(x, low, high)) / lag, low, high)
    m.derivative(x, if_else(left_out, (u - x) / lag, held))
    return clamp(if_else(left_out, u, x), low, high)


def limited_proportional_integral(
    m: ModelBuilder,
    name: str,
    error: Expr,
    K_P: Scalar,
    K_I: Scalar,
    low: Scalar,
    high: Scalar,
    initial: Scalar,
) -> Expr:
    """K_P + K_I/s, the output limited; the integrator stops while the output is at a limit (IEEE 421.5, annex E).

    ``low``, ``high``: limits of the output; ``initial``: of the integrator, in steady state."""
    x = m.state(name, initial, "pu", "integrator with limits", base="S_n")
    u = K_P * error + x
    outward = logic_or(logic_and(u > high, error > 0), logic_and(u < low, error < 0))
    m.derivative(x, if_else(outward, 0, K_I * error))
    return clamp(u, low, high)


def held_at_limits(x: Expr, rate: Scalar, low: Scalar, high: Scalar) -> Expr:
    """The rate of a state with non-windup limits (IEEE 421.5, annex E), which is at a limit where it lies beyond it.

    A step of integration may carry the state over a limit, and a limit may move past it. It then returns with
    `RETURN_TIME`, whichever way its rate leads; a rate that leads inward acts beside that.

    ``rate``: its rate without limits, of `reached` in place of the state; ``low``, ``high``: the limits; use the state
    through `clamp`."""
    rate = Expr(rate)
    is_above, is_below = _beyond(x, low, high)
    rises, falls = rate > 0, rate < 0
    at_high = logic_or(is_above, logic_and(x >= high, rises))
    at_low = logic_or(is_below, logic_and(x <= low, falls))
    from_high = (high - x) / RETURN_TIME + if_else(falls, rate, 0)
    from_low = (low - x) / RETURN_TIME + if_else(rises, rate, 0)
    return if_else(at_high, from_high, if_else(at_low, from_low, rate))


def reached(x: Expr, low: Scalar, high: Scalar) -> Expr:
    """The value that a state with non-windup limits has in its own rate: the limit that it lies beyond, or itself.

    At a limit it moves as the state does, where `clamp` moves half as far: a lag that rests at its limit keeps its time
    constant in a linear model."""
    is_above, is_below = _beyond(x, low, high)
    return if_else(is_above, high, if_else(is_below, low, x))


def _beyond(x: Expr, low: Scalar, high: Scalar) -> tuple[Expr, Expr]:
    """Return whether a state lies above and below its limits, by more than rounding."""
    return x > high + ROUNDING, x < low - ROUNDING


def _is_zero(T: Scalar) -> Expr:
    return Expr(T) <= 0

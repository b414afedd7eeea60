"""Signals between the parts of a plant, and blocks that its diagrams share."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise

from fmus.toolchain.blocks import BYPASS_TIME, RETURN_TIME, clamp, held_at_limits
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and, logic_or

SOURCE = "NREL's reduced WECC system of 240 buses (2018), plant at bus 1032"
"""Where the defaults are from: its plants have the same values nearly everywhere."""

ROUNDING = 1e-4
"""Part of a limit by which a file's figures may exceed it at the operating point: they have four to five digits."""


@dataclass(frozen=True)
class Terminal:
    """Voltage, current and power at a plant's terminal, and the operating point's.

    ``v``, ``i``: in the network frame [pu, S_n]; ``P``, ``Q``: [pu, S_n]."""

    v: Phasor
    i: Phasor
    size: Expr
    P: Expr
    Q: Expr
    v_0: Phasor
    i_0: Phasor
    size_0: Expr
    P_0: Scalar
    Q_0: Scalar


@dataclass(frozen=True)
class References:
    """References of active and of reactive power (or of voltage, where that is what is controlled)."""

    P: Expr
    Q: Expr


def dead_band(u: Expr, low: Scalar, high: Scalar) -> Expr:
    """Return the part of a signal that lies beyond a band around 0; continuous at its ends.

    ``low``: at most 0; ``high``: at least 0."""
    return fmax(u - high, 0) + fmin(u - low, 0)


def through_points(x: Expr, points: Sequence[tuple[Scalar, Scalar]]) -> Expr:
    """Straight lines through points (x, y) with rising x; the first and the last value hold beyond them."""
    y = Expr(points[-1][1])
    for (x_1, y_1), (x_2, y_2) in reversed(list(pairwise(points))):
        steep = (y_2 - y_1) / fmax(Expr(x_2) - x_1, 1e-9)
        y = if_else(x < x_2, y_1 + steep * (x - x_1), y)
    return if_else(x < points[0][0], points[0][1], y)


def through_rising_points(x: Expr, points: Sequence[tuple[Expr, Expr]]) -> Expr:
    """`through_points` of a table whose points count as far as x rises: files fill the rest with zeros."""
    counted = [points[0]]
    rises = Expr(1)
    for (before, _), (at, value) in pairwise(points):
        rises = logic_and(rises, at > before)
        last_x, last_y = counted[-1]
        counted.append((if_else(rises, at, last_x), if_else(rises, value, last_y)))
    return through_points(x, counted)


def highest(values: Sequence[Expr]) -> Expr:
    """The largest of some values."""
    return reduce(fmax, values)


def frozen_lag(
    m: ModelBuilder, name: str, u: Expr, T: Expr, frozen: Expr, *, initial: Scalar
) -> Expr:
    """1/(1 + s·T) whose state waits while ``frozen``; passed through where T = 0."""
    x = m.state(name, initial, "pu", "first-order lag that waits", base="S_n")
    left_out = T <= 0
    rate = (u - x) / if_else(left_out, BYPASS_TIME, T)
    m.derivative(x, if_else(logic_and(frozen, T > 0), 0, rate))
    return if_else(left_out, u, x)


@dataclass(frozen=True)
class Controller:
    """Gains, limits and state of a proportional-integral controller in a plant's diagrams.

    ``in_use``: whether its output goes anywhere; ``frozen``: whether its integrator waits."""

    K_P: Expr
    K_I: Expr
    low: Scalar
    high: Scalar
    in_use: Scalar
    frozen: Expr


def controlled(
    m: ModelBuilder, name: str, error: Expr, how: Controller, *, initial: Scalar
) -> Expr:
    """K_P + K_I/s within limits; the integrator stops where its output is beyond one and the error leads further out.

    ``initial``: of the output in steady state. An integrator without a gain, or one that goes nowhere, rests there."""
    x = m.state(name, initial, "pu", "integrator with limits", base="S_n")
    u = how.K_P * error + x
    outward = logic_or(logic_and(u > how.high, error > 0), logic_and(u < how.low, error < 0))
    rate = held_at_limits(x, if_else(outward, 0, how.K_I * error), how.low, how.high)
    acts = logic_and(how.in_use, how.K_I > 0)
    resting = (initial - x) / BYPASS_TIME
    m.derivative(x, if_else(acts, if_else(how.frozen, 0, rate), resting))
    return clamp(u, how.low, how.high)


AFTER = 0.5
"""A timer's threshold."""

UP = 1.5
"""Value of a timer while its event lasts: one unit above the threshold, so that it falls by its time."""


def still_after(m: ModelBuilder, name: str, event: Expr, time: Expr) -> Expr:
    """Return 1 for a time [s] after an event has ended, else 0; a time of 0 never.

    In rest the timer lies half a unit below its threshold, where small changes do not reach it."""
    x = m.state(name, 0.0, "1", "Timer after a voltage dip; it runs above 0.5")
    falling = if_else(x > AFTER, -1 / fmax(time, RETURN_TIME), -x / BYPASS_TIME)
    m.derivative(x, if_else(event, (UP - x) / RETURN_TIME, falling))
    return logic_and(logic_and(x > AFTER, time > 0), 1 - event)

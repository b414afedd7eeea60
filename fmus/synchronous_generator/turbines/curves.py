"""Pieces of governors of water and gas turbines: a curve through points, parts of controllers, their own rating."""

from collections.abc import Sequence
from itertools import pairwise

from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import BYPASS_TIME, clamp, washout
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fabs, fmax, fmin, if_else, logic_and

Point = tuple[Scalar, Scalar]
"""x and y of a point of a curve."""

AT_NO_LOAD = 1e-6
"""Power [pu] below the first point of a curve at which a turbine may start there."""


def through_points(x: Expr, points: Sequence[Point]) -> Expr:
    """The broken line through points of rising x, level beyond the first and the last.

    A point whose x does not exceed that of the one before is left out, as tables of fewer points end in zeros."""
    last_x, last_y = (Expr(value) for value in points[0])
    y = last_y
    for here_x, here_y in points[1:]:
        wide = Expr(here_x) - last_x
        exists = wide > 0
        share = clamp((x - last_x) / if_else(exists, wide, 1), 0, 1)
        y += if_else(exists, share * (here_y - last_y), 0)
        last_x, last_y = (if_else(exists, here_x, last_x), if_else(exists, here_y, last_y))
    return y


def require_rising_curve(m: ModelBuilder, points: Sequence[Point], text: str) -> None:
    """Refuse points of which x or y falls, so that no start could be found on the curve.

    ``text``: names the points."""
    for (x, y), (next_x, next_y) in pairwise(points):
        rises = fmin(Expr(next_x) - x, Expr(next_y) - y)
        m.require(rises, f"{text}: gate and power must rise from point to point")


def curve_of_gate(
    m: ModelBuilder, points: Sequence[Point], limits: tuple[Expr, Expr]
) -> tuple[Expr, Expr, Expr]:
    """Truth of there being a curve of power by gate, and its least and most power; without one those of the gate.

    ``points``: gate and power of GV_1 to PGV_5; all 0 where a record gives none; ``limits``: of the gate. A curve must
    rise; those of its last points that are 0 are not there."""
    widest = most = Expr(0)
    for x, y in points:
        widest, most = fmax(widest, fabs(x)), fmax(most, y)
    for (x, y), (next_x, next_y) in pairwise(points):
        rises = fmin(Expr(next_x) - x, Expr(next_y) - y)
        is_unused = logic_and(Expr(next_x) <= 0, Expr(next_y) <= 0)
        text = "governor.GV_1 to governor.PGV_5: gate and power must rise from point to point"
        m.require(if_else(is_unused, 1, rises), text)
    exists = widest > 0
    low, high = limits
    return (
        exists,
        if_else(exists, Expr(points[0][1]) - AT_NO_LOAD, low),
        if_else(exists, most, high),
    )


def beyond(u: Expr, band: Expr) -> Expr:
    """The part of a signal beyond a dead band of ± ``band`` about 0; all of it where the band is 0."""
    return if_else(band > 0, u - clamp(u, -band, band), u)


def derivative_gain(m: ModelBuilder, name: str, u: Expr, K: Expr, T: Expr) -> Expr:
    """K·s/(1 + s·T); 0 where T = 0, which needs K = 0.

    ``u``: what goes in; 0 in steady state; ``T``: time constant [s], 0 or more."""
    m.require(if_else(T <= 0, if_else(K > 0, -1, 1), 1), f"{K.name()} > 0 needs {T.name()} > 0")
    lag = if_else(T <= 0, BYPASS_TIME, T)
    return if_else(T <= 0, 0, K / lag) * washout(m, name, u, lag)


def integral(m: ModelBuilder, name: str, error: Expr, K: Expr, initial: Scalar) -> Expr:
    """K/s; without K it stays where it starts.

    ``error``: 0 in steady state; ``initial``: of the output."""
    x = m.state(name, initial, "pu", "integrator", base="S_n")
    m.derivative(x, if_else(K > 0, K * error, (initial - x) / BYPASS_TIME))
    return x


def share_of_rating(shaft: Shaft, T_rate: Expr) -> Expr:
    """The turbine's rating over S_n; 1 where it has none of its own.

    ``T_rate``: rating [MVA]; 0: S_n."""
    assert shaft.S_n is not None  # every generator of parts has one
    return if_else(T_rate > 0, T_rate / shaft.S_n, 1)

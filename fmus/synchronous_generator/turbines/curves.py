"""Pieces of governors of water and gas turbines: a curve through points, parts of controllers, their own rating."""

from collections.abc import Sequence
from itertools import pairwise

from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import BYPASS_TIME, clamp, washout
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmin, if_else

Point = tuple[Scalar, Scalar]
"""x and y of a point of a curve."""


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

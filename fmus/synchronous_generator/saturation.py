"""The saturation of machines and exciters, through two points of a curve.

S(x)·x = B·(x − A)² above A and 0 below, as stability programs have it. A machine's data sheet gives S(1.0) and S(1.2),
an exciter's S_E(E_1) and S_E(E_2). Some machines have an exponential curve instead, S(x) = S(1.0)·xⁿ through both
points."""

from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, exp, fmax, if_else, log, logic_and, logic_or, sqrt


def saturated_part(x: Expr, one: tuple[Scalar, Scalar], other: tuple[Scalar, Scalar]) -> Expr:
    """S(x)·x for x ≥ 0: what saturation adds to what is proportional.

    ``x``: flux or voltage [pu]; ``one``, ``other``: two points (x, S) in either order; S = 0 at both for no saturation.
    """
    first, last = _ordered(one, other)
    high = last[0] * last[1]
    ratio = sqrt(first[0] * first[1] / if_else(high > 0, high, 1))
    A = (first[0] - ratio * last[0]) / (1 - ratio)
    B = high / (last[0] - A) ** 2
    return B * fmax(x - A, 0) ** 2


_NO_FLUX = 1e-6  # flux or voltage [pu] below which a power of it is 0


def exponential_part(x: Expr, s_10: Expr, s_12: Expr) -> Expr:
    """S(x)·x with S(x) = S(1.0)·xⁿ through S(1.0) and S(1.2); S = 0 at both for no saturation.

    ``x``: flux [pu]."""
    exists = logic_and(s_10 > 0, s_12 > 0)
    n = log(if_else(exists, s_12, 1) / if_else(exists, s_10, 1)) / log(Expr(1.2))
    return if_else(exists, s_10 * exp((n + 1) * log(fmax(x, _NO_FLUX))), 0)


def require_rising(
    m: ModelBuilder, one: tuple[Scalar, Scalar], other: tuple[Scalar, Scalar], text: str
) -> None:
    """Refuse points between which S(x)·x does not rise.

    ``text``: names the points."""
    first, last = _ordered(one, other)
    none = logic_and(first[1] <= 0, last[1] <= 0)
    rises = logic_and(last[0] - first[0] > 1e-6, last[0] * last[1] - first[0] * first[1] > 1e-9)
    m.require(
        if_else(logic_or(none, rises), 1, -1),
        f"{text}: saturation must rise; give 0 at both for none",
    )


def _ordered(
    one: tuple[Scalar, Scalar], other: tuple[Scalar, Scalar]
) -> tuple[tuple[Expr, Expr], ...]:
    """The points by rising x. Without saturation any two serve."""
    swapped = Expr(one[0]) > Expr(other[0])
    none = logic_and(Expr(one[1]) <= 0, Expr(other[1]) <= 0)
    low = (if_else(swapped, other[0], one[0]), if_else(swapped, other[1], one[1]))
    high = (if_else(swapped, one[0], other[0]), if_else(swapped, one[1], other[1]))
    return (if_else(none, 1.0, low[0]), low[1]), (if_else(none, 1.2, high[0]), high[1])

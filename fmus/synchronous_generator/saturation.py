"""Saturation through two points of a curve, S(x)·x = B·(x − A)² above A and 0 below, as stability programs have it.

A machine's data sheet gives S(1.0) and S(1.2), an exciter's S_E(E_1) and S_E(E_2)."""

import casadi as ca

from fmus.toolchain.model_builder import ModelBuilder, Scalar


def saturated_part(x: ca.SX, one: tuple[Scalar, Scalar], other: tuple[Scalar, Scalar]) -> ca.SX:
    """S(x)·x for x ≥ 0: what saturation adds to what is proportional.

    ``x``: flux or voltage [pu]; ``one``, ``other``: two points (x, S) in either order; S = 0 at both for no saturation.
    """
    first, last = _ordered(one, other)
    high = last[0] * last[1]
    ratio = ca.sqrt(first[0] * first[1] / ca.if_else(high > 0, high, 1))
    A = (first[0] - ratio * last[0]) / (1 - ratio)
    B = high / (last[0] - A) ** 2
    return B * ca.fmax(x - A, 0) ** 2


def require_rising(m: ModelBuilder, one: tuple[Scalar, Scalar], other: tuple[Scalar, Scalar], text: str) -> None:
    """Refuse points between which S(x)·x does not rise.

    ``text``: names the points."""
    first, last = _ordered(one, other)
    none = ca.logic_and(first[1] <= 0, last[1] <= 0)
    rises = ca.logic_and(last[0] - first[0] > 1e-6, last[0] * last[1] - first[0] * first[1] > 1e-9)
    m.require(ca.if_else(ca.logic_or(none, rises), 1, -1), f"{text}: saturation must rise; give 0 at both for none")


def _ordered(one: tuple[Scalar, Scalar], other: tuple[Scalar, Scalar]) -> tuple[tuple[ca.SX, ca.SX], ...]:
    """The points by rising x. Without saturation any two serve."""
    swapped = ca.SX(one[0]) > ca.SX(other[0])
    none = ca.logic_and(ca.SX(one[1]) <= 0, ca.SX(other[1]) <= 0)
    low = (ca.if_else(swapped, other[0], one[0]), ca.if_else(swapped, other[1], one[1]))
    high = (ca.if_else(swapped, one[0], other[0]), ca.if_else(swapped, one[1], other[1]))
    return (ca.if_else(none, 1.0, low[0]), low[1]), (ca.if_else(none, 1.2, high[0]), high[1])

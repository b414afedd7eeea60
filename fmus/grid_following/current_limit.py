"""Limit of the current reference: its magnitude stays within one value, whichever part has priority."""

from dataclasses import dataclass

from fmus.converter_parts.filter import SteadyState
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, sqrt

SOURCE = "Mateu-Barriendos et al. 2024, appendix: 1.1 pu, there for each component"
# part of the limit always left to the current without priority: no root of 0 is to be derived
SMALLEST = 1e-6


@dataclass(frozen=True)
class Limited:
    """Requested current, permitted current [pu, S_n], and their ratio to the limit [1]."""

    demanded: Phasor
    allowed: Phasor
    share: Expr

    @property
    def excess(self) -> Phasor:
        """Excess of the request over the limit; exactly 0 within it."""
        return self.demanded - self.allowed


def limited_current(m: ModelBuilder, start: SteadyState, demanded: Phasor) -> Limited:
    """Declare the limit and apply it; a dispatch beyond it is refused.

    ``start``: operating point of the filter; ``demanded``: reference of the converter's current, its own frame: real
    part active, imaginary part reactive [pu, S_n]."""
    with m.scope("current_limit"):
        most = m.parameter(
            "I_max", 1.1, "pu", "Largest current", base="S_n", minimum=0.1, source=SOURCE
        )
        priority = m.parameter(
            "priority",
            0,
            "1",
            "0: both parts shrink alike; 1: active current first; 2: reactive current first",
            minimum=0,
            maximum=2,
            type="Integer",
        )
    m.require(
        most - start.i_s.magnitude(),
        "the power flow asks for more current than current_limit.I_max: lower P_0 or Q_0, or raise S_n",
    )
    square = demanded.re**2 + demanded.im**2
    together = demanded * (1 / sqrt(fmax(1, square / most**2)))
    clamped = demanded.clamped(most, most)
    active_first = Phasor(clamped.re, _within(demanded.im, _rest(clamped.re, most)))
    reactive_first = Phasor(_within(demanded.re, _rest(clamped.im, most)), clamped.im)
    chosen = [
        if_else(priority < 0.5, one, if_else(priority < 1.5, two, three))
        for one, two, three in (
            (together.re, active_first.re, reactive_first.re),
            (together.im, active_first.im, reactive_first.im),
        )
    ]
    return Limited(demanded, Phasor(*chosen), sqrt(square) / most)


def _rest(first: Scalar, most: Expr) -> Expr:
    """Largest value of the other component."""
    return sqrt(fmax(most**2 - first**2, (SMALLEST * most) ** 2))


def _within(value: Scalar, bound: Expr) -> Expr:
    return fmin(fmax(value, -bound), bound)

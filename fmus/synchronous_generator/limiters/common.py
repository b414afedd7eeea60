"""Limiters of excitation as their voltage regulator hears them, and how they are put before it.

A limiter's signal is added to the voltage reference, beside the stabiliser's. One that acts in the operating point has
its signal in the reference of that point, so that the machine rests there."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from fmus.synchronous_generator.excitation.common import Exciter, Regulated
from fmus.toolchain.blocks import RETURN_TIME
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else

LEAST = 1e-6
"""Signal [pu, S_n] from which a limiter acts: far below what moves a voltage, far above rounding."""


def rate_within_limits(x: Expr, rate: Scalar, low: Scalar, high: Scalar) -> Expr:
    """Return the rate of a state with non-windup limits that is linear where the state rests at one of them.

    ``rate``: its rate without limits. A limit is approached no faster than with `RETURN_TIME`: where a limiter rests, a
    step off its limit and one beyond it return alike, so that a linear model can be made there."""
    return fmin(fmax(rate, (low - x) / RETURN_TIME), (high - x) / RETURN_TIME)


@dataclass(frozen=True)
class Limited:
    """A limiter that is declared and waits for the field voltage.

    ``signal``: what it adds to the voltage reference [pu, S_n]; ``at_start``: the same in the operating point;
    ``close``: gives it the field voltage [pu]."""

    signal: Expr
    at_start: Scalar
    close: Callable[[Expr], None]


Limiter = Callable[[ModelBuilder, Regulated], Limited]


@dataclass(frozen=True)
class Limiters:
    """The limiters of one machine; None where it has none of that kind."""

    oel: Limiter | None = None
    uel: Limiter | None = None

    def regulate(self, m: ModelBuilder, seen: Regulated, exciter: Exciter) -> tuple[Expr, Expr]:
        """Declare limiters and exciter and return its (E_fd, |v_t|) [pu]."""
        limited = [_declare(m, seen, *each) for each in self._by_scope()]
        signal: Scalar = sum((each.signal for each in limited), Expr(seen.v_s))
        at_start: Scalar = sum((Expr(each.at_start) for each in limited), Expr(0))
        E_fd, v_t = exciter(m, replace(seen, v_s=signal, v_s_0=at_start) if limited else seen)
        for each in limited:
            each.close(E_fd)
        return E_fd, v_t

    def _by_scope(self) -> list[tuple[str, Limiter]]:
        both = (("oel", self.oel), ("uel", self.uel))
        return [(scope, limiter) for scope, limiter in both if limiter is not None]


WITHOUT = Limiters()  # of a machine that has no limiters


def _declare(m: ModelBuilder, seen: Regulated, scope: str, limiter: Limiter) -> Limited:
    """Declare a limiter in its scope, with outputs of its signal and of whether it acts."""
    with m.scope(scope):
        limited = limiter(m, seen)
        acts = if_else(limited.signal < -LEAST, 1, if_else(limited.signal > LEAST, 1, 0))
        m.output("signal", limited.signal, "pu", "Added to the voltage reference", base="S_n")
        m.output("acts", acts, "1", "1 while the limiter acts, else 0")
    return limited

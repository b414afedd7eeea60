"""Limiters of excitation as their voltage regulator hears them, and how they are put before it.

A limiter's signal is added to the voltage reference, beside the stabiliser's. One that acts in the operating point has
its signal in the reference of that point, so that the machine rests there. A limiter of underexcitation may lift the
exciter's signal instead, at a gate where the exciter's diagram has one: there it is lowered to what the operating point
needs, as no reference can make up for it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from fmus.synchronous_generator.data_lines import Given
from fmus.synchronous_generator.excitation.common import (
    BEFORE,
    BEHIND,
    Exciter,
    Gate,
    Regulated,
)
from fmus.toolchain.blocks import BYPASS_TIME, RETURN_TIME
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and, logic_or

_OUT_OF_REACH = 1e3
"""By which a lower limit is moved that nothing reaches [pu, S_n]."""

_ONE = 0.5  # above which a condition of 0 or 1 holds

_HEADROOM = 1e-3
"""By which an operating point beyond a limiter's edge lies within the edge that is taken [pu, S_n]: enough for rest."""

_ALLOWED = 1.01  # of an operating point beyond a limit, which may last: further than rounding

LEAST = 1e-6
"""Signal [pu, S_n] from which a limiter acts: far below what moves a voltage, far above rounding."""


def rate_within_limits(x: Expr, rate: Scalar, low: Scalar, high: Scalar) -> Expr:
    """Return the rate of a state with non-windup limits that is linear where the state rests at one of them.

    ``rate``: its rate without limits. A limit is approached no faster than with `RETURN_TIME`: where a limiter rests, a
    step off its limit and one beyond it return alike, so that a linear model can be made there."""
    return fmin(fmax(rate, (low - x) / RETURN_TIME), (high - x) / RETURN_TIME)


def time_that_lasts(m: ModelBuilder, name: str, holds: Expr, enough: Scalar) -> Expr:
    """Declare the time [s] for which a condition has held without a break; counted to a second more than is enough."""
    time = m.state(name, 0.0, "s", "Time that has been counted")
    runs = fmin(1, (enough + 1 - time) / RETURN_TIME)
    m.derivative(time, if_else(holds, runs, -time / RETURN_TIME))
    return time


@dataclass(frozen=True)
class Floors:
    """Lower limits behind the integral of a limiter that has no other way, K_UL = 0, and rests at its own limit.

    What holds that integral keeps what follows it off these limits, unless a stage leads or one of them is above. Where
    they are not reached they are moved away: at the corner of a limit no linear model can be made."""

    integral: Scalar  # lower limit of the integral [pu, S_n]
    is_sole: Expr  # 1 where nothing but the integral arrives and no stage leads, else 0

    def of(self, limit: Scalar) -> Expr:
        """Return a lower limit [pu, S_n]; one that is not reached where only the integral arrives above it."""
        is_met = logic_or(self.is_sole < _ONE, limit > self.integral)
        return if_else(is_met, limit, limit - _OUT_OF_REACH)


@dataclass(frozen=True)
class Limited:
    """A limiter that is declared and waits for the field voltage.

    ``signal``: what it adds to the voltage reference [pu, S_n], or brings to a gate; ``at_start``: the same in the
    operating point; ``close``: gives it the field voltage [pu]; ``at_rest``: the signal while it does not act."""

    signal: Expr
    at_start: Scalar
    close: Callable[[Expr], None]
    at_rest: Scalar = 0.0


Limiter = Callable[[ModelBuilder, Regulated], Limited]


def floors_behind(p: Given) -> Floors:
    """Return the lower limits behind K_UL + K_UI/s of a limiter of underexcitation with two leads and lags.

    ``p``: its parameters, as IEEE 421.5 names them."""
    follows = logic_and(p.T_U1 <= p.T_U2, p.T_U3 <= p.T_U4)
    alone = logic_and(p.K_UL <= 0, p.K_UI > 0)
    return Floors(p.V_UIMIN, if_else(logic_and(alone, follows), 1, 0))


def moved_edge(m: ModelBuilder, excess_0: Expr, integrates: Expr) -> Expr:
    """Declare by how much a limiter's edge is moved [pu, S_n], so that it rests at an operating point beyond it.

    ``excess_0``: how far the operating point is beyond the edge [pu, S_n]; ``integrates``: whether the limiter has an
    integral, which would never come to rest there. One without an integral rests with its signal, and acts."""
    return m.calculated(
        "moved",
        if_else(logic_and(integrates, excess_0 > 0), excess_0 + _HEADROOM, 0),
        "pu",
        "By how much its edge is moved, so that it rests at the operating point",
        base="S_n",
    )


def limit_that_rests(limit: Expr, at_start: Expr) -> Expr:
    """Return the limit, or what is taken in its place where the operating point is beyond it, so that it rests."""
    return if_else(at_start >= limit, _ALLOWED * at_start, limit)


def sensed_field(
    m: ModelBuilder, seen: Regulated, of_current: Expr, scale: Expr, lag: Expr
) -> tuple[Expr, Callable[[Expr], None]]:
    """Declare the measured field voltage or current and return it, with what gives it the field voltage.

    ``of_current``: whether it is the current; ``scale``: by which it is multiplied; ``lag`` [s]: at 0 the current
    passes, and the voltage keeps a lag of `BYPASS_TIME`, as it is known after the exciter alone."""
    start = scale * seen.start.E_fd
    sensed = m.state("sensed", start, "1", "Sensed field voltage or current")
    passes = logic_and(of_current, lag <= 0)

    def close(E_fd: Expr) -> None:
        u = scale * if_else(of_current, seen.I_fd, E_fd)
        m.derivative(sensed, (u - sensed) / if_else(lag > 0, lag, BYPASS_TIME))

    return if_else(passes, scale * seen.I_fd, sensed), close


@dataclass(frozen=True)
class Limiters:
    """The limiters of one machine; None where it has none of that kind."""

    oel: Limiter | None = None
    uel: Limiter | None = None

    def regulate(self, m: ModelBuilder, seen: Regulated, exciter: Exciter) -> tuple[Expr, Expr]:
        """Declare limiters and exciter and return its (E_fd, |v_t|) [pu]."""
        limited = {scope: _declare(m, seen, scope, x) for scope, x in self._by_scope()}
        uel = limited.get("uel")
        gate = None if uel is None else Gate(uel.signal, uel.at_start, _place(m))
        signal, at_start = Expr(seen.v_s), Expr(0)
        for scope, each in limited.items():
            share = if_else(gate.place > 0, 0, 1) if scope == "uel" and gate is not None else 1
            signal, at_start = signal + share * each.signal, at_start + share * each.at_start
        told = replace(seen, v_s=signal, v_s_0=at_start, gate=gate) if limited else seen
        E_fd, v_t = exciter(m, told)
        for scope, each in limited.items():
            each.close(E_fd)
            _declare_outputs(m, scope, each, gate if scope == "uel" else None)
        return E_fd, v_t

    def _by_scope(self) -> list[tuple[str, Limiter]]:
        both = (("oel", self.oel), ("uel", self.uel))
        return [(scope, limiter) for scope, limiter in both if limiter is not None]


WITHOUT = Limiters()  # of a machine that has no limiters


def _declare(m: ModelBuilder, seen: Regulated, scope: str, limiter: Limiter) -> Limited:
    with m.scope(scope):
        return limiter(m, seen)


def _place(m: ModelBuilder) -> Expr:
    """Declare where the signal of a limiter of underexcitation acts."""
    text = "Its signal is added to the reference (0), or lifts the exciter's before (1) or behind (2) its amplifier"
    with m.scope("uel"):
        return m.parameter("gate", 0.0, "1", text, minimum=0, maximum=BEHIND)


_LOWERED = "By how much its signal is lowered at a gate, so that it rests at the operating point"


def _declare_outputs(m: ModelBuilder, scope: str, limited: Limited, gate: Gate | None) -> None:
    """Declare outputs of a limiter's signal and of whether it acts, and refuse a gate that the exciter lacks."""
    away = limited.signal - limited.at_rest
    acts = if_else(away < -LEAST, 1, if_else(away > LEAST, 1, 0))
    for place in () if gate is None else (BEFORE, BEHIND):
        assert gate is not None
        if place in gate.met:
            above = if_else(gate.signal_at(place) > gate.met[place], 1, 0)
            acts = if_else(gate.is_at(place), above, acts)
        else:
            m.require(
                if_else(gate.is_at(place), -1, 1),
                f"uel.gate = {place}: this exciter has no gate there; take 0, or another exciter",
            )
    with m.scope(scope):
        if gate is not None and gate.lowered:
            lowered = sum((gate.is_at(x) * each for x, each in gate.lowered.items()), Expr(0))
            m.calculated("lowered", lowered, "pu", _LOWERED, base="E_fd")
        m.output("signal", limited.signal, "pu", "Signal to the voltage regulator", base="S_n")
        m.output("acts", acts, "1", "1 while the limiter acts, else 0")

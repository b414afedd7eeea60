"""The share of distributed generation that voltage and frequency leave feeding.

    low voltage    a share falls in a straight line from 1 at vl1 to 0 at vl0, and comes back with the voltage;
                   below vl1 for tvl1, what was lost comes back for Vrfrac of it alone;
                   below vl0 for tvl0, all is lost so
    high voltage   the same between vh1 and vh0, with tvh1 and tvh0
    frequency      below fltrp for tfl, or above fhtrp for tfh, all is lost for good, unless v is below Vpr

Both shares are multiplied, and go through 1/(1 + s·Tv).

Source: WECC's specification of DER_A (P. Pourbeik, 2019)."""

from collections.abc import Callable
from dataclasses import dataclass

from fmus.synchronous_generator.data_lines import Given
from fmus.toolchain.blocks import BYPASS_TIME, RETURN_TIME, clamp
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fmax, fmin, if_else, logic_and, logic_or

LEAST_WIDTH = 1e-4  # voltage [pu] between both ends of a line, so that a step is one
FORGOTTEN = 0.01  # share lost for good below which nothing was: at rest the memory returns to 0
LATCHED = 0.5  # value of a latch above which it holds


@dataclass(frozen=True)
class _Side:
    """One side of the voltages: its name, and how far beyond its inner end the voltage is, in parts of the line."""

    name: str
    beyond: Expr
    is_inner: Expr
    is_outer: Expr
    inner_time: Expr
    outer_time: Expr


def share_left(m: ModelBuilder, p: Given, v: Expr, f: Expr, by: tuple[Expr, Expr]) -> Expr:
    """Declare the timers; return the share [1] that voltage and frequency leave, before its lag.

    ``v``: voltage [pu]; ``f``: frequency [Hz]; ``by``: whether voltage and frequency trip at all."""
    low = fmax(p.vl1 - p.vl0, LEAST_WIDTH)
    high = fmax(p.vh0 - p.vh1, LEAST_WIDTH)
    sides = (
        _Side("low", (p.vl1 - v) / low, v < p.vl1, v < p.vl0, p.tvl1, p.tvl0),
        _Side("high", (v - p.vh1) / high, v > p.vh1, v > p.vh0, p.tvh1, p.tvh0),
    )
    left = Expr(1.0)
    for side in sides:
        left = left * _of_voltage(m, side, p.Vrfrac)
    return if_else(by[0], left, 1) * if_else(by[1], 1 - _of_frequency(m, p, v, f), 1)


def _of_voltage(m: ModelBuilder, side: _Side, returning: Expr) -> Expr:
    """The share that one side leaves; what is lost for good is its memory."""
    lost_now = clamp(side.beyond, 0, 1)
    with m.scope(f"trip_{side.name}"):
        inner = _time(m, "inner", side.is_inner)
        outer = _time(m, "outer", side.is_outer)
        late = logic_and(side.is_inner, inner >= side.inner_time)
        all_late = logic_and(side.is_outer, outer >= side.outer_time)

        def target(lost: Expr) -> Expr:
            return if_else(all_late, 1, if_else(late, fmax(lost, lost_now), lost))

        return kept_share(m, lost_now, returning, target, acts=logic_or(late, all_late))


def kept_share(
    m: ModelBuilder,
    lost_now: Expr,
    returning: Expr,
    target: Callable[[Expr], Expr],
    *,
    acts: Expr,
) -> Expr:
    """Declare the memory of what was lost; return the share that is left.

    ``lost_now``: share that is off at this value of voltage or frequency; ``returning``: part of the lost that comes
    back with it; ``target``: what the memory goes to, from what it has; ``acts``: whether anything is being lost."""
    lost = m.state("lost", 0.0, "1", "Share lost after its time, of which a part comes back")
    resting = logic_and(lost < FORGOTTEN, 1 - acts)
    goes = (target(lost) - lost) / RETURN_TIME
    m.derivative(lost, if_else(resting, -lost / BYPASS_TIME, goes))
    held = if_else(lost < FORGOTTEN, 0, fmin(lost, 1))
    back = fmax(held - lost_now, 0)  # of the lost, what would be back
    return 1 - fmax(lost_now, held) + returning * back


def _of_frequency(m: ModelBuilder, p: Given, v: Expr, f: Expr) -> Expr:
    """Return 1 after the frequency has tripped all, else 0."""
    sees = v >= p.Vpr
    with m.scope("trip_frequency"):
        under = _time(m, "under", logic_and(sees, f < p.fltrp))
        over = _time(m, "over", logic_and(sees, f > p.fhtrp))
        latch = m.state("latch", 0.0, "1", "Decision to trip by frequency; it holds above 0.5")
        late = logic_or(
            logic_and(logic_and(sees, f < p.fltrp), under >= p.tfl),
            logic_and(logic_and(sees, f > p.fhtrp), over >= p.tfh),
        )
        trips = logic_or(late, latch > LATCHED)
        m.derivative(latch, if_else(trips, (1 - latch) / RETURN_TIME, -latch / BYPASS_TIME))
    return if_else(latch > LATCHED, 1, 0)


def _time(m: ModelBuilder, name: str, event: Expr) -> Expr:
    """Time since an event began [s]; 0 without it."""
    x = m.state(name, 0.0, "s", f"Time of the event {name!r}")
    m.derivative(x, if_else(event, 1, -x / BYPASS_TIME))
    return x

"""REECC1: the control of a battery, REECB1 with tables, power in both directions and a state of charge.

    charge:  SOCini − P/(s·T) within SOCmin…SOCmax; I_p ≤ 0 where it is empty, I_p ≥ 0 where it is full
    limits:  −most ≤ I_p ≤ most, where most is that of REECA1

An operating point at which the battery feeds power is no steady state of its charge. So the charge counts what is fed
beyond the operating point's power, unless `counts_P_0` says otherwise.

Source: WECC's specification of REEC_C (EPRI, 2015), as PowerWorld's help, Dynawo and InterPSS describe it."""

from collections.abc import Mapping
from typing import ClassVar

from fmus.synchronous_generator.data_lines import number
from fmus.toolchain.blocks import clamp, held_at_limits
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_or
from fmus.wecc_renewable.electrical import (
    OF_CONTROL,
    OF_DIPS,
    OF_POWER,
    POINTS,
    SWITCHES,
    Electrical,
    Reeca1,
    Seen,
    extra_current,
    table_lines,
)
from fmus.wecc_renewable.signals import ROUNDING, Terminal

OF_CHARGE = (
    number("T", 3600.0, "Time in which rated power empties or fills the battery", 1e-3, "s"),
    number("SOCini", 0.5, "State of charge at the operating point", 0),
    number("SOCmax", 1.0, "State of charge from which on it takes no power", 0),
    number("SOCmin", 0.0, "State of charge down to which it feeds power", 0),
)


class Reecc1(Reeca1):
    """The control of REECC1."""

    lines = (*OF_DIPS, *OF_CONTROL, *OF_POWER, *table_lines(POINTS), *OF_CHARGE)
    switches: ClassVar[Mapping[str, str]] = {
        **SWITCHES,
        "counts_P_0": "The charge counts the power of the operating point too, and so has no steady state",
    }
    knows_speed = False
    records = "REECC1"

    def declare_mode(self, m: ModelBuilder) -> Scalar:
        """Kqv acts always."""
        return 0

    def charge(self, m: ModelBuilder, t: Terminal, e: Electrical) -> Expr:
        """Declare the state of charge."""
        p = e.p
        low, high = fmin(p.SOCmin, p.SOCini), fmax(p.SOCmax, p.SOCini)
        x = m.state("charge", p.SOCini, "1", "State of charge")
        counted = t.P - if_else(e.flags["counts_P_0"], 0, t.P_0)
        m.derivative(x, held_at_limits(x, -counted / p.T, low, high))
        return x

    def holds_limit(self, m: ModelBuilder, e: Electrical, seen: Seen) -> Expr:
        """Nothing lasts after a dip."""
        return Expr(0)

    def range_of_active(self, e: Electrical, seen: Seen, most: Expr) -> tuple[Expr, Expr]:
        """Least and most active current, by the state of charge [pu, S_n]."""
        assert seen.charge is not None
        empty, full = seen.charge <= e.p.SOCmin, seen.charge >= e.p.SOCmax
        return if_else(full, 0, -most), if_else(empty, 0, most)

    def extra(self, m: ModelBuilder, t: Terminal, e: Electrical, seen: Seen) -> Expr:
        """Reactive current of Kqv, which acts always [pu, S_n]."""
        return extra_current(e.p, seen.v, t.size_0)

    def active(
        self,
        m: ModelBuilder,
        t: Terminal,
        e: Electrical,
        seen: Seen,
        *,
        wanted: Expr,
        most: Expr,
        held: Expr,
    ) -> Expr:
        """Command of active current; no limit is held [pu, S_n]."""
        return clamp(wanted, *self.range_of_active(e, seen, most))

    def requirements(self, m: ModelBuilder, t: Terminal, e: Electrical) -> None:
        """Refuse a battery that is empty and feeds, or full and draws."""
        p, drawn = e.p, e.active_0
        m.require(
            if_else(logic_or(p.SOCini > p.SOCmin, drawn <= ROUNDING), 1, -1),
            "the battery is empty (SOCini at SOCmin) and feeds power: raise SOCini, or P_0 at most 0",
        )
        m.require(
            if_else(logic_or(p.SOCini < p.SOCmax, drawn >= -ROUNDING), 1, -1),
            "the battery is full (SOCini at SOCmax) and draws power: lower SOCini, or P_0 at least 0",
        )

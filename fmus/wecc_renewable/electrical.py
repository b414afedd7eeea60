"""REECA1 and REECB1: from references of power, reactive power or voltage to commands of current.

`Reeca1` is also what the controls of the other records, in `electrical_storage` and `electrical_blocking`, build on.

    reactive:  Q_ref, or P·tan φ → QMin…QMax → (− Q) → Kqp + Kqi/s within VMIN…VMAX → V_ref, or V_ref itself
               QFLAG: V_ref − v → Kvp + Kvi/s → I_q; else Q_ref/v → 1/(1+s·Tiq) → I_q
               + Kqv·(Vref0 − v) beyond dbd1…dbd2, within Iql1…Iqh1 (REECA1: in and after dips alone)
    active:    P_ref, by dPmax and dPmin at most → 1/(1+s·Tpord) within PMIN…PMAX → / v → I_p

v is the terminal voltage behind Trv, and P the power behind Tp. In a dip (v outside of Vdip…Vup) the integrators, Tiq
and Tpord wait. Imax limits both currents, PQFLAG says which comes first, and REECA1's tables VDL limit each by v.

REECB1 is REECA1 without tables, without a time after dips, and with Kqv always: `only_in_dips` is false.

Sources: WECC, "Solar Plant Dynamic Modeling Guidelines" (2014), "Wind Plant Dynamic Modeling Guidelines" (2014), and
their specification of REEC_A and REEC_B (EPRI, 2013 and 2014)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from fmus.converter_parts.bus_voltage import LEAST_VOLTAGE
from fmus.synchronous_generator.data_lines import Given, Line, declared, number, power, pu, seconds
from fmus.toolchain.blocks import (
    BYPASS_TIME,
    RETURN_TIME,
    clamp,
    held_at_limits,
    low_pass_or_nothing,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import (
    Expr,
    Scalar,
    fabs,
    fmax,
    fmin,
    if_else,
    logic_and,
    logic_or,
    sqrt,
)
from fmus.wecc_renewable.signals import (
    ROUNDING,
    SOURCE,
    Controller,
    References,
    Terminal,
    controlled,
    dead_band,
    frozen_lag,
    highest,
    still_after,
    through_rising_points,
)

POINTS = 4
"""Points of each table VDL of REECA1."""


def table_lines(points: int) -> tuple[Line, ...]:
    """The parameters of both tables VDL, by point as REECA1 names them."""
    return tuple(
        line
        for k in range(1, points + 1)
        for axis, what in (("q", "reactive"), ("p", "active"))
        for line in (
            pu(
                f"V{axis}{k}", 0.0, f"Point {k} of the table of {what} current: voltage", base="bus"
            ),
            power(f"I{axis}{k}", 0.0, f"Point {k} of the table of {what} current: its limit"),
        )
    )


OF_DIPS = (
    pu("Vdip", 0.9, "Voltage below which a dip is seen", base="bus"),
    pu("Vup", 1.1, "Voltage above which a dip is seen", base="bus"),
    seconds("Trv", 0.02, "Filter of the terminal voltage; 0 leaves it out"),
    pu("dbd1", 0.0, "Lower end of the dead band of Kqv; at most 0", base="bus"),
    pu("dbd2", 0.0, "Upper end of the dead band of Kqv; at least 0", 0.0, base="bus"),
    power("Kqv", 0.0, "Reactive current by voltage beyond the dead band"),
    power("Iqh1", 1.1, "Most reactive current of Kqv"),
    power("Iql1", -1.1, "Least reactive current of Kqv"),
    pu("Vref0", 0.0, "Voltage reference of Kqv; 0: that of the operating point", 0.0, base="bus"),
)
OF_CONTROL = (
    seconds("Tp", 0.05, "Filter of the active power; 0 leaves it out"),
    power("QMax", 0.44, "Most reactive power of the reference"),
    power("QMin", -0.44, "Least reactive power of the reference"),
    pu("VMAX", 1.05, "Most voltage of the reference", base="bus"),
    pu("VMIN", 0.9, "Least voltage of the reference", base="bus"),
    pu("Kqp", 0.0, "Proportional gain of the reactive power", 0.0, base="bus"),
    number("Kqi", 0.01, "Integral gain of the reactive power", 0, "1/s"),
    power("Kvp", 10.0, "Proportional gain of the voltage", 0),
    number("Kvi", 60.0, "Integral gain of the voltage", 0, "1/s"),
)
OF_REFERENCE = (pu("Vbias", 0.0, "Added to the reference where that is a voltage", base="bus"),)
OF_POWER = (
    seconds("Tiq", 0.02, "Lag of the reactive current without voltage control; 0 leaves it out"),
    number("dPmax", 99.0, "Largest rate of the active power", 0, "pu/s"),
    number("dPmin", -99.0, "Least rate of the active power", None, "pu/s"),
    power("PMAX", 1.0, "Most active power"),
    power("PMIN", 0.0, "Least active power"),
    power("Imax", 1.11, "Most current", 1e-3),
    seconds("Tpord", 0.02, "Lag of the active power; 0 leaves it out"),
)
LINES = (
    *OF_DIPS,
    power("Iqfrz", 0.0, "Reactive current for Thld after a dip, where Thld > 0"),
    number(
        "Thld", 0.0, "Time of Iqfrz after a dip; below 0: time for which Kqv goes on", None, "s"
    ),
    number("Thld2", 0.0, "Time after a dip for which the limit of active current stays", 0, "s"),
    *OF_CONTROL,
    *OF_REFERENCE,
    *OF_POWER,
    *table_lines(POINTS),
)

SWITCHES: Mapping[str, str] = {
    "PFFLAG": "The power factor is held; else the reactive power",
    "VFLAG": "The reactive power sets the voltage's reference; else that is given",
    "QFLAG": "The voltage is controlled; else the reactive current follows its reference",
    "PQFLAG": "Active current comes first; else reactive current",
}


@dataclass(frozen=True)
class Electrical:
    """The control's parameters, flags, and references at the operating point.

    ``control``: the record's; ``power_0``: active power that is asked for [pu, S_n], and ``regulated_0``: the voltage
    that is controlled [pu], at the operating point."""

    control: "Reeca1"
    p: Given
    flags: Mapping[str, Expr]
    only_in_dips: Scalar
    active_0: Expr
    reactive_0: Expr
    extra_0: Expr
    references: References
    power_0: Expr
    regulated_0: Expr


@dataclass(frozen=True)
class Seen:
    """Signals of a control: terminal voltage behind its filter [pu], whether there is a dip, whether the converter is
    blocked, and the state of charge of what stores."""

    v: Expr
    dip: Expr
    blocked: Expr
    charge: Expr | None = None


@dataclass(frozen=True)
class Commands:
    """Commands of active and of reactive current, and the power that is asked for [pu, S_n]."""

    active: Expr
    reactive: Expr
    power: Expr


class Reeca1:
    """The control of REECA1, and of REECB1 where its switch says so; a method for each thing that other records change.

    ``lines``, ``switches``: its parameters; ``points``: of each table VDL; ``knows_speed``: whether its record has
    PFLAG; ``records``: PSS/E's names, in words."""

    lines: ClassVar[Sequence[Line]] = LINES
    switches: ClassVar[Mapping[str, str]] = SWITCHES
    points = POINTS
    knows_speed = True
    records = "REECA1 and REECB1"

    def declare_mode(self, m: ModelBuilder) -> Scalar:
        """Return whether Kqv acts in and after dips alone."""
        always = "Kqv acts in and after dips alone, as in REECA1; else always, as in REECB1"
        return m.switch("only_in_dips", True, always)

    def regulated_at_start(self, p: Given, flags: Mapping[str, Expr], t: Terminal) -> Expr:
        """The voltage that is controlled, at the operating point [pu]."""
        return t.size_0

    def regulated(self, m: ModelBuilder, t: Terminal, e: Electrical, seen: Seen) -> Expr:
        """The voltage that is controlled [pu]."""
        return seen.v

    def charge(self, m: ModelBuilder, t: Terminal, e: Electrical) -> Expr | None:
        """Declare the state of charge; None without storage."""
        return None

    def blocked(self, m: ModelBuilder, e: Electrical, v: Expr) -> Expr:
        """Return whether there is no current, by the filtered voltage [pu]."""
        return Expr(0)

    def holds_limit(self, m: ModelBuilder, e: Electrical, seen: Seen) -> Expr:
        """Declare whether the limit of active current stays as it was in a dip."""
        return still_after(m, "after_dip_p", seen.dip, e.p.Thld2)

    def range_of_active(self, e: Electrical, seen: Seen, most: Expr) -> tuple[Expr, Expr]:
        """Least and most active current, by what tables and the reactive current leave [pu, S_n]."""
        return Expr(0), most

    def extra(self, m: ModelBuilder, t: Terminal, e: Electrical, seen: Seen) -> Expr:
        """Reactive current of Kqv by time [pu, S_n]."""
        p = e.p
        extra = extra_current(p, seen.v, t.size_0)
        after = still_after(m, "after_dip_q", seen.dip, fabs(p.Thld))
        later = if_else(p.Thld > 0, p.Iqfrz, extra)
        return if_else(e.only_in_dips, if_else(seen.dip, extra, if_else(after, later, 0)), extra)

    def reactive(
        self, m: ModelBuilder, e: Electrical, seen: Seen, wanted: Expr, most: Expr
    ) -> Expr:
        """Command of reactive current by what is wanted, and its limit [pu, S_n]."""
        return clamp(wanted, -most, most)

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
        """Command of active current by what is wanted, and its limit [pu, S_n]; ``held``: whether the limit stays."""
        limit = held_limit(m, t, e, most=most, held=held)
        return clamp(wanted, *self.range_of_active(e, seen, limit))

    def requirements(self, m: ModelBuilder, t: Terminal, e: Electrical) -> None:
        """Refuse what the control cannot do at the operating point."""
        m.require(e.active_0 + ROUNDING, f"P_0: {self.records} draw no power; P_0 is at least 0")


def held_limit(m: ModelBuilder, t: Terminal, e: Electrical, *, most: Expr, held: Expr) -> Expr:
    """Declare the limit of active current, which stays as it was in a dip while ``held`` [pu, S_n]."""
    kept = m.state(
        "held_I_p_max", _most_active_0(t, e), "pu", "Limit of active current, held", base="S_n"
    )
    m.derivative(kept, if_else(held, 0, (most - kept) / RETURN_TIME))
    return if_else(held, fmin(kept, e.p.Imax), most)


BY_SPEED = "PFLAG"
"""Flag of the controls that may ask for power by the speed of a turbine's shaft."""


def declare_electrical(
    m: ModelBuilder,
    control: Reeca1,
    t: Terminal,
    active_0: Expr,
    reactive_0: Expr,
    speed_0: Expr | None = None,
) -> Electrical:
    """Declare the parameters, and find the references at which the operating point is a steady state.

    ``active_0``, ``reactive_0``: commands of current at the operating point [pu, S_n]; ``speed_0``: speed of the shaft
    there [pu]; None without one."""
    switches = dict(control.switches)
    if speed_0 is not None and control.knows_speed:
        switches[BY_SPEED] = "The active power's reference is multiplied by the shaft's speed"
    flags = {name: m.switch(name, name == "VFLAG", text) for name, text in switches.items()}
    only_in_dips = control.declare_mode(m)
    p = declared(m, control.lines, SOURCE)
    m.require(
        if_else(logic_and(t.size_0 > p.Vdip, t.size_0 < p.Vup), 1, -1),
        "v_0 lies in a dip, below Vdip or above Vup: change v_0, or one of them",
    )
    extra_0 = if_else(only_in_dips, 0, extra_current(p, t.size_0, t.size_0))
    by_voltage = logic_and(flags["QFLAG"], 1 - flags["VFLAG"])
    by_current = (reactive_0 - extra_0) * t.size_0
    power_0 = if_else(flags["QFLAG"], Expr(t.Q_0), by_current)
    regulated_0 = control.regulated_at_start(p, flags, t)
    bias = p.Vbias if p.has("Vbias") else Expr(0)
    ordered_0 = active_0 * t.size_0
    asked_0 = ordered_0
    if speed_0 is not None and BY_SPEED in flags:
        asked_0 = if_else(flags[BY_SPEED], ordered_0 / speed_0, ordered_0)
    references = References(asked_0, if_else(by_voltage, regulated_0 - bias, power_0))
    return Electrical(
        control,
        p,
        flags,
        only_in_dips,
        active_0,
        reactive_0,
        extra_0=extra_0,
        references=references,
        power_0=ordered_0,
        regulated_0=regulated_0,
    )


def extra_current(p: Given, v: Expr, v_0: Expr) -> Expr:
    """Reactive current of Kqv at a voltage [pu, S_n]."""
    reference = if_else(p.Vref0 > 0, p.Vref0, v_0)
    return clamp(p.Kqv * dead_band(reference - v, p.dbd1, p.dbd2), p.Iql1, p.Iqh1)


def commands(
    m: ModelBuilder, t: Terminal, e: Electrical, references: References, speed: Expr | None = None
) -> Commands:
    """Declare the control; return its commands.

    ``speed``: of a turbine's shaft [pu]; None without one."""
    p, flags = e.p, e.flags
    v = low_pass_or_nothing(m, "v_filtered", t.size, p.Trv, t.size_0)
    dip = in_dip(t, e)
    seen = Seen(v, dip, e.control.blocked(m, e, v), e.control.charge(m, t, e))
    asked = references.P
    if speed is not None and BY_SPEED in flags:
        asked = if_else(flags[BY_SPEED], asked * speed, asked)
    ordered = _ordered_power(m, e, asked, dip)
    active = ordered / fmax(v, LEAST_VOLTAGE)
    held = e.control.holds_limit(m, e, seen)
    # one current's limit needs the other's command, which comes first
    first = flags["PQFLAG"]
    of_table_p, of_table_q = (_limit_of_table(e, axis, v) for axis in "pq")
    most_alone = fmin(of_table_p, p.Imax)
    rest_q = _rest(p.Imax, clamp(active, *e.control.range_of_active(e, seen, most_alone)))
    most_q = fmin(of_table_q, if_else(first, rest_q, p.Imax))
    free = _reactive_command(m, t, e, references.Q, seen, most=most_q)
    wanted = free + e.control.extra(m, t, e, seen)
    reactive = e.control.reactive(m, e, seen, wanted, most_q)
    most_p = if_else(first, most_alone, fmin(of_table_p, _rest(p.Imax, reactive)))
    _require_within(m, t, e)
    limited = e.control.active(m, t, e, seen, wanted=active, most=most_p, held=held)
    return Commands(limited, reactive, ordered)


def in_dip(t: Terminal, e: Electrical) -> Expr:
    """Return whether the terminal voltage is in a dip."""
    return logic_or(t.size < e.p.Vdip, t.size > e.p.Vup)


def _ordered_power(m: ModelBuilder, e: Electrical, reference: Expr, dip: Expr) -> Expr:
    """Active power behind its rates, limits and lag [pu, S_n]."""
    p, start = e.p, e.power_0
    for margin, name, remedy in (
        (p.PMAX - start, "PMAX", "more active power than PMAX: lower P_0, or raise"),
        (start - p.PMIN, "PMIN", "less active power than PMIN: raise P_0, or lower"),
    ):
        m.require(margin + ROUNDING, f"the power flow asks for {remedy} {name}")
    x = m.state("P_ord", start, "pu", "Active power that is asked for", base="S_n")
    left_out = p.Tpord <= 0
    rate = clamp((reference - x) / if_else(left_out, BYPASS_TIME, p.Tpord), p.dPmin, p.dPmax)
    most, least = fmax(p.PMAX, start), fmin(p.PMIN, start)
    waits = logic_and(dip, 1 - left_out)
    m.derivative(x, if_else(waits, 0, held_at_limits(x, rate, least, most)))
    return clamp(if_else(left_out, reference, x), least, most)


def _reactive_command(
    m: ModelBuilder, t: Terminal, e: Electrical, reference: Expr, seen: Seen, *, most: Expr
) -> Expr:
    """Reactive current without that of Kqv [pu, S_n]."""
    p, flags, v, dip = e.p, e.flags, seen.v, seen.dip
    power_now = low_pass_or_nothing(m, "P_filtered", t.P, p.Tp, t.P_0)
    tangent = e.references.Q / if_else(fabs(t.P_0) > ROUNDING, t.P_0, 1)
    of_factor = if_else(fabs(t.P_0) > ROUNDING, tangent * power_now, e.references.Q)
    asked = if_else(flags["PFFLAG"], of_factor, reference)
    is_outer = logic_and(flags["QFLAG"], flags["VFLAG"])
    for margin, name, remedy in (
        (p.QMax - t.Q_0, "QMax", "more reactive power than QMax: lower Q_0, or raise"),
        (t.Q_0 - p.QMin, "QMin", "less reactive power than QMin: raise Q_0, or lower"),
    ):
        m.require(
            if_else(is_outer, margin, 1) + ROUNDING, f"the power flow asks for {remedy} {name}"
        )
    start_v = e.regulated_0
    for margin, name, remedy in (
        (p.VMAX - start_v, "VMAX", "above VMAX: lower v_0, or raise"),
        (start_v - p.VMIN, "VMIN", "below VMIN: raise v_0, or lower"),
    ):
        m.require(if_else(flags["QFLAG"], margin, 1) + ROUNDING, f"v_0 lies {remedy} {name}")
    low, high = fmin(p.VMIN, start_v), fmax(p.VMAX, start_v)
    outer = Controller(p.Kqp, p.Kqi, low, high, is_outer, dip)
    error = clamp(asked, fmin(p.QMin, t.Q_0), fmax(p.QMax, t.Q_0)) - t.Q
    of_power = controlled(m, "Q_control", error, outer, initial=start_v)
    bias = p.Vbias if p.has("Vbias") else Expr(0)
    wanted = if_else(flags["VFLAG"], of_power, clamp(asked + bias, low, high))
    start = e.reactive_0 - e.extra_0
    inner = Controller(p.Kvp, p.Kvi, -most, most, flags["QFLAG"], dip)
    regulated = e.control.regulated(m, t, e, seen)
    of_voltage = controlled(m, "V_control", wanted - regulated, inner, initial=start)
    plain = frozen_lag(
        m, "I_q_reference", asked / fmax(v, LEAST_VOLTAGE), p.Tiq, dip, initial=_plain_0(t, e)
    )
    return if_else(flags["QFLAG"], of_voltage, plain)


def _plain_0(t: Terminal, e: Electrical) -> Expr:
    """Reference by voltage at the operating point [pu, S_n]."""
    return e.references.Q / t.size_0


def _limit_of_table(e: Electrical, axis: str, v: Expr) -> Expr:
    """Limit that a table VDL sets at a voltage [pu, S_n]; a table of zeros sets none."""
    points = [
        (getattr(e.p, f"V{axis}{k}"), getattr(e.p, f"I{axis}{k}"))
        for k in range(1, e.control.points + 1)
    ]
    there = highest([x for x, _ in points]) > 0
    return if_else(there, fmax(through_rising_points(v, points), 0), e.p.Imax)


def _rest(most: Expr, used: Scalar) -> Expr:
    """Current that a limit leaves beside another one at right angles [pu, S_n]."""
    return sqrt(fmax(most**2 - used**2, 1e-12))


def _most_active_0(t: Terminal, e: Electrical) -> Expr:
    table = fmin(_limit_of_table(e, "p", t.size_0), e.p.Imax)
    rest = fmin(table, _rest(e.p.Imax, e.reactive_0))
    return if_else(e.flags["PQFLAG"], table, rest)


def _require_within(m: ModelBuilder, t: Terminal, e: Electrical) -> None:
    """Refuse an operating point beyond the limits of current."""
    p = e.p
    table = fmin(_limit_of_table(e, "q", t.size_0), p.Imax)
    most_q = if_else(e.flags["PQFLAG"], fmin(table, _rest(p.Imax, e.active_0)), table)
    text = "current than Imax or its table allows at v_0: raise S_n, Imax or the table"
    for margin, name, ends in (
        (_most_active_0(t, e) - e.active_0, "active", ", or lower P_0"),
        (most_q - fabs(e.reactive_0), "reactive", ", or bring Q_0 nearer to 0"),
    ):
        m.require(margin + ROUNDING, f"the power flow asks for more {name} {text}{ends}")
    e.control.requirements(m, t, e)

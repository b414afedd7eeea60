"""REECD1: REECA1 with compensation, tables of ten points, storage by a share, holds after a dip, and blocking.

    voltage:   |v − (Rc + j·Xc)·i| (VCMPFLAG), or v + Kc·Q → 1/(1 + s·Tr1) = what QFLAG controls
    support:   Kqv always, as in REECB1
    after a dip: Thld > 0: I_q stays at its last value for Thld; Thld < 0: it is Iqfrz for |Thld|
                 I_p and its limit stay as they were in the dip for Thld2
    limits:    −Ke·most ≤ I_p ≤ most
    blocking:  no current where v ≤ Vblkl or v ≥ Vblkh, and for Tblk after that

Source: WECC's specification of REEC_D (EPRI, 2019), as PowerWorld's help, Dynawo and InterPSS describe it."""

from collections.abc import Mapping
from typing import ClassVar

from fmus.converter_parts.bus_voltage import LEAST_VOLTAGE
from fmus.synchronous_generator.data_lines import Given, number, power, pu, seconds
from fmus.toolchain.blocks import RETURN_TIME, clamp, low_pass_or_nothing
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, fabs, fmax, if_else, logic_and, logic_or
from fmus.wecc_renewable.electrical import (
    OF_CONTROL,
    OF_DIPS,
    OF_POWER,
    OF_REFERENCE,
    SWITCHES,
    Electrical,
    Reeca1,
    Seen,
    extra_current,
    held_limit,
    table_lines,
)
from fmus.wecc_renewable.signals import ROUNDING, Terminal, still_after

POINTS_OF_D = 10
"""Points of each table VDL of REECD1."""

OF_HOLDS = (
    power("Iqfrz", 0.0, "Reactive current for |Thld| after a dip, where Thld < 0"),
    number("Thld", 0.0, "Time for which reactive current stays after a dip", None, "s"),
    number("Thld2", 0.0, "Time for which active current and its limit stay after a dip", 0, "s"),
)
OF_COMPENSATION = (
    power("Rc", 0.0, "Resistance of the compensation"),
    power("Xc", 0.0, "Reactance of the compensation"),
    seconds("Tr1", 0.0, "Filter of the compensated voltage; 0 leaves it out"),
    power("Kc", 0.0, "Voltage by reactive power, where VCMPFLAG is false"),
    number("Ke", 0.0, "Share of the most active current that it draws at most; 0: none", 0),
    pu("Vblkl", 0.0, "Voltage down to which it feeds current", base="bus"),
    pu("Vblkh", 2.0, "Voltage up to which it feeds current", base="bus"),
    number("Tblk", 0.0, "Time without current after the voltage is back", 0, "s"),
)


class Reecd1(Reeca1):
    """The control of REECD1."""

    lines = (
        *OF_DIPS,
        *OF_HOLDS,
        *OF_CONTROL,
        *OF_REFERENCE,
        *OF_POWER,
        *table_lines(POINTS_OF_D),
        *OF_COMPENSATION,
    )
    switches: ClassVar[Mapping[str, str]] = {
        **SWITCHES,
        "VCMPFLAG": "Rc and Xc compensate; else Kc",
    }
    points = POINTS_OF_D
    records = "REECD1"

    def declare_mode(self, m: ModelBuilder) -> Scalar:
        """Kqv acts always."""
        return 0

    def regulated_at_start(self, p: Given, flags: Mapping[str, Expr], t: Terminal) -> Expr:
        """The compensated voltage at the operating point [pu]."""
        return _compensated_voltage(p, flags["VCMPFLAG"], t.size_0, t.P_0, t.Q_0)

    def regulated(self, m: ModelBuilder, t: Terminal, e: Electrical, seen: Seen) -> Expr:
        """The compensated voltage behind its filter [pu]."""
        now = _compensated_voltage(e.p, e.flags["VCMPFLAG"], t.size, t.P, t.Q)
        return low_pass_or_nothing(m, "v_compensated", now, e.p.Tr1, e.regulated_0)

    def blocked(self, m: ModelBuilder, e: Electrical, v: Expr) -> Expr:
        """Return whether there is no current, by the filtered voltage [pu]."""
        outside = logic_or(v <= e.p.Vblkl, v >= e.p.Vblkh)
        return logic_or(outside, still_after(m, "after_block", outside, e.p.Tblk))

    def range_of_active(self, e: Electrical, seen: Seen, most: Expr) -> tuple[Expr, Expr]:
        """Least and most active current [pu, S_n]."""
        return -e.p.Ke * most, most

    def extra(self, m: ModelBuilder, t: Terminal, e: Electrical, seen: Seen) -> Expr:
        """Reactive current of Kqv, which acts always [pu, S_n]."""
        return extra_current(e.p, seen.v, t.size_0)

    def reactive(
        self, m: ModelBuilder, e: Electrical, seen: Seen, wanted: Expr, most: Expr
    ) -> Expr:
        """Command of reactive current, which may stay after a dip, and is blocked at some voltages [pu, S_n]."""
        p = e.p
        free = clamp(wanted, -most, most)
        holds = still_after(m, "after_dip_q", seen.dip, fabs(p.Thld))
        last = _memory(m, "held_I_q", free, holds, e.reactive_0)
        stays = if_else(p.Thld > 0, last, p.Iqfrz)
        return if_else(seen.blocked, 0, clamp(if_else(holds, stays, free), -most, most))

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
        """Command of active current, which stays after a dip, and is blocked at some voltages [pu, S_n]."""
        limit = held_limit(m, t, e, most=most, held=held)
        free = clamp(wanted, *self.range_of_active(e, seen, limit))
        command = if_else(held, _memory(m, "held_I_p", free, held, e.active_0), free)
        return if_else(seen.blocked, 0, command)

    def requirements(self, m: ModelBuilder, t: Terminal, e: Electrical) -> None:
        """Refuse an operating point that draws more than it can, or is blocked."""
        p = e.p
        m.require(
            e.active_0 + p.Ke * p.Imax + ROUNDING,
            "P_0: REECD1 draws Ke·Imax at most; raise P_0 or Ke",
        )
        m.require(
            if_else(logic_and(t.size_0 > p.Vblkl, t.size_0 < p.Vblkh), 1, -1),
            "v_0 lies where the converter is blocked, at Vblkl or below, or at Vblkh or above: change one of them",
        )


def _compensated_voltage(p: Given, compensates: Expr, v: Expr, P: Scalar, Q: Scalar) -> Expr:
    """Voltage that is controlled [pu]."""
    current = Phasor(P, -Q) / fmax(v, LEAST_VOLTAGE)  # in the frame of v
    inside = (Phasor(v, 0.0) - Phasor(p.Rc, p.Xc) * current).magnitude()
    return if_else(compensates, inside, v + p.Kc * Q)


def _memory(m: ModelBuilder, name: str, now: Expr, holds: Expr, start: Expr) -> Expr:
    """Declare a command's value that stays while ``holds`` [pu, S_n]."""
    x = m.state(name, start, "pu", "Command of current, held", base="S_n")
    m.derivative(x, if_else(holds, 0, (now - x) / RETURN_TIME))
    return x

"""RTE: the four envelopes of its sheet "grid-forming", for the reactance, damping and inertia that are declared."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import pi

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.units import whole_percent
from orchestrator.studies.certification.codes import criteria as c
from orchestrator.studies.certification.codes.envelope import (
    CEILING,
    DEMAND,
    LATE,
    SLACK,
    TUNNEL,
    Bounds,
    Swinging,
    amplitude_bounds,
    jump_bounds,
    ramp_bounds,
    strength_bounds,
)
from orchestrator.studies.certification.codes.measured import MeasuredRow, over_a_period
from orchestrator.studies.certification.codes.programme import (
    FIRST,
    BenchChange,
    BenchProgramme,
    ramps,
)
from orchestrator.studies.certification.codes.row import (
    Band,
    Bounded,
    CodeRow,
    Declaration,
    GridCode,
    Judge,
    RowFinding,
)

DECLARED = (
    Declaration(
        "X_eff", "effective reactance up to the connection point", "pu of the rating", 0.01, 2.0
    ),
    Declaration("D", "damping", "pu of power per pu of frequency", 0.1, 2000.0),
    Declaration("H", "inertia constant", "s", 0.05, 50.0),
)

HORIZON = 5.0  # how long a response has to stay within its envelope [s]
STRONG = 10.0  # largest short-circuit ratio
WEAK = 2.0  # least short-circuit ratio
X_R = 20.0  # X/R of the grid: the formulas have no resistance
CURRENT = 0.15  # reactive current for which the step of the voltage is made [pu]
POWER = 0.3  # active power for which the jump of the angle is made [pu]
BELOW = 0.5  # by how much the frequency is below its rated value before it rises [Hz]

Distances = Callable[[Numbers], Bounds]


@dataclass(frozen=True)
class Envelope:
    distances: Distances  # what is asked and allowed over the time after the event [s]
    sign: int  # +1 where the value has to rise
    opens_at_once: bool = False  # whether all of what is allowed is allowed from the event on
    later: float = 0.0  # by how much more than `LATE` what is asked begins [s]
    # whether `DEMAND` and `CEILING` limit it: they are those of the active power
    limited: bool = True

    def between(self, t: Numbers, before: float) -> tuple[Numbers, Numbers]:
        """Lower and upper bound at times after the event, for a value before it; each of the shape of ``t``."""
        early = t < LATE
        since = np.maximum(t - LATE, 0)
        found = self.distances(since)
        allowed, asked = found.allowed, found.asked
        if self.opens_at_once:
            widest = float(np.max(self.distances(np.linspace(0, HORIZON, 2000)).allowed))
            narrow = float(self.distances(np.array([1e9])).asked[0])
            allowed = np.where(early, widest, allowed)
            behind = t < LATE + self.later
            asked = np.where(
                behind, narrow, self.distances(np.maximum(t - LATE - self.later, 0)).asked
            )
        asked = np.where(early, np.minimum(asked, -TUNNEL), asked)
        near, far = before + self.sign * asked, before + self.sign * allowed
        if self.limited:
            near = np.clip(near, -DEMAND, DEMAND)
            far = np.clip(far, -CEILING, CEILING)
        return np.minimum(near, far), np.maximum(near, far)


def active_power(row: MeasuredRow) -> Numbers:
    """Active power, averaged over the period before each instant [pu]."""
    return row.mean_p


def reactive_current(row: MeasuredRow) -> Numbers:
    """Reactive current, averaged over the period before each instant [pu]."""
    return over_a_period(row.signals["q"] / np.maximum(row.signals["v"], 1e-3), row.times, row.f_n)


def stays_inside(
    event: int,
    made: Callable[[float], Envelope],
    name: str,
    quantity: Callable[[MeasuredRow], Numbers] = active_power,
    skipped: int = 1,
) -> Judge:
    """The response lies within its envelope, from an event on for `HORIZON` or until the next one.

    ``made``: The envelope for a rated frequency [Hz].
    ``quantity``: What is compared [pu].
    ``skipped``: How many events later its time ends: 2 for a ramp, whose own end is an event."""

    def bounds(row: MeasuredRow, values: Numbers) -> tuple[slice, Numbers, Numbers]:
        begin = row.event(event)
        later = (
            row.events[event + skipped]
            if event + skipped < len(row.events)
            else float(row.times[-1])
        )
        before = values[row.within(begin - 0.5, begin)]
        part = row.within(begin, min(later, begin + HORIZON))
        return part, *made(row.f_n).between(row.times[part] - begin, float(np.mean(before)))

    def judge(row: MeasuredRow) -> RowFinding:
        values = quantity(row)
        part, low, high = bounds(row, values)
        t, value = row.times[part] - row.event(event), values[part]
        outside = np.maximum(low - value, value - high)
        outside = np.where(np.isfinite(outside), outside, np.inf)
        at = int(np.argmax(outside))
        spare = np.minimum(high - value, value - low) / ((high - low) / 2)
        spare = np.where(np.isfinite(spare), spare, -np.inf)
        least = float(np.min(spare))
        worst, found = float(outside[at]), float(value[at])
        place = f"at {1e3 * t[at]:.0f} ms: {found:.3f} pu in {low[at]:.3f} to {high[at]:.3f} pu"
        text = f"{worst:.2g} pu outside {place}" if worst > 0 else f"inside; nearest {place}"
        number = worst if np.isfinite(worst) else None
        return RowFinding(
            name,
            f"within the envelope for {HORIZON:g} s",
            origin=c.CODE,
            value=number,
            limit=0.0,
            margin=least if np.isfinite(least) else None,
            accepted=bool(worst <= 0),
            text=text,
            unit="pu",
        )

    def bands(row: MeasuredRow) -> list[Band]:
        part, low, high = bounds(row, quantity(row))
        label = c.POWER_SHOWN if quantity is active_power else "Reactive current [pu]"
        return [Band(name, label, quantity, row.times[part], low, high, alone=True)]

    return Bounded(judge, bands)


def rte_code(declared: Mapping[str, float]) -> GridCode[CodeRow]:
    rows = [
        made
        for scr in (STRONG, WEAK)
        for make, powers in ((_jumps, (0.0, 0.5, -0.5)), (_steps, (0.0, 0.5, -0.5, 0.95, -0.95)))
        for made in (make(declared, scr, power) for power in powers)
    ]
    rows += [
        _strength(declared, one, other, p)
        for one, other in ((STRONG, WEAK), (WEAK, STRONG))
        for p in (0.5, -0.5)
    ]
    rows += [
        _ramping(declared, scr, p, rate, lasts)
        for scr in (STRONG, WEAK)
        for rate, lasts in ((0.5, 3.0), (2.0, 0.5))
        for p in (0.0, 0.5, -0.5)
    ]
    rows.sort(key=lambda row: row.name[:5])
    stated = ", ".join(f"{d.name} = {declared[d.name]:g}" for d in DECLARED)
    code = GridCode.of("rte", tuple(rows), declared)
    return replace(code, title=code.title.format(declared=stated))


def _row_name(test: str, scr: float, power: float, more: str = "") -> str:
    percent = f"{'m' if power < 0 else ''}{abs(round(100 * power))}"
    return f"{test}_scr{scr:g}_p{percent}{more}"


def _row(
    name: str, title: str, programme: Callable[[float], BenchProgramme], *judges: Judge
) -> CodeRow:
    return CodeRow(name, title, name[:5].upper(), programme, (c.holds_together(), *judges))


def _grid(declared: Mapping[str, float], scr: float, f_n: float) -> Swinging:
    return Swinging(declared["D"], declared["H"], declared["X_eff"] + 1 / scr, 2 * pi * f_n)


def _jumps(declared: Mapping[str, float], scr: float, power: float) -> CodeRow:
    angle = POWER * (declared["X_eff"] + 1 / scr)

    def programme(f_n: float) -> BenchProgramme:
        changes = tuple(
            BenchChange(FIRST + k * HORIZON, "source.jump", total)
            for k, total in enumerate((angle, 0.0))
        )
        return BenchProgramme(scr, power, changes, FIRST + 2 * HORIZON, X_R)

    def envelope(sign: int, f_n: float) -> Envelope:
        return Envelope(jump_bounds(_grid(declared, scr, f_n), angle), sign)

    return _row(
        _row_name("igfm1", scr, power),
        f"∓{np.degrees(angle):.2g}° at SCR {scr:g}, {whole_percent(power)}",
        programme,
        stays_inside(0, partial(envelope, -1), "power after the jump ahead"),
        stays_inside(1, partial(envelope, 1), "power after the jump back"),
    )


def _steps(declared: Mapping[str, float], scr: float, power: float) -> CodeRow:
    X = declared["X_eff"] + 1 / scr

    def programme(f_n: float) -> BenchProgramme:
        still = BenchProgramme(scr, power, (), FIRST, X_R)
        part = CURRENT * X / abs(1 - still.impedance * power)
        factors = (1 + part, 1.0, 1 - part)
        changes = tuple(
            BenchChange(FIRST + k * HORIZON, "source.factor", f) for k, f in enumerate(factors)
        )
        return BenchProgramme(scr, power, changes, FIRST + 3 * HORIZON, X_R)

    def envelope(sign: int, f_n: float) -> Envelope:
        return Envelope(amplitude_bounds(CURRENT), sign, limited=False)

    return _row(
        _row_name("igfm2", scr, power),
        f"Source ∓{100 * CURRENT * X:.2g} % at SCR {scr:g}, {whole_percent(power)}",
        programme,
        stays_inside(0, partial(envelope, -1), "current after the rise", reactive_current),
        stays_inside(2, partial(envelope, 1), "current after the fall", reactive_current),
    )


def _strength(declared: Mapping[str, float], start: float, end: float, power: float) -> CodeRow:
    difference = 1 / end - 1 / start

    def programme(f_n: float) -> BenchProgramme:
        changes = tuple(BenchChange(FIRST, f"{name}_factor", start / end) for name in ("X", "R"))
        return BenchProgramme(start, power, changes, FIRST + HORIZON, X_R)

    def envelope(f_n: float) -> Envelope:
        plant = _grid(declared, end, f_n)
        change = abs(power * difference) / plant.X
        return Envelope(
            strength_bounds(plant, change), -int(np.sign(difference * power)), True, SLACK
        )

    return _row(
        _row_name("igfm3", start, power, f"_scr{end:g}"),
        f"SCR {start:g} → {end:g}, {whole_percent(power)}",
        programme,
        stays_inside(0, envelope, "power after the step"),
    )


def _ramping(
    declared: Mapping[str, float], scr: float, power: float, rate: float, lasts: float
) -> CodeRow:
    def programme(f_n: float) -> BenchProgramme:
        made = ramps(scr, power, f_n, rate, (-BELOW, rate * lasts, -rate * lasts), HORIZON)
        return BenchProgramme(scr, power, made.changes, made.stop, X_R)

    def envelope(sign: int, f_n: float) -> Envelope:
        plant = _grid(declared, scr, f_n)
        return Envelope(ramp_bounds(plant, -sign * rate / f_n, lasts), sign)

    name = _row_name("igfm4", scr, power, f"_{rate:g}".replace(".", "_"))
    return _row(
        name,
        f"±{rate:g} Hz/s for {lasts:g} s at SCR {scr:g}, {whole_percent(power)}",
        programme,
        stays_inside(2, partial(envelope, -1), "power while the frequency rises", skipped=2),
        stays_inside(4, partial(envelope, 1), "power while the frequency falls", skipped=2),
    )

"""Checks in voltage dips, overvoltages and phase jumps, early and late."""

from cmath import rect
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import numpy as np

from orchestrator.core.arrays import Complex
from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import (
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.events import Segment, scale, series
from orchestrator.devices.acceptance.checks.port import (
    IMPORTING,
    WHY,
    cannot_import,
    current_limit,
    currents,
    present_current,
)
from orchestrator.devices.acceptance.checks.running import RUN_FOR, spent_since
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Subject
from orchestrator.devices.binding.misfits import NO_LIMIT

# of events [s]: a timer or a counter in an FMU may run out between two
_TIMES = (0.1, 1.0, 2.5, 3.0, 5.0)
_LASTS = 0.15  # duration of a disturbance [s]; a fault is cleared within it
_RIDDEN = 2.0  # longest dip after which the device is asked to be back [s]
_OVERLOAD = 10.0  # dip in which a limit that dies with time has died [s]

_STAYS_AT = 0.85
"""Voltage [pu] at which a device stays on for longer than any run here.

Commission Regulation (EU) 2016/631, article 16(2): 0.85 to 0.90 pu for 60 minutes in Continental Europe at 110 to
300 kV."""

_STAY = (
    ((0.8, 0.9), 1.0, _RIDDEN, None),
    ((_STAYS_AT, 0.875), 1.0, 6.0, None),
    ((0.17, 0.21), 1.0, 0.5, None),
    ((0.2, 0.35), 0.1, _OVERLOAD, None),
    ((0.42, 0.55), 0.1, _OVERLOAD, None),
    ((0.1, 0.25), 0.1, _OVERLOAD, replace(IMPORTING[0], Q=-0.3)),
)
"""Dips that stay: to what voltage [pu], when [s], how long [s], from which point."""

_ABOVE = 1.05  # part of a limit that a current may reach over a cycle
_SERIES = 4  # events before one that are a series
_KEPT = 0.8  # part of the current in a dip that a limit gives after a series of events, at least
_LESS = 0.02  # voltage [pu] by which it is lowered to see if its current follows at once
_MOST_OF_IT = (
    0.5  # part of the answer over a period that a current gives at once which is algebraic
)
_BLOCKED = 0.02  # current of a device that blocks [pu, S_n]
_GIVES = 0.1  # current of a device that gives any [pu, S_n]

_BLOCKS_FOR = 0.06
"""Time [s] without current at a healthy voltage from which a device blocks: zero crossings of its power are shorter."""

_HEALTHY = 0.9  # voltage [pu] at which a device has to stay on
# time [s] over which a current is averaged: what heats the semiconductors and what protection sees
_CYCLE = 0.02

# a limit acts in some dips only if a dip's current exceeds that in a dip to no voltage by this factor
_UNEVEN = 1.6
_MUCH = 2.2  # and this current [pu]

# the same of a jump in a voltage that lasts, in parts of that without; 1.2 where nothing limits
# both
_IN_VOLTAGE = 1.4

# distance of the current from where it was [pu, S_n] from which the next one hits a new instance
_BACK = 0.3
# runs, however many steps they take: at all times, dips that stay, after what lasts, with imported power
_AT_LEAST = 16
_PART = (
    2.5  # steps to spend, in parts of those for which an FMU is made to run: of a usual step all
)


@dataclass(frozen=True)
class Disturbance:
    """A factor on the voltage, from a time on, for a while; at an operating point of its own where not None."""

    name: str
    factor: complex
    at: float
    lasts: float = _LASTS
    point: OperatingAt | None = None
    before: tuple[Segment, ...] = ()

    def __str__(self) -> str:
        return f"the {self.name} at {self.at:g} s{f' from P_0 = {self.point.P:g}' if self.point else ''}"


@dataclass(frozen=True)
class Answer:
    """Response of a device to an event [pu, S_n]."""

    event: Disturbance
    peak: float  # the largest current
    early: float  # over the third cycle
    # over the last cycle; where it lasts longer than `_LASTS`, the largest over any cycle after
    # that
    mean: float
    away: float  # distance of the current from where it was, afterwards
    # time [s] without current at a healthy voltage, where it gives current before and after
    blocked: float
    gone: bool  # whether it gives no current in the end


def _runs(draw: np.random.Generator, longest: float) -> Iterator[list[Disturbance]]:
    """Every kind of event at every time, one at each time of a run; the first run has the most telling ones.

    Depths, angles and times are drawn, so that no device knows them; a bolted fault has no voltage at all."""

    def dip(least: float, most: float) -> tuple[str, complex]:
        to = round(draw.uniform(least, most), 3)
        return f"dip to {to:g} pu" if to < 1 else f"overvoltage of {to:g} pu", complex(to)

    def jump(least: float, most: float) -> tuple[str, complex]:
        angle = round(draw.uniform(least, most), 1)
        return f"phase jump of {angle:g}°", rect(1, angle * pi / 180)

    kinds = [
        jump(50, 70),
        dip(0.6, 0.75),
        dip(1.2, 1.3),
        dip(0.8, 0.95),
        dip(0.1, 0.35),
        jump(-70, -50),
        dip(0.36, 0.6),
        dip(1.05, 1.2),
        dip(0, 0),
        jump(15, 35),
    ]
    jitter = draw.uniform(0, 0.12, len(_TIMES))
    times = [round(float(at), 3) for at in np.array(_TIMES) + jitter * np.minimum(1, _TIMES)]
    for k in range(len(kinds)):
        if k == 1:
            for bounds, at, lasts, point in _STAY:
                (words, to), lasting = dip(*bounds), min(lasts, longest)
                yield [Disturbance(f"{words} for {lasting:.3g} s", to, at, lasting, point)]
            for bounds, least, most in (
                ((1.12, 1.2), 0.6, 1.0),
                ((1.12, 1.16), 2.2, 3.5),
                ((0.8, 0.9), 1.0, 2.5),
            ):
                (words, voltage), lasts = dip(*bounds), round(draw.uniform(least, most), 3)
                before, long = ((voltage, lasts),), f"{words} for {lasts:g} s"
                (words, to), (turned, by) = dip(0.1, 0.35), kinds[0]
                yield [Disturbance(f"{words} after the {long}", to, 0.1, before=before)]
                yield [Disturbance(f"{turned} in the {long}", voltage * by, 0.1, before=before)]
            words, to = dip(0.1, 0.35)
            yield [Disturbance(words, to, 0.1, 0.1)]
            yield [
                Disturbance(
                    f"{words} after a series of events", to, 0.1, 0.1, before=tuple(series(draw))
                )
            ]
            some = zip((kinds[8], kinds[6], kinds[5]), times, strict=False)
            yield [Disturbance(*kind, at, point=IMPORTING[0]) for kind, at in some]
        yield [
            Disturbance(*kinds[(k + 2 * place) % len(kinds)], at) for place, at in enumerate(times)
        ]


@check(
    "limits",
    "Does it limit its current, and come back from voltage dips, overvoltages and phase jumps?",
)
def limits(subject: Subject) -> CheckResult:
    """Disturb it at several times; a run goes on while it comes back, and begins anew where it does not."""
    if not subject.port:
        return not_applicable("limits", WHY["no port"])
    spent, budget = spent_since(subject), _PART * subject.memory.get("run_for", RUN_FOR)
    answers, refused = list[Answer](), list[str]()
    other_way = ""
    left_out = 0
    longest = max(_RIDDEN, _OVERLOAD * min(1.0, 2 * scale(subject, _OVERLOAD)))
    for number, run in enumerate(_runs(subject.random("limits"), longest)):
        rest = list(run)
        if rest[0].point is not None:
            other_way = cannot_import(subject, rest[0].point) if subject.starts else ""
            rest = rest if subject.starts and not other_way else []
        while rest:
            if number >= _AT_LEAST and spent() > budget:
                left_out += len(rest)
                break
            bad = _disturbed(subject, rest, answers, refused)
            if bad is not None:
                says = f"its current is no number in {bad}, and fmi2DoStep returned OK"
                return failed("limits", "not a number", says, case=str(bad))
    result = _judge(subject, answers, refused, left_out)
    if longest < _OVERLOAD:
        result.figures["not_judged"] = f"whether its limit lasts for more than {longest:.2g} s"
    if other_way and not result.fault:
        remedy = result.remedy or "do not use it with imported power, or ask how it starts"
        return remarked("limits", f"{result.evidence}; {other_way}", remedy, **result.figures)
    return result


def _disturbed(
    subject: Subject, rest: list[Disturbance], answers: list[Answer], refused: list[str]
) -> Disturbance | None:
    """Let events happen to one instance, as long as it comes back; those that happened leave the list."""
    point, h = rest[0].point, subject.step_size
    normal = (point or subject.point).voltage
    with subject.running(point=point) as running:
        while rest:
            event = rest.pop(0)
            try:
                with subject.while_doing(f"in {event}"):
                    before = currents(running, 0j, max(1, round((event.at - running.time) / h)))
                    for voltage, lasts in event.before:
                        currents(running, (voltage - 1) * normal, max(1, round(lasts / h)))
                    during = currents(
                        running, (event.factor - 1) * normal, max(1, round(event.lasts / h))
                    )
                with subject.while_doing(f"after {event}"):
                    following = rest[0].at if rest else running.time + _BACK
                    after = currents(running, 0j, max(1, round((following - running.time) / h)) - 1)
            except ComponentError as error:
                refused.append(f"{event}: {error.log or error.status}")
                return None
            size = np.abs(np.concatenate([during, after]))
            if not np.isfinite(size).all():
                return event
            cycle = max(1, round(_CYCLE / h))
            away = abs(after[-1] - before[-1]) if len(after) else 0.0
            late = np.abs(during[max(0, min(len(during), round(_LASTS / h)) - cycle) :])
            means = np.convolve(
                late, np.full(min(cycle, len(late)), 1 / min(cycle, len(late))), "valid"
            )
            healthy = during if abs(event.factor) >= _HEALTHY else during[:0]
            blocked, gone = _blocked(before[-1], np.concatenate([healthy, after]), h)
            if (
                event.lasts > _RIDDEN and abs(event.factor) < _STAYS_AT
            ):  # nobody asks it to ride that through
                away = 0.0
                blocked = 0.0
                gone = False
            early = float(np.abs(during[2 * cycle : 3 * cycle]).mean())
            answers.append(
                Answer(
                    event,
                    float(size.max()),
                    early=early,
                    mean=float(means.max()),
                    away=float(away),
                    blocked=blocked,
                    gone=gone,
                )
            )
            if away > _BACK:
                return None
    return None


def _follows_at_once(subject: Subject) -> bool:
    """Return whether its current is a function of the voltage: it answers a change of it before any step."""
    names = subject.inputs
    with subject.running() as running:
        before = present_current(running)
        change = np.zeros(len(names))
        change[names.index("v_re")] = -_LESS
        running.feed(change)
        at_once = present_current(running) - before
        settled = currents(running, -_LESS, max(1, round(_CYCLE / subject.step_size)))[-1] - before
    return bool(abs(at_once) > _MOST_OF_IT * abs(settled))


def _lower_limit(answers: list[Answer]) -> str:
    """Say that its limit is lower after a series of events than before; "" if it is not."""
    late = next((a for a in answers if len(a.event.before) > _SERIES), None)
    if late is None:
        return ""
    first = [a for a in answers if not a.event.before and a.event.factor == late.event.factor]
    if not first or late.mean > _KEPT * first[0].mean or first[0].mean < 1.0:
        return ""
    says = f"its current is limited to {late.mean:.3g} pu in {late.event}"
    return f"{says}, and to {first[0].mean:.3g} pu in the same dip at the start"


def _is_turned_alike(one: Disturbance, other: Disturbance) -> bool:
    return abs(one.factor / abs(one.factor) - other.factor / abs(other.factor)) < 1e-9


def _blocked(before: complex, current: Complex, h: float) -> tuple[float, bool]:
    """The longest time without current that ends, and whether there is none in the end."""
    some = np.flatnonzero(np.abs(current) > _BLOCKED)
    if abs(before) < _GIVES or not len(current):
        return 0.0, False
    pauses = np.diff(np.concatenate([[-1], some])) - 1
    return float(pauses.max(initial=0)) * h, not len(some) or len(current) - 1 - some[
        -1
    ] > _BLOCKS_FOR / h


def _judge(
    subject: Subject, answers: list[Answer], refused: list[str], left_out: int
) -> CheckResult:
    if not answers:
        return remarked("limits", "; ".join(refused[:2]), "ask how it rides through")
    worst, highest = max(answers, key=lambda a: a.mean), max(answers, key=lambda a: a.peak)
    declared = current_limit(subject)
    seen = (
        f"{len(answers)} dips, overvoltages and jumps at {_TIMES[0]:g} to {_TIMES[-1]:g} s, drawn at random: at most "
        f"{worst.mean:.3g} pu of its rating over a cycle, from {1000 * _LASTS:g} ms on, in {worst.event}, "
        f"peak {highest.peak:.3g} pu in {highest.event}"
    )
    seen += f"; {left_out} more were left out, for their steps" if left_out else ""
    figures: dict[str, Any] = {
        "peak": highest.peak,
        "mean": worst.mean,
        "declared": declared,
        "tried": len(answers),
        "left_out": left_out,
    }
    if declared is not None and worst.mean > _ABOVE * declared:
        return failed(
            "limits", "above its current limit", f"{seen}; {declared:g} pu is declared", **figures
        )
    machine = subject.is_machine
    unsaid = declared is None and not machine
    seen += (
        "; it is a machine, whose current nothing limits" if machine and declared is None else ""
    )
    if unsaid and worst.mean > NO_LIMIT and _follows_at_once(subject):
        seen += "; nothing limits its current, which follows the voltage at once: a phasor model without a current loop"
        figures["not_judged"] = "what limits its current, which a phasor model without a loop lacks"
        machine = True
        unsaid = False
    if unsaid and worst.mean > NO_LIMIT:
        says = f"nothing limits its current: {worst.mean:.3g} pu in {worst.event}, where no converter gives more "
        return failed(
            "limits", "no current limit", f"{says}than {NO_LIMIT:g} pu; {seen}", **figures
        )
    turned = [a for a in answers if a.event.factor.imag]
    late = max((a for a in turned if a.event.before), key=lambda a: a.early, default=None)
    alike = [
        a.early
        for a in turned
        if late and not a.event.before and _is_turned_alike(a.event, late.event)
    ]
    bolted = max((a.mean for a in answers if a.event.factor == 0), default=worst.mean)
    limit = _ABOVE * (max(1.0, bolted) if declared is None else declared)
    if not machine and late and alike and late.early > max(limit, _IN_VOLTAGE * max(alike)):
        says = f"a limit that does not act in a voltage that lasts: {late.early:.3g} pu in the third cycle of "
        says += (
            f"{late.event}, {max(alike):.3g} pu in the same jump in a usual voltage, and its limit "
        )
        says += f"is {limit / _ABOVE:.3g} pu"
        return failed("limits", "no current limit", f"{says}; {seen}", **figures)
    deep = max(
        (a for a in answers if 0 < abs(a.event.factor) < _HEALTHY),
        key=lambda a: a.mean,
        default=worst,
    )
    if unsaid and deep.mean > max(_UNEVEN * bolted, _MUCH):
        says = f"{deep.mean:.3g} pu in {deep.event}, and no more than {bolted:.3g} pu in a dip to no voltage"
        return failed(
            "limits",
            "no current limit",
            f"a limit that acts in some dips only: {says}; {seen}",
            **figures,
        )
    return _return_of(answers, refused, seen, figures)


def _return_of(
    answers: list[Answer], refused: list[str], seen: str, figures: dict[str, Any]
) -> CheckResult:
    """Judge if it stays on and comes back."""
    highest = max(answers, key=lambda a: a.peak)
    lost = [a for a in answers if a.away > _BACK]
    longest = max(answers, key=lambda a: a.blocked)
    if longest.blocked > _BLOCKS_FOR:
        says = f"it gives no current for {1000 * longest.blocked:.0f} ms at a healthy voltage around {longest.event}"
        return failed("limits", "blocks", f"{says}; {seen}", blocked=longest.blocked, **figures)
    tripped = [a for a in answers if a.gone and abs(a.event.factor) >= _STAYS_AT]
    if tripped:
        says = f"it gives no current any more after {tripped[0].event}"
        return failed("limits", "trips", f"{says}; {seen}", **figures)
    spent = _lower_limit(answers)
    if spent:
        return failed("limits", "changed by a disturbance", f"{spent}; {seen}", **figures)
    if refused:
        seen += f"; {refused[0]}"
    gone = [a for a in answers if a.gone]
    if gone:
        seen += f"; it gives no current any more after {gone[0].event}"
    if lost:
        seen += f"; it is {lost[0].away:.2g} pu away after {lost[0].event}" + (
            f", and after {len(lost) - 1} more" if len(lost) > 1 else ""
        )
    if lost or refused or gone or highest.peak > 10 or "not_judged" in figures:
        return remarked(
            "limits", seen, "ask how it limits its current and rides through", **figures
        )
    return passed("limits", seen, **figures)

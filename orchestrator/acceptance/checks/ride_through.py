"""What a converter does in voltage dips, overvoltages and phase jumps, early and late."""

from cmath import rect
from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from time import perf_counter

import numpy as np

from orchestrator.acceptance.checks.base import CheckResult, check, failed, not_applicable, passed, remarked
from orchestrator.acceptance.checks.port import IMPORTING, WHY, cannot_import, current_limit, currents
from orchestrator.acceptance.checks.subject import OperatingAt, Subject
from orchestrator.errors import ComponentError

_TIMES = (0.1, 1.0, 2.5, 3.0, 5.0)
"""When something happens [s]: a timer or a counter in an FMU may run out between two of them."""

_LASTS = 0.15
"""Duration of a disturbance [s]; a fault is cleared within it."""

_LONG = (0.85, 1.0, 2.0)
"""A dip that stays: to what voltage [pu], when [s], how long [s]."""

_DEEP = (0.2, 1.0, 0.5)
"""A deep dip that outlasts a fault that is cleared in time."""

_CYCLE = 0.02
"""Time [s] over which a current is averaged: what heats the semiconductors and what protection sees."""

NO_LIMIT = 3.3
"""Current [pu, S_n] over the last cycle of a disturbance that no converter with a current limit gives.

Semiconductors carry 1.0 to 1.5 times the rated current, 2 where they are overrated; ours, with limits of 1.1 in either
axis, gives up to 1.7 at the grid's side of its filter, and a machine at a stiff bus up to 3.1. More must be declared
(`I_max` of the binding).
"""

_BACK = 0.3
"""Distance of the current from where it was [pu, S_n], from which the next disturbance begins with a new instance."""

_AT_LEAST = 4
"""Runs that are made however long they take: at all times, dips that stay, and while power flows the other way."""

_PART = 1.5
"""Wall-clock time to spend, in parts of the time for which an FMU is made to run."""


@dataclass(frozen=True)
class Disturbance:
    """A factor on the voltage, from a time on, for a while; at an operating point of its own where not None."""

    name: str
    factor: complex
    at: float
    lasts: float = _LASTS
    point: OperatingAt | None = None

    def __str__(self) -> str:
        return f"the {self.name} at {self.at:g} s{f' from P_0 = {self.point.P:g}' if self.point else ''}"


@dataclass(frozen=True)
class Answer:
    """What an event brought [pu, S_n].

    Attributes
    ----------
    peak
        The largest current.
    mean
        Over the last cycle; where it lasts longer than `_LASTS`, the largest over any cycle after that.
    away
        Distance of the current from where it was, afterwards.
    """

    event: Disturbance
    peak: float
    mean: float
    away: float


def _runs() -> Iterator[list[Disturbance]]:
    """Every kind of event at every time, one at each time of a run; the first run has the most telling ones."""
    dips = {v: (f"dip to {v:g} pu", complex(v)) for v in (0.9, 0.7, 0.5, 0.2, 0.0)}
    swells = {v: (f"overvoltage of {v:g} pu", complex(v)) for v in (1.1, 1.3)}
    jumps = {a: (f"phase jump of {a:g}°", rect(1, a * pi / 180)) for a in (60.0, -60.0, 20.0)}
    kinds = [jumps[60.0], dips[0.7], swells[1.3], dips[0.9], dips[0.2],
             jumps[-60.0], dips[0.5], swells[1.1], dips[0.0], jumps[20.0]]  # fmt: skip
    for k in range(len(kinds)):
        if k == 1:
            for to, at, lasts in (_LONG, _DEEP):
                yield [Disturbance(f"dip to {to:g} pu for {lasts:g} s", complex(to), at, lasts)]
            some = zip((dips[0.0], dips[0.5], jumps[-60.0]), _TIMES, strict=False)
            yield [Disturbance(*kind, at, point=IMPORTING[0]) for kind, at in some]
        yield [Disturbance(*kinds[(k + 2 * place) % len(kinds)], at) for place, at in enumerate(_TIMES)]


@check("limits", "Does it limit its current, and come back from voltage dips, overvoltages and phase jumps?")
def limits(subject: Subject) -> CheckResult:
    """Disturb it at several times; a run goes on while it comes back, and begins anew where it does not."""
    if not subject.port:
        return not_applicable("limits", WHY["no port"])
    begin, budget = perf_counter(), _PART * subject.memory.get("run_for", 2.0)
    answers: list[Answer] = []
    refused: list[str] = []
    left_out, other_way = 0, ""
    for number, run in enumerate(_runs()):
        rest = list(run)
        if rest[0].point is not None:
            other_way = cannot_import(subject, rest[0].point) if subject.starts else ""
            rest = rest if subject.starts and not other_way else []
        while rest:
            if number >= _AT_LEAST and perf_counter() - begin > budget:
                left_out += len(rest)
                break
            bad = _disturbed(subject, rest, answers, refused)
            if bad is not None:
                return failed(
                    "limits", "not a number", f"its current is no number in {bad}, and fmi2DoStep returned OK",
                    case=str(bad),
                )  # fmt: skip
    result = _judged(subject, answers, refused, left_out)
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
                    during = currents(running, (event.factor - 1) * normal, max(1, round(event.lasts / h)))
                with subject.while_doing(f"after {event}"):
                    following = rest[0].at if rest else event.at + event.lasts + _BACK
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
            means = np.convolve(late, np.full(min(cycle, len(late)), 1 / min(cycle, len(late))), "valid")
            answers.append(Answer(event, float(size.max()), float(means.max()), float(away)))
            if away > _BACK:
                return None
    return None


def _judged(subject: Subject, answers: list[Answer], refused: list[str], left_out: int) -> CheckResult:
    if not answers:
        return remarked("limits", "; ".join(refused[:2]), "ask how it rides through")
    worst, highest = max(answers, key=lambda a: a.mean), max(answers, key=lambda a: a.peak)
    lost = [a for a in answers if a.away > _BACK]
    declared = current_limit(subject)
    seen = (
        f"{len(answers)} dips, overvoltages and jumps at {_TIMES[0]:g} to {_TIMES[-1]:g} s: at most "
        f"{worst.mean:.3g} pu of its rating over a cycle, from {1000 * _LASTS:g} ms on, in {worst.event}, "
        f"peak {highest.peak:.3g} pu in {highest.event}"
    )
    seen += f"; {left_out} more were left out for time" if left_out else ""
    figures = {
        "peak": highest.peak,
        "mean": worst.mean,
        "declared": declared,
        "tried": len(answers),
        "left_out": left_out,
    }
    if declared is not None and worst.mean > 1.05 * declared:
        return failed("limits", "above its current limit", f"{seen}; {declared:g} pu is declared", **figures)
    if declared is None and worst.mean > NO_LIMIT:
        return failed("limits", "no current limit", seen, **figures)
    if refused:
        seen += f"; {refused[0]}"
    if lost:
        seen += f"; it is {lost[0].away:.2g} pu away after {lost[0].event}" + (
            f", and after {len(lost) - 1} more" if len(lost) > 1 else ""
        )
    if lost or refused or highest.peak > 10:
        return remarked("limits", seen, "ask how it limits its current and rides through", **figures)
    return passed("limits", seen, **figures)

"""Traces of dips, overvoltages and jumps: another answer to small changes, another rest, memory."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from enum import Enum, auto
from functools import partial
from itertools import pairwise
from math import pi
from typing import Any

import numpy as np

from orchestrator.core.arrays import Complex
from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.events import Segment, factor, in_words, scale, series
from orchestrator.devices.acceptance.checks.port import (
    WHY,
    current_limit,
    currents,
    followed,
    voltage_rows,
)
from orchestrator.devices.acceptance.checks.running import RUN_FOR, spent_since
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Running, Subject, unmoved

# with so little power that a converter comes back from most disturbances
_POINT = OperatingAt(1.0, 0.0, 0.4, 0.05)
# the same after it did not: with hardly any power an angle has no reason to leave its place
_LOW = OperatingAt(1.0, 0.0, 0.05, 0.05)
# duration [s] of small changes at once: 1.5 % less voltage, a jump of 1.5°, 0.1 % less frequency
_PROBE = 0.3
_CHANGED = 0.05  # part of an answer to a small change by which it may differ after a disturbance
_BACK = 5e-4  # distance of the current from where it was [pu, S_n] at which it has come back

_WINDOW = 0.1  # time from one look to the next [s]
_WINDOWS = 60  # looks, at most, at whether the device has come back
_PATIENT = 200  # the same where it hardly gives power
_LOST = 0.3  # distance [pu, S_n] at which it is given up
_GIVEN_UP = 20  # looks before it may be given up

_STILL = 1e-4  # movement in a window of a device at rest [pu, S_n]
_ELSEWHERE = 0.01  # distance from the first rest that is another rest [pu, S_n]
_NOTHING = 0.01  # current of a device that gives none [pu, S_n]

# part of the current limit, or of the rating, from which a device at rest may be held by its limit
_LATCHED = 0.9
# bytes kept by each step of a dip that are a leak; a new page of the heap is up to 12 in some
# hundred
_LEAST = 32.0
_BLOCKS = 5  # parts of a disturbance, between which the memory is read
_SOON = (0, 2, 4)  # numbers of those soon after which it is asked as well
_PART = 0.75  # time to spend, in parts of the time for which an FMU is made to run
_ALWAYS = (("deep", 0.45), ("jump", 0.15), ("series", 0), ("high", 0.6))
_IN_TIME = (("middle", 0.2), ("low", 0.15), ("small jump", 0.2))
"""Kinds of disturbances, and how long they last [s]; the latter are made as long as there is time."""
_LATER = ((0.15, 0.4), (0.8, 1.6), (2.5, 3.5))
"""Times [s] after a disturbance, of which one each is drawn, at which it is asked before it has come back as well."""
_NEAR = 0.3  # distance [pu, S_n] from which on the device is too far away to be asked
_BENT = 0.5  # by what more an answer may differ there, per pu of the distance


class _End(Enum):
    """State of a device after a disturbance."""

    BACK = auto()
    MOVES = auto()
    ELSEWHERE = auto()
    NOTHING = auto()
    HELD = auto()
    REFUSED = auto()


_SETTLED = (_End.BACK, _End.ELSEWHERE)  # what can be compared

_WORDS = {
    _End.MOVES: "it had not come to rest",
    _End.NOTHING: "it gives no current any more",
    _End.HELD: "its current stays at its limit",
    _End.REFUSED: "it refuses to go on",
}


@dataclass(frozen=True)
class _After:
    words: str
    end: _End
    away: float = 0.0  # distance of the current from where it was [pu, S_n]
    changed: float = 0.0  # by which part of it the answer to small changes differs
    kept: float = 0.0  # bytes kept by each step meanwhile


@check("after_dips", "Is it after dips and jumps what it was before?", needs=SAME)
def after_dips(subject: Subject) -> CheckResult:
    """Disturb it, wait until it has come back, and compare its answers to small changes with those of before."""
    if not subject.port:
        return not_applicable("after_dips", WHY["no port"])
    try:
        look = _Look(subject)
    except ComponentError as error:
        return remarked("after_dips", f"small changes end with an error: {error}", "ask why")
    found: list[_After] = []
    unknown: list[_After] = []
    spent, budget = spent_since(subject), _PART * subject.memory.get("run_for", RUN_FOR)
    for number, segments in enumerate(_drawn(subject)):
        if number >= len(_ALWAYS) and spent() > budget:
            break
        found += look.until_back(segments, number in _SOON)
        result = _wrong(found[-1])
        if result:
            return result
        if found[-1].end is not _End.BACK:
            unknown.append(found[-1])
    return _judge(found, unknown, ends="ended_at" in subject.memory)


def _drawn(subject: Subject) -> Iterator[list[Segment]]:
    draw = subject.random("after dips")
    for kind, lasts in (*_ALWAYS, *_IN_TIME):
        one = round(lasts * draw.uniform(0.85, 1.15), 3)
        yield series(draw) if kind == "series" else [(factor(draw, kind), one)]


def _wrong(after: _After) -> CheckResult | None:
    """The fault that shows in what a disturbance left behind."""
    if after.kept > _LEAST:
        says = f"it keeps {after.kept:.0f} bytes with every step in the {after.words}"
        return failed("after_dips", "memory leak", says, kept=after.kept)
    if after.changed:
        says = f"its answer to small changes differs by {100 * after.changed:.2g} % after the {after.words}"
        return failed("after_dips", "changed by a disturbance", says, changed=after.changed)
    if after.end is _End.ELSEWHERE:
        says = f"it rests {after.away:.3g} pu away from where it was after the {after.words}"
        return failed("after_dips", "rests elsewhere", says, away=after.away)
    return None


def _judge(found: list[_After], unknown: list[_After], *, ends: bool) -> CheckResult:
    """Tell what was compared; what was not, with little power and a third of it either, is a reason not to accept.

    ``ends``: it ends its simulation by itself, in order, so that nothing can be seen afterwards."""
    back = [after for after in found if after.end is _End.BACK]
    lost = [after for after in found if after.end is not _End.BACK]
    figures: dict[str, Any] = {"compared": len(back), "not_compared": len(lost)}
    if unknown:
        figures |= {"not_judged": f"what dips leave behind ({_unlike(unknown[0])})"}
        figures |= {"reason": not ends}
    if not back:
        return remarked(
            "after_dips",
            f"not judged: {'; '.join(map(_unlike, lost[:2]))}",
            "ask how it rides through",
            **figures,
        )
    says = f"it answers small changes as before after {', '.join(f'the {after.words}' for after in back)}"
    says += f"; not after stronger ones: {'; '.join(map(_unlike, lost[:2]))}" if lost else ""
    says += f", and so after {len(lost) - 2} more" if len(lost) > 2 else ""
    return passed("after_dips", says, **figures)


def _unlike(after: _After) -> str:
    return f"{_WORDS[after.end]} after the {after.words}"


class _Look:
    """Runs with disturbances and small changes after them, and what they are compared with."""

    def __init__(self, subject: Subject, point: OperatingAt | None = None) -> None:
        self._subject, self._draw = subject, subject.random("soon after")
        usual = (subject.use.point or _POINT) if subject.starts else None
        self._point = point or usual
        self._windows = _PATIENT if point else _WINDOWS
        self._where = f", from P_0 = {point.P:g}" if point else ""
        self._times = scale(subject, 1.5)
        time = np.arange(self._steps(_PROBE)) * subject.step_size
        self._still = np.ones(len(time), complex)
        self._small = 0.985 * np.exp(1j * pi * (1 / 120 - 0.1 * time))
        self._rest = complex(self._course((), 0, np.ones(self._steps(_WINDOW), complex))[-1])
        self._usual = self._course((), 0, self._small) - self._rest

    def _steps(self, seconds: float) -> int:
        return max(2, round(self._times * seconds / self._subject.step_size))

    def _disturb(self, running: Running, segments: Sequence[Segment]) -> Iterator[int]:
        """Rest, and disturb it by factors of the voltage; the steps of each part."""
        currents(running, 0j, self._steps(_WINDOW))
        for voltage, lasts in segments:
            steps = max(1, self._steps(lasts) // _BLOCKS)
            for _ in range(_BLOCKS):
                running.hold(
                    voltage_rows(running, np.array([voltage])), steps, self._subject.step_size
                )
                yield steps

    def _course(self, segments: Sequence[Segment], wait: int, factors: Complex) -> Complex:
        """The current in the frame of the voltage while that is changed by factors, some steps after a disturbance."""
        with self._subject.running(point=self._point) as running:
            for _ in self._disturb(running, segments):
                pass
            followed(running, np.ones(wait, complex))
            return _in_frame(running, factors)

    def _answers(self, running: Running) -> tuple[Complex, Complex]:
        """Return what it does with and without small changes from here on, where it stays."""
        with unmoved(running):
            small = _in_frame(running, self._small)
        with unmoved(running):
            return small, _in_frame(running, self._still)

    def until_back(self, segments: Sequence[Segment], soon: bool) -> list[_After]:
        """Disturb it so, then with hardly any power, then by a third, until it comes back."""
        tries = [self.after(segments, soon)]
        if tries[-1].end in _SETTLED:
            return tries
        low = _Look(self._subject, _LOW) if self._subject.starts else self
        gentler = [(1 + (voltage - 1) / 3, lasts / 2) for voltage, lasts in segments]
        for parts in (segments, gentler) if low is not self else (gentler,):
            tries.append(low.after(parts, False))
            if tries[-1].end in _SETTLED:
                break
        return tries

    def after(self, segments: Sequence[Segment], soon: bool) -> _After:
        """Return what a disturbance of the voltage by factors leaves behind.

        ``soon``: whether small changes are made before it has come back as well."""
        lasts = f"{self._times * sum(lasts for _, lasts in segments):.2g} s"
        one = f"{in_words(segments[0][0])} for {lasts}"
        words = (
            one
            if len(segments) == 1
            else f"{len(segments) // 2} dips, overvoltages and jumps in {lasts}"
        ) + self._where
        try:
            with (
                self._subject.while_doing(f"in the {words} and after it"),
                self._subject.running(point=self._point) as running,
            ):
                end, away, kept, answers = self._seen(running, segments, soon)
            for steps, small, here in answers:
                changed = self._changed(segments, steps, small, here)
                if changed:
                    later = f"{words}, {steps * self._subject.step_size:.2g} s later"
                    return _After(later, _End.BACK, away, changed, kept)
        except ComponentError:
            self._subject.doing = ""
            return _After(words, _End.REFUSED)
        return _After(words, end, away, kept=kept)

    def _seen(
        self, running: Running, segments: Sequence[Segment], soon: bool
    ) -> tuple[_End, float, float, Iterable[tuple[int, Complex, Complex]]]:
        """Return how it ends, how far away, the bytes that each step keeps, and its answers after how many steps.

        Where its states come back, one run shows all of them."""
        sizes = []
        for number, steps in enumerate(self._disturb(running, segments)):
            if number < _BLOCKS:
                sizes.append((self._subject.memory_in_use(), steps))
        kept = max(0.0, min((b - a) / steps for (a, _), (b, steps) in pairwise(sizes)))
        begun, restores = running.time, self._subject.memory.get("restores", False)
        waits = sorted(
            self._steps(self._draw.uniform(*bounds)) for bounds in (_LATER if soon else ())
        )
        with unmoved(running) if restores else nullcontext():
            end, away = self._came_back(running, self._rest)
            back = (
                [round((running.time - begun) / self._subject.step_size)]
                if end is _End.BACK
                else []
            )
            last = [(wait, *self._answers(running)) for wait in back if restores]
        if not restores:
            course = partial(self._course, segments)
            return (
                end,
                away,
                kept,
                ((w, course(w, self._small), course(w, self._still)) for w in [*waits, *back]),
            )
        found = []
        for before, wait in pairwise([0, *waits]):
            followed(running, np.ones(wait - before, complex))
            found.append((wait, *self._answers(running)))
        return end, away, kept, [*found, *last]

    def _changed(
        self, segments: Sequence[Segment], wait: int, small: Complex, here: Complex
    ) -> float:
        """By which part of it the answer to small changes differs, beside the same run without them; 0 where alike."""
        away = float(np.abs(here - self._rest).max())
        if not away < _NEAR:
            return 0.0
        answer, most = small - here, _CHANGED + _BENT * away
        size = max(float(np.abs(self._usual).max()), 0.01)
        changed = float(np.abs(answer - self._usual).max()) / size
        if changed > most:  # perhaps by the time that has passed
            idle = [(1 + 0j, lasts) for _, lasts in segments]
            usual = self._course(idle, wait, self._small) - self._course(idle, wait, self._still)
            changed = float(np.abs(answer - usual).max()) / size
        return changed if changed > most else 0.0

    def _came_back(self, running: Running, rest: complex) -> tuple[_End, float]:
        steps, quiet = self._steps(_WINDOW), 0
        for number in range(self._windows):
            current = currents(running, 0j, steps)
            if not np.isfinite(current).all():
                return _End.REFUSED, np.inf
            away, moves = (
                float(np.abs(current - rest).max()),
                float(np.abs(current - current[-1]).max()),
            )
            if away < _BACK:
                return _End.BACK, away
            quiet = quiet + 1 if moves < min(_STILL, away / 1000) and away > _ELSEWHERE else 0
            if quiet == 3:
                break
            if number == self._windows - 1 or (number >= _GIVEN_UP and away > _LOST):
                return _End.MOVES, away
        size = abs(current[-1])
        if size < _NOTHING:
            return _End.NOTHING, away
        return (
            _End.HELD
            if size > _LATCHED * min(1.0, current_limit(self._subject) or 1.0)
            else _End.ELSEWHERE
        ), away


def _in_frame(running: Running, factors: Complex) -> Complex:
    """The current in the frame of the voltage while that is changed by factors."""
    return followed(running, factors) * np.abs(factors) / factors

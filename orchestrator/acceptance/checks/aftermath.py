"""What dips, overvoltages and jumps leave behind: another answer to small changes, another rest, memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from itertools import pairwise
from math import pi
from typing import Any

import numpy as np

from orchestrator.acceptance.checks.base import SAME, CheckResult, check, failed, not_applicable, passed, remarked
from orchestrator.acceptance.checks.events import Segment, factor, in_words, scale, series
from orchestrator.acceptance.checks.port import WHY, current_limit, currents, followed, voltage_rows
from orchestrator.acceptance.checks.running import RUN_FOR, spent_since
from orchestrator.acceptance.checks.subject import OperatingAt, Running, Subject
from orchestrator.arrays import Complex
from orchestrator.errors import ComponentError

_POINT = OperatingAt(1.0, 0.0, 0.4, 0.05)  # with so little power that a converter comes back from most disturbances
_PROBE = 0.3  # duration [s] of each small change: 1.5 % less voltage, a jump of 1.5°, 0.1 % less frequency
_CHANGED = 0.05  # part of an answer to a small change by which it may differ after a disturbance
_BACK = 5e-4  # distance of the current from where it was [pu, S_n] at which it has come back

_WINDOW, _WINDOWS = 0.1, 60  # time [s] from one look to the next, and how often it is looked whether it has come back

_LOST, _GIVEN_UP = 0.3, 20  # distance [pu, S_n] at which no more is looked after so many windows

_STILL, _ELSEWHERE, _NOTHING = 1e-4, 0.01, 0.01
"""Movement in a window [pu, S_n] of a device at rest; distance that is another rest; current of one that gives none."""

_LATCHED = 0.9  # part of the current limit, or of the rating, from which a device at rest may be held by its limit
_LEAST = 32.0
"""Bytes kept by each step of a dip that count as a leak; a new page of the heap is up to 12 in some hundred steps."""

_BLOCKS = 5  # parts of a disturbance, between which the memory is read
_SOON = (0, 2, 4)  # numbers of those soon after which it is asked as well
_PART = 0.75  # time to spend, in parts of the time for which an FMU is made to run
_EVENTS = (("deep", 0.45), ("jump", 0.15), ("middle", 0.2), ("swell", 0.2), ("low", 0.15), ("small jump", 0.2))
"""Kinds of disturbances, and how long they last [s]."""
_LATER = ((0.15, 0.4), (0.8, 1.6), (3.5, 5.0))
"""Times [s] after a disturbance, of which one each is drawn, at which it is asked before it has come back as well."""
_NEAR, _APART, _BENT = 0.3, 0.15, 0.5
"""Distance [pu, S_n] from which it is too far away to be asked; parts of an answer by which it may differ then: this
much, and so much a pu of the distance."""


class _End(Enum):
    """What became of a device after a disturbance."""

    BACK = auto()
    MOVES = auto()
    ELSEWHERE = auto()
    NOTHING = auto()
    HELD = auto()
    REFUSED = auto()


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
    changed: float = 0.0  # by which part of it the answer to a small change differs, and to which
    of: str = ""
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
    spent, budget = spent_since(), _PART * subject.memory.get("run_for", RUN_FOR)
    for number, segments in enumerate(_drawn(subject)):
        if number >= 3 and spent() > budget:
            break
        found.append(look.after(segments))
        if found[-1].end is not _End.BACK and found[-1].end is not _End.ELSEWHERE:
            found.append(look.after([(1 + (voltage - 1) / 3, lasts / 2) for voltage, lasts in segments]))
        soon = look.soon(segments) if number in _SOON else found[-1]
        if result := _wrong(found[-1]) or _wrong(soon):
            return result
    return _judged(found)


def _drawn(subject: Subject) -> Iterator[list[Segment]]:
    draw = subject.random("after dips")
    for number, (kind, lasts) in enumerate(_EVENTS):
        if number == 2:
            yield series(draw)
        yield [(factor(draw, kind), round(lasts * draw.uniform(0.85, 1.15), 3))]


def _wrong(after: _After) -> CheckResult | None:
    """The fault that shows in what a disturbance left behind."""
    if after.kept > _LEAST:
        says = f"it keeps {after.kept:.0f} bytes with every step in the {after.words}"
        return failed("after_dips", "memory leak", says, kept=after.kept)
    if after.changed:
        says = f"its answer to {after.of} differs by {100 * after.changed:.2g} % after the {after.words}"
        return failed("after_dips", "changed by a disturbance", says, changed=after.changed)
    if after.end is _End.ELSEWHERE:
        says = f"it rests {after.away:.3g} pu away from where it was after the {after.words}"
        return failed("after_dips", "rests elsewhere", says, away=after.away)
    return None


def _judged(found: list[_After]) -> CheckResult:
    back = [after for after in found if after.end is _End.BACK]
    lost = [after for after in found if after.end is not _End.BACK]
    says = f"it answers small changes as before after {', '.join(f'the {after.words}' for after in back)}"
    unknown = "; ".join(f"{_WORDS[after.end]} after the {after.words}" for after in lost[:2])
    unknown += f", and so after {len(lost) - 2} more" if len(lost) > 2 else ""
    figures: dict[str, Any] = {"compared": len(back), "not_compared": len(lost)}
    if not back:
        figures["not_judged"] = "what dips leave behind"
        return remarked("after_dips", f"not judged: {unknown}", "ask how it rides through", **figures)
    figures |= {"not_judged": "what some dips leave behind"} if lost else {}
    return passed("after_dips", f"{says}; not judged: {unknown}" if lost else says, **figures)


class _Look:
    """Runs with a disturbance and small changes after it, and what they are compared with."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._point = (subject.use.point or _POINT) if subject.starts else None
        self._times, self._draw = scale(subject, 1.5), subject.random("soon after")
        with self._running() as running:
            self._rest = complex(currents(running, 0j, self._steps(_WINDOW))[-1])
            self._usual = self._probed(running)
        self._sizes = [float(np.abs(part - part[0]).max()) for part in self._usual]

    def _running(self) -> Running:
        return self._subject.running(point=self._point)

    def _steps(self, seconds: float) -> int:
        return max(2, round(self._times * seconds / self._subject.step_size))

    def _probed(self, running: Running) -> list[Complex]:
        """The current in the frame of the voltage while small changes are made, one after another."""
        steps = self._steps(_PROBE)
        time = np.arange(steps) * self._subject.step_size
        turning = np.exp(-2j * pi * 0.05 * time)  # 0.1 % of 50 Hz
        found = []
        for change in (np.full(steps, 0.985 + 0j), np.full(steps, np.exp(1j * pi / 120)), turning):
            found.append(followed(running, change) * np.abs(change) / change)
        return found

    def _words(self, segments: Sequence[Segment]) -> str:
        lasts = f"{self._times * sum(lasts for _, lasts in segments):.2g} s"
        if len(segments) > 1:
            return f"{len(segments) // 2} dips, overvoltages and jumps in {lasts}"
        return f"{in_words(segments[0][0])} for {lasts}"

    def _disturb(self, running: Running, segments: Sequence[Segment]) -> Iterator[int]:
        """Rest, and disturb it by factors of the voltage; the steps of each part."""
        currents(running, 0j, self._steps(_WINDOW))
        for voltage, lasts in segments:
            steps = max(1, self._steps(lasts) // _BLOCKS)
            for _ in range(_BLOCKS):
                running.hold(voltage_rows(running, np.array([voltage])), steps, self._subject.step_size)
                yield steps

    def soon(self, segments: Sequence[Segment]) -> _After:
        """Whether it answers less voltage and frequency at once alike at some times after a disturbance.

        Beside the same run without them, so that it need not have come back."""
        time = np.arange(self._steps(_PROBE)) * self._subject.step_size
        both = 0.985 * np.exp(-2j * pi * 0.05 * time)
        waits = [self._steps(self._draw.uniform(*bounds)) for bounds in _LATER]

        def course(disturbed: Sequence[Segment], wait: int, asked: Complex) -> Complex:
            with self._running() as running:
                for _ in self._disturb(running, disturbed):
                    pass
                seen = followed(running, np.concatenate([np.ones(wait), asked]))
            return seen[wait:] * np.abs(asked) / asked

        words = self._words(segments)
        try:
            plain = course(segments, 0, np.ones(waits[-1] + len(both)))
            begin = course((), 0, np.ones(1))[0]
            usual = course((), 0, both) - begin
            for wait in waits:
                here = plain[wait : wait + len(both)]
                away = float(np.abs(here - begin).max())
                if not away < _NEAR:
                    continue
                apart = float(np.abs(course(segments, wait, both) - here - usual).max() / np.abs(usual).max())
                if apart > _APART + _BENT * away:
                    of = "less voltage and frequency"
                    later = f"{words}, {wait * self._subject.step_size:.2g} s later"
                    return _After(later, _End.BACK, away, apart, of)
        except ComponentError:
            pass  # which 'after' tells
        return _After(words, _End.BACK)

    def after(self, segments: Sequence[Segment]) -> _After:
        """What a disturbance of the voltage by factors leaves behind."""
        words = self._words(segments)
        try:
            with self._subject.while_doing(f"in the {words} and after it"), self._running() as running:
                return self._seen(running, segments, words)
        except ComponentError:
            self._subject.doing = ""
            return _After(words, _End.REFUSED)

    def _seen(self, running: Running, segments: Sequence[Segment], words: str) -> _After:
        sizes = []
        for number, steps in enumerate(self._disturb(running, segments)):
            if number < _BLOCKS:
                sizes.append((self._subject.memory_in_use(), steps))
        kept = max(0.0, min((b - a) / steps for (a, _), (b, steps) in pairwise(sizes)))
        end, away = self._came_back(running, self._rest)
        if end is not _End.BACK:
            return _After(words, end, away, kept=kept)
        begun = running.time
        changed, of = self._apart(self._probed(running), self._usual, away)
        if changed:  # perhaps by the time that has passed
            with self._running() as twin:
                currents(twin, 0j, round(begun / self._subject.step_size))
                usual = self._probed(twin)
            with self._running() as again:
                for _ in self._disturb(again, segments):
                    pass
                currents(again, 0j, round((begun - again.time) / self._subject.step_size))
                changed, of = self._apart(self._probed(again), usual, away)
        return _After(words, end, away, changed, of, kept)

    def _came_back(self, running: Running, rest: complex) -> tuple[_End, float]:
        steps, quiet = self._steps(_WINDOW), 0
        for number in range(_WINDOWS):
            current = currents(running, 0j, steps)
            if not np.isfinite(current).all():
                return _End.REFUSED, np.inf
            away, moves = float(np.abs(current - rest).max()), float(np.abs(current - current[-1]).max())
            if away < _BACK:
                return _End.BACK, away
            quiet = quiet + 1 if moves < _STILL and away > _ELSEWHERE else 0
            if quiet == 3:
                break
            if number == _WINDOWS - 1 or (number >= _GIVEN_UP and away > _LOST):
                return _End.MOVES, away
        size = abs(current[-1])
        if size < _NOTHING:
            return _End.NOTHING, away
        return (_End.HELD if size > _LATCHED * min(1.0, current_limit(self._subject) or 1.0) else _End.ELSEWHERE), away

    def _apart(self, found: list[Complex], usual: list[Complex], away: float) -> tuple[float, str]:
        """By which part of it an answer differs, and to what; 0 where all are alike."""
        names = ("1.5 % less voltage", "a phase jump of 1.5°", "0.1 % less frequency")
        seen = []
        for here, there, size, name in zip(found, usual, self._sizes, names, strict=True):
            apart = float(np.abs(here - there).max()) - 4 * away
            seen.append((apart / max(size, 0.01), name))
        worst = max(seen)
        return worst if worst[0] > _CHANGED else (0.0, "")

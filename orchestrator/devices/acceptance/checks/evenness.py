"""Checks that a converter answers the frequency alike at other operating points, and its switches act alike there."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import pi

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.droop import FREQUENCY
from orchestrator.devices.acceptance.checks.events import scale
from orchestrator.devices.acceptance.checks.port import cannot_import, followed, without_start
from orchestrator.devices.acceptance.checks.settings import Setting, with_each_setting
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Subject
from orchestrator.devices.fmi.port_mapping import BoundDescription

_LASTS = 2.0  # time [s] for which its answer to 0.1 % less frequency is looked at
_SOME = 5e-3  # answer [pu, S_n] from which it is compared
_EVEN = 0.67  # part of an answer by which it may differ elsewhere: a third, or three times as much
_ACTS = 0.5  # part by which what a switch does may differ while it takes power
_MOST = 0.4  # what a switch does beyond that is no small change [pu, S_n]: it connects, or trips
_LATE = 0.05  # swing in the second half of the time that counts, in parts of the answer
_MORE = 5.0  # how many times the swing elsewhere it has to be

_MUCH = 0.9  # power [pu, S_n] from which it is asked for less of it

_ANSWERS = 0.5  # time of an answer along a line [s]
_PARTS = 10  # parts of an answer whose means are compared
_RESTS = 2.0  # time before an answer in which the device comes to rest [s]
# what an answer changes by from one place to the next, in parts of the largest and beyond its slope
_JUMP = 0.08
# the same on the line of frequencies from which no datasheet's droop holds
_BROKEN = 0.4
_MIDDLE = 0.0015  # distance from the rated frequency [pu] of a place that may be on either side
_DRIFTS = 0.03  # movement of the current at another frequency [pu, S_n] that is no rest
# part of the answer in one direction that is left in the other one where it has no power to give
_NOTHING_LEFT = 0.1
_LINES = (
    ("v_0", 0.87, 1.1, 9),
    ("P_0", -0.85, 1.0, 11),
    ("Q_0", -0.55, 0.55, 9),
    ("frequency", -0.008, 0.008, 7),
)
"""What differs along a line of places, from where to where [pu], and at how many."""
_REACH = (
    1.2  # how much farther out the last place of a line may be drawn, and the change from there
)

# how much more of the frequency changes, and where
_LARGER, _MILD = 5, OperatingAt(1.0, 0.0, 0.3, 0.05)
_GIVES, _TAKES = OperatingAt(1.0, 0.0, 0.6, 0.1), OperatingAt(1.0, 0.0, -0.6, 0.1)


def _points(subject: Subject) -> list[OperatingAt]:
    draw = subject.random("evenness")
    wide = (
        (1.07, 1.1, 0.3, 0.6),
        (0.9, 0.93, 0.3, 0.6),
        (1.0, 1.0, 0.75, 0.85),
        (1.0, 1.0, 0.05, 0.2),
        (1.0, 1.0, 0.93, 0.99),
        (1.0, 1.0, -0.99, -0.93),
    )
    more = [
        OperatingAt(*draw.uniform((v, 0.0, P, Q), (w, 0.0, R, Q + 0.1)).round(3))
        for (v, w, P, R), Q in zip(wide, (0.0, 0.0, -0.1, -0.25, 0.0, 0.0), strict=True)
    ]
    return [_GIVES, *(p for p in (_TAKES, *more) if not cannot_import(subject, p))]


@check(
    "evenness",
    "Does it answer alike at other points?",
    needs=(*SAME, "steady_state", "power_balance"),
)
def evenness(subject: Subject) -> CheckResult:
    """The course of its active power after a small change, at several points, and with each of its switches at two."""
    if not subject.starts:
        return without_start("evenness", subject)
    found: dict[OperatingAt, Complex] = {}
    for point in _points(subject):
        try:
            way = -1.0 if point.P > _MUCH else 1.0  # away from its limit
            found[point] = way * _course(subject, point, {}, way)
        except ComponentError:
            if point is _GIVES:
                raise
            continue  # which 'power_balance' and 'operating_points' tell
        fault = _other(found[_GIVES].real, found[point].real, subject.is_machine)
        if fault:
            says = f"{fault[1]} from P_0 = {point.P:g}, Q_0 = {point.Q:g}, v_0 = {point.v:g}"
            return failed("evenness", fault[0], f"{says}, and not from P_0 = {_GIVES.P:g}")
    for larger, word in ((_LARGER, "less"), (-_LARGER, "more")):
        end = (
            np.sign(larger) * _course(subject, _MILD, {}, larger).real[-len(found[_GIVES]) // 10 :]
        )
        if end.mean() < -_SOME and np.ptp(end) < 0.1 * abs(end.mean()):
            says = f"with {100 * _LARGER * FREQUENCY:g} % {word} frequency its active power goes the wrong way, "
            says += f"by {abs(end.mean()):.2g} pu, and not after a smaller change"
            return failed("evenness", "wrong sign", says)
    jump = _jump(subject)
    if jump is not None and jump.breaks_its_droop:
        says = f"{jump}: less is left of its answer to the frequency farther out, or the other way"
        return failed("evenness", "droop of one range", says, jump=jump.beyond)
    if jump is not None:
        return remarked(
            "evenness",
            str(jump),
            "ask what it switches there: what holds at one place does not at the other",
        )
    if _TAKES not in found:
        return passed(
            "evenness",
            f"its answers at {len(found)} points are alike; it was not tried with imported power",
        )
    for (gives, takes), words in with_each_setting(subject, lambda s: _effects(subject, s, found)):
        size, power, one, other = max(
            (max(np.abs(a).max(), np.abs(b).max()), kind, a, b)
            for kind, a, b in (
                ("active", gives.real, takes.real),
                ("reactive", gives.imag, takes.imag),
            )
        )
        if _SOME < size < _MOST and np.abs(one - other).max() > _ACTS * size:
            sizes = " and ".join(f"{np.abs(course).max():.2g} pu" for course in (one, other))
            says = f"after less frequency{words} its {power} power differs by {sizes} while it gives and takes power"
            return failed("evenness", "uneven damping", says)
    return passed(
        "evenness", f"its answers at {len(found)} points, giving and taking power, are alike"
    )


def _course(subject: Subject, point: OperatingAt, setting: Setting, times: float = 1.0) -> Complex:
    """Change of the power [pu, S_n] after each step with less frequency, so many times `FREQUENCY`."""
    h = subject.step_size
    steps = max(2, round(scale(subject, 3 * _LASTS) * _LASTS / h))
    with subject.running(point=point, parameters=setting) as running:
        turned = np.exp(-100j * pi * times * FREQUENCY * h * np.arange(steps))
        power: Complex = point.voltage * turned * followed(running, turned).conj() - complex(
            point.P, point.Q
        )
    return power


@dataclass(frozen=True)
class _Jump:
    """Two neighbours on a line between which the answer to a small change jumps.

    ``beyond``: By which part of the largest answer, beyond the usual slope.
    ``sizes``: Answers at both places [pu, S_n].
    ``moving``: Movement of the current there before the small change [pu, S_n]."""

    line: str
    places: tuple[float, float]
    beyond: float
    sizes: tuple[float, float]
    moving: float

    def __str__(self) -> str:
        ends = f"{self.line} = {self.places[0]:.3g} and {self.places[1]:.3g}"
        return f"its answer to a small change jumps by {100 * self.beyond:.2g} % between {ends}"

    @property
    def breaks_its_droop(self) -> bool:
        """Tell if a part of its droop is gone away from the rated frequency, which no datasheet's droop has.

        A dead band is the other way round; what has no power left in one direction gives nothing there."""
        if self.line != "frequency" or self.beyond < _BROKEN:
            return False
        by_distance = sorted(zip(map(abs, self.places), self.sizes, strict=True))
        (_, inner), (_, outer) = by_distance
        if self.moving > _DRIFTS:
            return True  # its own frequency stays behind
        one_sided = self.places[0] * self.places[1] < 0 or min(map(abs, self.places)) < _MIDDLE
        if one_sided:
            return min(self.sizes) > _NOTHING_LEFT * max(self.sizes)
        return outer < inner


def _jump(subject: Subject) -> _Jump | None:
    """Find where its answer to a small change is another one from one place to the next; None where it is nowhere."""
    draw, times = subject.random("lines"), scale(subject, 30 * _ANSWERS)
    for name, least, most, number in _lines(subject):
        at = np.linspace(least, most, number) + draw.uniform(-0.25, 0.25, number) * (
            most - least
        ) / (number - 1)
        places, answers, moves = [], [], list[float]()
        for place in at:
            v, P, Q = (
                place if name == n else usual
                for n, usual in (("v_0", 1.0), ("P_0", 0.3), ("Q_0", 0.05))
            )
            with suppress(ComponentError):  # which 'operating_points' tells
                offset = place if name == "frequency" else 0.0
                answer, moving = _small(subject, OperatingAt(v, 0, P, Q), offset, times)
                answers.append(answer)
                moves.append(moving)
                places.append(place)
        if len(places) < 4:
            continue
        size, gaps = np.abs(answers).max(initial=_SOME), np.diff(places)
        slopes = np.diff(answers, axis=0) / gaps[:, None] / size
        usual = (np.vstack([slopes[1], slopes[:-1]]) + np.vstack([slopes[1:], slopes[-2]])) / 2
        k = int(
            np.argmax(
                np.abs(slopes).max(axis=1)
                * gaps
                * (np.abs(slopes - usual).max(axis=1) * gaps > _JUMP)
            )
        )
        beyond = np.abs(slopes[k] - usual[k]).max() * gaps[k]
        if beyond > _JUMP:
            ends = (float(places[k]), float(places[k + 1]))
            sizes = (float(np.abs(answers[k]).max()), float(np.abs(answers[k + 1]).max()))
            return _Jump(name, ends, float(beyond), sizes, max(moves[k : k + 2]))
    return None


def _lines(subject: Subject) -> Iterator[tuple[str, float, float, int]]:
    """The lines, that of frequencies as far as the binding says that it answers them."""
    described = subject.description
    declared = described.port.frequency_range if isinstance(described, BoundDescription) else None
    for name, least, most, number in _LINES:
        if name != "frequency" or declared is None:
            yield name, least, most, number
            continue
        reach = min(most, max(0.2 * declared, (declared - FREQUENCY) / _REACH))
        yield name, -reach, reach, number


def _small(
    subject: Subject, point: OperatingAt, offset: float, times: float
) -> tuple[Numbers, float]:
    """Change of the current in its voltage's frame after a little less voltage and more frequency, as means.

    Beside it the movement of that current before [pu, S_n], over a twentieth of the time at rest."""
    h = subject.step_size
    before, steps = (
        max(_PARTS, round(times * lasts / h)) for lasts in (_RESTS if offset else h, _ANSWERS)
    )
    time = h * np.arange(1, before + steps + 1)
    more = np.maximum(0.0, time - time[before - 1])
    turned = np.where(more > 0, 0.99, 1.0) * np.exp(100j * pi * (offset * time + FREQUENCY * more))
    with subject.running(point=point) as running:
        seen = followed(running, turned) * np.abs(turned) / turned
    means = np.array(
        [part.mean() for part in np.array_split(seen[before:] - seen[before - 1], _PARTS)]
    )
    still = seen[before - max(1, before // 20) - 1 : before]
    return np.concatenate([means.real, means.imag]), float(np.abs(still - seen[before - 1]).max())


def _effects(
    subject: Subject, setting: Setting, found: dict[OperatingAt, Complex]
) -> tuple[Complex, Complex]:
    gives, takes = (
        _course(subject, p, setting) - found[p] if setting else 0 * found[p]
        for p in (_GIVES, _TAKES)
    )
    return gives, takes


def _other(usual: Numbers, here: Numbers, machine: bool) -> tuple[str, str] | None:
    """The fault where an answer is another one than the usual, and what shows it.

    A machine's field, and with it the damping of its swing, follows its operating point."""
    size = max(np.abs(usual).max(), np.abs(here).max())
    if not np.isfinite(size) or size < _SOME:
        return None
    late, before = np.ptp(here[len(here) // 2 :]), np.ptp(usual[len(usual) // 2 :])
    if (
        not machine
        and max(late, before) > _LATE * size
        and max(late, before) > _MORE * min(late, before)
    ):
        return (
            "uneven damping",
            f"its power still moves by {late:.2g} pu, not {before:.2g} pu, after a small change",
        )
    if np.abs(here - usual).max() > _EVEN * size:
        return (
            "uneven droop",
            f"its active power answers the frequency by {np.abs(here).max():.2g} pu",
        )
    return None

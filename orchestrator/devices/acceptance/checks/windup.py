"""The check if an integral part winds up where the current limit holds it, in short and long events."""

from dataclasses import dataclass

import numpy as np

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
from orchestrator.devices.acceptance.checks.events import in_words, scale
from orchestrator.devices.acceptance.checks.port import (
    cannot_import,
    current_limit,
    currents,
    without_start,
)
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Subject

_SHORT = 0.6  # duration of an event [s] in which a filter has come to rest, and most angles
_LONG = 1.8  # duration of a long one [s]
_BETWEEN = 1.2  # of one half way, in which a droop's angle has come to rest as well
_WINDOW = 0.1  # time from one look at the current to the next [s]
_WINDOWS = 200  # looks, at most, until the device has come to rest
_QUIET = 3  # looks in a row in which it is at rest
_RESTS = 3e-3  # distance of the current from where it was [pu, S_n] at which it is at rest

_MORE = 0.3
"""Part of what a short event leaves behind by which a long one may leave more.

Matching control, virtual machines, oscillators and droops with anti-windup have at most 0.2, without it 1.2 to 1.8."""

_GOES_ON = 0.25
"""Part of what a long event leaves more than a short one that comes in the second half of their difference.

An integral at the limit goes on evenly and has half of it there; a droop's angle that had not come to rest in the short
event has at most 0.04."""

_LEAST = 0.06  # what the long one leaves more [pu·s, S_n] from which it is judged

_AT_MOST = 5.0
"""The same, as a factor, above which it is no wind-up.

What integrates at the limit goes with the time there, three times; an angle is lost of a sudden."""

_PLACES = (
    ((0.02, 0.1), (0.15, 0.25), (0.38, 0.5)),
    ((-0.06, -0.01), (-0.6, -0.5), (1.27, 1.3)),
    ((0.25, 0.32), (-0.02, 0.05), (0.4, 0.5)),
    ((-0.25, -0.15), (-0.6, -0.5), (1.26, 1.3)),
)
"""Bounds of the active power, the reactive power and the voltage in the event [pu], between which they are drawn.

A resistance gives power in a dip and takes some in an overvoltage: with power that way, and half of the limit to
carry it, a converter keeps its angle, also one that gives its reactive current priority."""


@dataclass(frozen=True)
class _Left:
    """The rest of an event: the distance of the current from where it was, summed over time [pu·s]."""

    away: float
    rests: bool


@check(
    "anti_windup",
    "Is it back as soon after a long time at its current limit as after a short one?",
    needs=(*SAME, "steady_state", "power_balance"),
)
def anti_windup(subject: Subject) -> CheckResult:
    """Hold it at its limit by dips and overvoltages in which it can keep its power, and watch until it rests."""
    if not subject.starts:
        return without_start("anti_windup", subject)
    if subject.is_machine and current_limit(subject) is None:
        return not_applicable("anti_windup", "because nothing limits a machine's current")
    draw = subject.random("anti-windup")
    compared = 0
    unknown = list[str]()
    times = scale(subject, _LONG + 0.5)
    for powers, reactive, voltages in _PLACES:
        point = OperatingAt(
            1.0, 0.0, round(draw.uniform(*powers), 3), round(draw.uniform(*reactive), 3)
        )
        voltage = round(draw.uniform(*voltages), 3)
        if point.P < 0 and cannot_import(subject, point):
            continue
        words = f"{in_words(complex(voltage))} from P_0 = {point.P:g}, Q_0 = {point.Q:g}"
        try:
            with subject.while_doing(f"in the {words} and after it"):
                short, between, long = (
                    _watch(subject, point, voltage, times * lasts)
                    for lasts in (_SHORT, _BETWEEN, _LONG)
                )
        except ComponentError as error:
            subject.doing = ""
            unknown.append(f"{error.log or error.status} in the {words}")
            continue
        if _winds_up(short, between, long):
            says = f"the {words} leaves {long.away:.3g} pu·s of its current behind after {times * _LONG:.3g} s, "
            says += f"{between.away:.3g} after {times * _BETWEEN:.3g} s "
            says += f"and {short.away:.3g} after {times * _SHORT:.3g} s: it goes on with the time at the limit"
            figures = {"long": long.away, "between": between.away, "short": short.away}
            return failed("anti_windup", "winds up", says, **figures)
        if not (short.rests and long.rests):
            unknown.append(f"it does not come to rest after the {words}")
            continue
        if long.away - short.away > max(_LEAST, short.away):
            unknown.append(f"it leaves its angle in the {words}")
            continue
        compared += 1
    return _summary(compared, unknown, ends="ended_at" in subject.memory)


def _summary(compared: int, unknown: list[str], *, ends: bool) -> CheckResult:
    """Tell what was compared; nothing is a reason not to accept it, unless it ends its simulation by itself."""
    if not compared:
        reason = "whether it winds up at its limit"
        return remarked(
            "anti_windup",
            f"not judged: {'; '.join(unknown[:2]) or 'no event could be tried'}",
            "ask what holds its integral parts while its current is limited",
            not_judged=reason,
            reason=not ends,
        )
    says = f"after {compared} dips and overvoltages, short and long, it is back alike"
    says += f"; not judged: {unknown[0]}" if unknown else ""
    return passed("anti_windup", says, compared=compared)


def _winds_up(short: _Left, between: _Left, long: _Left) -> bool:
    """Tell if what is left goes on with the time at the limit: evenly, or, where it turns the angle, back and forth."""
    more, later = long.away - short.away, long.away - between.away
    grows = max(_LEAST, _MORE * short.away) < more < _AT_MOST * short.away
    least = min(between.away, long.away)
    differs = max(_LEAST, _MORE * least) < abs(later) < _AT_MOST * least
    return (grows and later > _GOES_ON * more) or (differs and between.rests and long.rests)


def _watch(subject: Subject, point: OperatingAt, voltage: float, lasts: float) -> _Left:
    """Hold the voltage for some seconds, and sum up the distance of the current until the device rests."""
    h = subject.step_size
    window = max(2, round(_WINDOW / h))
    away = 0.0
    quiet = 0
    with subject.running(point=point) as running:
        rest = currents(running, 0j, 2)[-1]
        currents(running, (voltage - 1) * point.voltage, max(2, round(lasts / h)))
        for _ in range(_WINDOWS):
            far = np.abs(currents(running, 0j, window) - rest)
            away += float(far.sum()) * h
            quiet = quiet + 1 if far.max() < _RESTS else 0
            if quiet == _QUIET:
                return _Left(away, True)
    return _Left(away, False)

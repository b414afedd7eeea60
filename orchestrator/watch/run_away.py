"""Speeds and voltages that run away: they leave their operating point without swinging and do not come to rest."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.arrays import Numbers
from orchestrator.coupling.system import System
from orchestrator.watch.finding import Finding
from orchestrator.watch.seen import Seen, unit
from orchestrator.watch.settings import Settings
from orchestrator.watch.stretches import Stretch

SPEED = "omega"
"""Output with a unit's speed or frequency."""

BAND = (0.9, 1.1)
"""Band of a speed, as parts of its start. Protection trips machines well inside this band (0.95 to 1.03 for minutes,
IEEE C37.106)."""

OUTSIDE = 1.0
"""A speed is reported if it is outside of its band for longer than this in all [s], or at the end. A deep dip may push
it there for a short time."""

LONG = 10.0
"""Shortest stretch in which a drift is reported [s]: in a shorter one a turbine's control may still be acting."""

STRAIGHT = 0.9
"""A settling signal slows down. A drift keeps this part of its rate from the third to the last quarter of the stretch.
A decay to rest would need a time constant of more than twice the stretch's length to do the same.
"""

LEAST_SPEED = 5e-4
"""Smallest drift of a speed in half of the stretch, as a part of its start: more than the dead band of a primary
control (20 mHz)."""

LEAST_VOLTAGE = 0.01
"""Smallest drift of a voltage in half of the stretch, as a part of 1 or of the start: one step of a tap changer."""

SMOOTH = 0.15
"""The swing around a drift, as root mean square, must be less than this part of the drift."""

_RATE_TIME = 1.0
"""The reported rate is the mean over this time at the end [s]."""


@dataclass(frozen=True)
class _Course:
    """A signal that should come to rest after an event. ``on`` marks the looks that count; ``least`` is the smallest
    drift [unit of the signal].
    """

    name: str
    what: str
    signal: Numbers
    on: NDArray[np.bool_]
    least: float


def speed_signals(system: System) -> list[str]:
    """Signals that show every unit's speed."""
    return [f"{name}.{SPEED}" for name, plan in system.components.items() if SPEED in plan.description.outputs]


def run_away(
    seen: Seen, system: System, settings: Settings, stretches: Sequence[Stretch], *, slipped: bool
) -> Iterator[Finding]:
    """At most one speed outside of its band or drifting, and one drifting voltage: those that go farthest.

    Parameters
    ----------
    seen
        What was seen of the run.
    system
        What ran.
    settings
        The parameters' values over the run.
    stretches
        The parts of the run between its events.
    slipped
        Whether units lost synchronism. In this case a speed must be outside of its band at the end to be reported.
    """
    speeds = list(_speeds(seen, system, settings))
    yield from _farthest(seen.times, speeds, stretches, system, allowed=np.inf if slipped else OUTSIDE)
    yield from _farthest(seen.times, list(_voltages(seen)), stretches, system, allowed=None)


def _speeds(seen: Seen, system: System, settings: Settings) -> Iterator[_Course]:
    for name in speed_signals(system):
        signal = seen.values.get(name, seen.last.get(name))
        if signal is not None and np.isfinite(signal).all() and signal[0] > 0:
            on = settings.connected(name.partition(".")[0]) > 0
            yield _Course(name, "speed", signal, on, LEAST_SPEED * float(signal[0]))


def _voltages(seen: Seen) -> Iterator[_Course]:
    """Magnitudes of all voltages that are coupled."""
    for name, real in seen.last.items():
        imaginary = seen.last.get(f"{name[:-3]}_im")
        if name.endswith("v_re") and imaginary is not None:
            signal = np.hypot(real, imaginary)
            if np.isfinite(signal).all():
                least = LEAST_VOLTAGE * max(1.0, float(signal[0]))
                yield _Course(name, "voltage", signal, np.ones(len(signal), dtype=bool), least)


def _farthest(
    times: Numbers, courses: Sequence[_Course], stretches: Sequence[Stretch], system: System, allowed: float | None
) -> Iterator[Finding]:
    found = []
    for course in courses:
        drifting = next((s for s in stretches if _drifts(times, course, s)), None)
        outside = _outside(times, course, allowed) if allowed is not None else None
        if drifting is not None or outside is not None:
            far = float(np.abs(course.signal - course.signal[0])[course.on].max()) / course.least
            found.append((far, course, drifting, outside))
    if found:
        _, course, drifting, outside = max(found, key=lambda f: f[0])
        yield _finding(times, course, drifting, outside, unit(course.name, system), len(found) - 1)


def _outside(times: Numbers, course: _Course, allowed: float) -> float | None:
    """Time at which a speed leaves its band [s]; None unless it stays outside for longer than allowed or at the end."""
    part = course.signal / course.signal[0]
    outside = course.on & ((part < BAND[0]) | (part > BAND[1]))
    if not outside[-1] and outside.sum() * float(times[1] - times[0]) <= allowed:
        return None
    return float(times[int(np.argmax(outside))])


def _drifts(times: Numbers, course: _Course, stretch: Stretch) -> bool:
    """Whether a signal moves on and away at a rate that does not fall, on the grid, to the end of a stretch."""
    first, last = (int(row) for row in np.searchsorted(times, (stretch.begin, stretch.end)))
    middle, last = (first + last) // 2, min(last, len(times) - 1)
    t, y = times[middle : last + 1], course.signal[middle : last + 1]
    if stretch.end - stretch.begin < LONG or not course.on[middle + 1 : last + 1].all():
        return False
    start = course.signal[first]
    if abs(y[-1] - y[0]) < (1 - SMOOTH) * course.least or abs(y[-1] - start) < abs(y[0] - start):
        return False
    third, fourth = (_rate(*quarter) for quarter in zip(np.array_split(t, 2), np.array_split(y, 2), strict=True))
    drift = (third + fourth) / 2 * float(t[-1] - t[0])
    bent = np.polyval(np.polyfit(t - t[0], y, 2), t - t[0])
    return (
        abs(drift) >= course.least
        and third * fourth > 0
        and abs(fourth) >= STRAIGHT * abs(third)
        and float(np.std(y - bent)) < SMOOTH * abs(drift)
    )


def _rate(times: Numbers, signal: Numbers) -> float:
    return float(np.polyfit(times - times[0], signal, 1)[0])


def _finding(
    times: Numbers, course: _Course, stretch: Stretch | None, outside: float | None, unit: str, others: int
) -> Finding:
    begin, last = (stretch.begin, stretch.last) if stretch is not None else (outside or 0.0, True)
    row = len(times) - 1 if stretch is None or last else int(np.searchsorted(times, stretch.end))
    row = int(np.flatnonzero(course.on[: row + 1])[-1])  # its last look on the grid
    late = slice(int(np.searchsorted(times, times[row] - _RATE_TIME)), row + 1)
    value = float(course.signal[row])
    rate = _rate(times[late], course.signal[late]) if row - late.start > 1 else 0.0
    left = f"; it leaves {BAND[0]:g} to {BAND[1]:g} of its start at t = {outside:.4g} s" if outside is not None else ""
    well = f"; so {'does' if others == 1 else 'do'} {others} more" if others else ""
    message = (
        f"the {course.what} runs away from t = {begin:.4g} s on: {_shown(course.name)} is {value:.4g} {unit} at "
        f"t = {times[row]:.4g} s and moves at {rate:+.3g} {unit}/s{left}{well}"
    )
    component, _, variable = course.name.partition(".")
    figures = {"value": value, "rate": rate}
    return Finding("run_away", begin, component, variable, message, None if last else float(times[row]), figures)


def _shown(name: str) -> str:
    return f"|{name[:-3]}|" if name.endswith("_re") else name

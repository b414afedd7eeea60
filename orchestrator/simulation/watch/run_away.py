"""Speeds and voltages that run away: they leave their operating point without swinging and do not come to rest."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers
from orchestrator.simulation.watch.finding import (
    EXCURSION,
    NOT_JUDGED,
    Finding,
    go_on_to,
    rounded_up,
)
from orchestrator.simulation.watch.seen import Seen, shown_name, unit
from orchestrator.simulation.watch.settings import Settings
from orchestrator.simulation.watch.stretches import Stretch
from orchestrator.systems.coupling.system import System

SPEED = "omega"  # output with a unit's speed or frequency
ALLOWED = (0.95, 1.03)
"""Band of a frequency, as parts of the rated one: 47.5 to 51.5 Hz, outside of which generators of the continental
synchronous area need not stay connected (Regulation (EU) 2016/631, article 13, table 2), and 57 to 61.8 Hz, the widest
instantaneous trips of the Western, the Eastern and the Texas Interconnection (NERC PRC-024, attachment 1). Great
Britain and Ireland have 52 Hz for minutes, and Québec 55.5 to 66 Hz."""

# of the speed of a unit out of synchronism, as parts of its start: it is no frequency of the grid
BAND = (0.9, 1.1)

OUTSIDE = 1.0
"""A frequency is reported if it is outside of its band for longer than this in all [s]. A deep dip may push a rotor
there for a short time."""

BACK = 1.0
"""Time at a run's end [s] that a frequency is inside of its band without a break to be back: as long as it may be
outside."""

# the same for a frequency outside without a break until the end [s]; none outside of `BAND`
OUTSIDE_AT_END = 0.2

LEAST_AWAY = 0.004
"""A frequency that moves away is told in a short stretch from this distance from the rated one on, as a part of it:
200 mHz of 50 Hz, the largest steady deviation in continental Europe (Regulation (EU) 2017/1485, annex III)."""

SHORTEST = 1.0  # shortest stretch at a run's end in which a frequency that moves away is told [s]
LONG = 10.0
"""Shortest stretch in which a drift is a fault [s]: in a shorter one a turbine's control may still act, so that only a
remark is made."""

STRAIGHT = 0.9
"""A settling signal slows down. A drift keeps this part of its rate from the third to the last quarter of the stretch.
A decay to rest would need a time constant of more than twice the stretch's length to do the same.
"""

LEAST_SPEED = 5e-4
"""Smallest drift of a speed in half of the stretch, as a part of its start: more than the dead band of a primary
control (20 mHz)."""

# least drift of a voltage in half of the stretch, of 1 or of the start: a tap changer's step
LEAST_VOLTAGE = 0.01
# the swing around a drift, as root mean square, must be less than this part of the drift
SMOOTH = 0.15
# part of the ratings on the grid from which governors at their limits leave a frequency without a
# hold
HELD = 0.5
_RATE_TIME = 1.0  # the reported rate is the mean over this time at the end [s]


@dataclass(frozen=True)
class _Course:
    """A signal that should come to rest after an event. ``on`` marks the looks that count; ``least`` is the smallest
    drift [unit of the signal]."""

    name: str
    what: str
    signal: Numbers
    on: NDArray[np.bool_]
    least: float


@dataclass(frozen=True)
class _Drift:
    """How a signal moves in the second half of a stretch: its rates in the third and the last quarter [unit/s], the
    time between the middles of these [s], and its value at the end."""

    third: float
    fourth: float
    apart: float
    value: float

    @property
    def straight(self) -> bool:
        return abs(self.fourth) >= STRAIGHT * abs(self.third)

    @property
    def time_constant(self) -> float:
        """Time constant of the exponential with these two rates [s]; infinite if it does not slow down."""
        return (
            self.apart / float(np.log(self.third / self.fourth))
            if abs(self.fourth) < abs(self.third)
            else np.inf
        )

    @property
    def rest(self) -> float:
        """Value at which an exponential with these two rates comes to rest."""
        slowing = self.fourth / self.third
        return (
            self.value + self.fourth * slowing**0.5 * self.time_constant
            if slowing < 1
            else np.inf * self.fourth
        )

    @property
    def near(self) -> bool:
        """Tell if less of its way lies before it than it made in the second half of the stretch: else its rest is a
        guess."""
        return abs(self.rest - self.value) < abs(self.third + self.fourth) * self.apart


def speed_signals(system: System) -> list[str]:
    return [
        f"{name}.{SPEED}"
        for name, plan in system.components.items()
        if SPEED in plan.description.outputs
    ]


def run_away(
    seen: Seen, system: System, settings: Settings, stretches: Sequence[Stretch], *, slipped: bool
) -> Iterator[Finding]:
    """At most one speed outside of its band or drifting, and one drifting voltage: those that go farthest.

    A speed that was outside and came back does not run away: it had an excursion.

    ``slipped``: whether units lost synchronism. In this case a speed must be outside of `BAND` at the end to be
    reported."""
    speeds = list(_speeds(seen, system, settings))
    yield from _farthest(
        seen.times, speeds, stretches, system, allowed=np.inf if slipped else OUTSIDE
    )
    yield from _farthest(seen.times, list(_voltages(seen)), stretches, system, allowed=None)


def _speeds(seen: Seen, system: System, settings: Settings) -> Iterator[_Course]:
    for name in speed_signals(system):
        signal = seen.values.get(name, seen.last.get(name))
        if signal is not None and np.isfinite(signal).all() and signal[0] > 0:
            on = settings.connected(name.partition(".")[0]) > 0
            yield _Course(name, "speed", signal, on, LEAST_SPEED * float(signal[0]))


def _voltages(seen: Seen) -> Iterator[_Course]:
    for name, real in seen.last.items():
        imaginary = seen.last.get(f"{name[:-3]}_im")
        if name.endswith("v_re") and imaginary is not None:
            signal = np.hypot(real, imaginary)
            if np.isfinite(signal).all():
                least = LEAST_VOLTAGE * max(1.0, float(signal[0]))
                yield _Course(name, "voltage", signal, np.ones(len(signal), dtype=bool), least)


def _farthest(
    times: Numbers,
    courses: Sequence[_Course],
    stretches: Sequence[Stretch],
    system: System,
    allowed: float | None,
) -> Iterator[Finding]:
    found = []
    for course in courses:
        drifting = next((s for s in stretches if _drifts(times, course, s)), None)
        outside = _outside(times, course, allowed) if allowed is not None else None
        if drifting is not None or outside is not None:
            far = float(np.abs(course.signal - course.signal[0])[course.on].max()) / course.least
            found.append((far, course, drifting, outside))
    away = [f for f in found if f[2] is not None or not _is_inside_at_end(times, f[1])]
    if away:
        _, course, drifting, outside = max(away, key=lambda f: f[0])
        yield _finding(times, course, drifting, outside, unit(course.name, system), len(away) - 1)
    elif found:
        _, course, _, _ = max(found, key=lambda f: f[0])
        yield _excursion(times, course, len(found) - 1)


def _beyond_allowed(course: _Course) -> NDArray[np.bool_]:
    """The looks at which a unit on the grid has a speed outside of `ALLOWED`."""
    return course.on & _beyond(course.signal / _rated(course.signal), ALLOWED)


def _last_look(course: _Course) -> int:
    """Row of a unit's last look on the grid."""
    return int(np.flatnonzero(course.on)[-1])


def _is_inside_at_end(times: Numbers, course: _Course) -> bool:
    """Tell whether a speed is inside of its band for the last looks on the grid, so that none swings through it."""
    last = _last_look(course)
    late = (times > times[last] - OUTSIDE_AT_END) & (times <= times[last])
    return not _beyond_allowed(course)[late].any()


def _leaves_again(times: Numbers, course: _Course) -> bool:
    """Tell whether a speed moves away from the rated one to the end, by more than a steady deviation."""
    last = _last_look(course)
    before = int(np.searchsorted(times, times[last] - BACK))
    rated = _rated(course.signal)
    then, now = (abs(course.signal[row] / rated - 1) for row in (before, last))
    return bool(now - then > LEAST_AWAY)


def _excursion(times: Numbers, course: _Course, others: int) -> Finding:
    """A speed that came back; one that did so just before the end, or leaves again, is not judged."""
    outside, last = np.flatnonzero(_beyond_allowed(course)), _last_look(course)
    begin, back = float(times[outside[0]]), float(times[outside[-1] + 1])
    distance = np.abs(course.signal[outside] - _rated(course.signal))
    farthest = outside[int(distance.argmax())]
    value, lasts = float(course.signal[farthest]), len(outside) * float(times[1] - times[0])
    do = "does" if others == 1 else "do"
    also = f", as {do} {others} more" if others else ""
    message = (
        f"{course.name} leaves {ALLOWED[0]:g} to {ALLOWED[1]:g} pu at t = {begin:.4g} s{also}, goes as far as "
        f"{value:.4g} pu at t = {times[farthest]:.4g} s, and is back from t = {back:.4g} s on, after {lasts:.3g} s "
        f"outside in all; it is {course.signal[last]:.4g} pu at t = {times[last]:.4g} s"
    )
    enough = 0.0
    if last == len(times) - 1:
        leaves = _leaves_again(times, course)
        message += " and moves away again" if leaves else ""
        enough = float(times[last]) + LONG if leaves else back + BACK
    is_back = enough <= times[last]
    enough = rounded_up(enough)
    if not is_back:
        message = f"whether the frequency settles is not judged: {message}; {go_on_to(enough)}"
    component, _, variable = course.name.partition(".")
    return Finding(
        EXCURSION if is_back else NOT_JUDGED,
        begin,
        component=component,
        variable=variable,
        message=message,
        until=back,
        figures={"value": value, "outside_s": lasts},
        enough=None if is_back else enough,
    )


def _outside(times: Numbers, course: _Course, allowed: float) -> float | None:
    far = course.on & _beyond(course.signal / course.signal[0], BAND)
    if np.isinf(allowed):  # it slips
        return float(times[int(np.argmax(far))]) if far[-1] else None
    outside = _beyond_allowed(course)
    interval = float(times[1] - times[0])
    at_end = len(outside) if outside.all() else int(np.argmin(outside[::-1]))
    if not far[-1] and at_end * interval < OUTSIDE_AT_END and outside.sum() * interval <= allowed:
        return None
    return float(times[int(np.argmax(outside))])


def _rated(signal: Numbers) -> float:
    return 1.0 if BAND[0] < signal[0] < BAND[1] else float(signal[0])


def _beyond(signal: Numbers, band: tuple[float, float]) -> NDArray[np.bool_]:
    beyond: NDArray[np.bool_] = (signal < band[0]) | (signal > band[1])
    return beyond


def still_moving_away(
    seen: Seen, system: System, settings: Settings, last: Stretch, limits: Sequence[Finding] = ()
) -> list[Finding]:
    """A remark on a frequency that moves away at the end, so that nobody can tell whether a control stops it.

    It is the mean of the units' speeds, weighted by their ratings, in which their swings against each other cancel.
    Nothing is remarked if its last rates lead to a near rest inside of `ALLOWED`, or, where governors of `HELD` of the
    ratings are at their limits, within `LEAST_AWAY`.

    ``limits``: the findings on limits; those of governors that act at the end count."""
    speeds = list(_speeds(seen, system, settings))
    if not speeds or last.end - last.begin < SHORTEST:
        return []
    weights = np.array([_rating(system, course.name) * course.on for course in speeds])
    total = weights.sum(axis=0)
    if not (total > 0).all():
        return []
    mean = (weights * np.array([course.signal / _rated(course.signal) for course in speeds])).sum(
        axis=0
    ) / total
    largest = speeds[int(weights[:, -1].argmax())]
    course = _Course(largest.name, "frequency", mean, total > 0, LEAST_SPEED)
    drift = _drift(seen.times, course, last, shortest=SHORTEST)
    if drift is None or abs(mean[-1] - 1) < LEAST_AWAY:
        return []
    held = _at_their_limits(speeds, weights[:, -1] / total[-1], limits)
    band = (1 - LEAST_AWAY, 1 + LEAST_AWAY) if held else ALLOWED
    if drift.near and band[0] <= drift.rest <= band[1]:
        return []
    late = seen.times >= max(last.end - _RATE_TIME, (last.begin + last.end) / 2)
    rate = _rate(seen.times[late], mean[late])
    enough = last.begin + LONG
    how = f"without slowing down since t = {(last.begin + last.end) / 2:.4g} s"
    if not drift.straight:
        how = f"slowing down as if to come to rest at {drift.rest:.3g} pu"
        enough = max(enough, last.end + drift.time_constant)
    elif enough <= last.end:
        enough = last.end + LONG
    enough = rounded_up(enough)
    how += f", with {' and '.join(held)} at the limit of the governor" if held else ""
    message = (
        f"whether the frequency settles is not judged: the mean of all speeds is {mean[-1]:.4g} pu at "
        f"t = {last.end:.4g} s and moves away at {rate:+.3g} pu/s, {how}; {go_on_to(enough)}"
    )
    component, _, variable = largest.name.partition(".")
    figures = {"value": float(mean[-1]), "rate": rate}
    return [
        Finding(
            "not_judged",
            last.begin,
            component=component,
            variable=variable,
            message=message,
            until=None,
            figures=figures,
            enough=enough,
        )
    ]


def _at_their_limits(
    speeds: Sequence[_Course], shares: Numbers, limits: Sequence[Finding]
) -> list[str]:
    """Units whose governors are at a limit at the end; none if they have less than `HELD` of the ratings."""
    acting = {
        f.component
        for f in limits
        if f.kind == "active_limit" and f.until is None and "governor." in f.variable
    }
    units = {
        course.name.partition(".")[0]: float(share)
        for course, share in zip(speeds, shares, strict=True)
    }
    held = [name for name in units if name in acting]
    return held if sum(units[name] for name in held) >= HELD else []


def _rating(system: System, name: str) -> float:
    plan = system.components[name.partition(".")[0]]
    return plan.number("S_n") if "S_n" in plan.description.variables else 1.0


def _drifts(times: Numbers, course: _Course, stretch: Stretch) -> bool:
    drift = _drift(times, course, stretch, shortest=LONG)
    return drift is not None and drift.straight


def _drift(times: Numbers, course: _Course, stretch: Stretch, shortest: float) -> _Drift | None:
    """How a signal moves on and away, on the grid, to the end of a stretch; None if it does not."""
    first, last = (int(row) for row in np.searchsorted(times, (stretch.begin, stretch.end)))
    middle, last = (first + last) // 2, min(last, len(times) - 1)
    t, y = times[middle : last + 1], course.signal[middle : last + 1]
    if stretch.end - stretch.begin < shortest or not course.on[middle + 1 : last + 1].all():
        return None
    start = course.signal[first]
    if abs(y[-1] - y[0]) < (1 - SMOOTH) * course.least or abs(y[-1] - start) < abs(y[0] - start):
        return None
    third, fourth = (
        _rate(*quarter) for quarter in zip(np.array_split(t, 2), np.array_split(y, 2), strict=True)
    )
    length = float(t[-1] - t[0])
    drift = (third + fourth) / 2 * length
    bent = np.polyval(np.polyfit(t - t[0], y, 2), t - t[0])
    if (
        abs(drift) < course.least
        or third * fourth <= 0
        or float(np.std(y - bent)) >= SMOOTH * abs(drift)
    ):
        return None
    return _Drift(third, fourth, length / 2, float(y[-1]))


def _rate(times: Numbers, signal: Numbers) -> float:
    return float(np.polyfit(times - times[0], signal, 1)[0])


def _finding(
    times: Numbers,
    course: _Course,
    stretch: Stretch | None,
    outside: float | None,
    unit: str,
    others: int,
) -> Finding:
    begin, last = (stretch.begin, stretch.last) if stretch is not None else (outside or 0.0, True)
    row = len(times) - 1 if stretch is None or last else int(np.searchsorted(times, stretch.end))
    row = int(np.flatnonzero(course.on[: row + 1])[-1])  # its last look on the grid
    late = slice(int(np.searchsorted(times, times[row] - _RATE_TIME)), row + 1)
    value = float(course.signal[row])
    rate = _rate(times[late], course.signal[late]) if row - late.start > 1 else 0.0
    left = (
        f"; it leaves {ALLOWED[0]:g} to {ALLOWED[1]:g} pu at t = {outside:.4g} s"
        if outside is not None
        else ""
    )
    do = "does" if others == 1 else "do"
    well = f"; so {do} {others} more" if others else ""
    message = (
        f"the {course.what} runs away from t = {begin:.4g} s on: {shown_name(course.name)} is {value:.4g} {unit} at "
        f"t = {times[row]:.4g} s and moves at {rate:+.3g} {unit}/s{left}{well}"
    )
    component, _, variable = course.name.partition(".")
    figures = {"value": value, "rate": rate}
    return Finding(
        "run_away",
        begin,
        component=component,
        variable=variable,
        message=message,
        until=None if last else float(times[row]),
        figures=figures,
    )

"""The time-domain criterion of the norm: the part of an oscillation that is left after four periods.

Maxima P1, P2, … of the signal are joined by straight lines; ΔPkMk is the vertical distance from the minimum Mk between
Pk and Pk+1 to the line through these two. Accepted is ΔP5M5 < 0.25·ΔP1M1. For a single mode that asks for 5.5 %
of damping, since e^(−2π·4·ζ/√(1 − ζ²)) = 0.25 at ζ = 0.0551."""

from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers

LARGEST_RATIO = 0.25  # ΔP5M5 over ΔP1M1 must be less than this
JUDGED_SWING = 5

# a turn of the signal counts if it moves back by more than this part of its range after the event
RESOLUTION = 1e-3

SLOWEST_PERIOD = 10.0
"""Longest period of a judged mode [s]. If the signal does not turn for this time, no judged mode is left above the
resolution."""


# parts of a signal above this [Hz] are removed before it is judged: over three times the fastest
# mode
FASTEST = 5.0


@dataclass(frozen=True, slots=True)
class Extremum:
    """A turning point [s, unit of the signal]."""

    time: float
    value: float
    is_maximum: bool


@dataclass(frozen=True, slots=True)
class RecordedSwing:
    """Number k with its two maxima, the minimum between them, and ΔPkMk [unit of the signal]."""

    number: int
    before: Extremum
    minimum: Extremum
    after: Extremum

    @property
    def line(self) -> float:
        """Value at the minimum's time of the straight line from one maximum to the next."""
        share = (self.minimum.time - self.before.time) / (self.after.time - self.before.time)
        return self.before.value + share * (self.after.value - self.before.value)

    @property
    def depth(self) -> float:
        return self.line - self.minimum.value


@dataclass(frozen=True)
class SwingTest:
    dropped: Extremum | None
    swings: tuple[RecordedSwing, ...]
    # ΔP5M5/ΔP1M1. It is 0 if the oscillation has died out before, and None if the record is too short.
    ratio: float | None
    accepted: bool
    reason: str


def slow_part(times: Numbers, signal: Numbers) -> Numbers:
    """The signal without parts faster than `FASTEST`, such as the ripple of a network resonance.

    A Butterworth filter of order 4 runs over the signal forwards and backwards. It causes no delay, and the judged
    modes keep their size to 0.1 %."""
    if not np.isfinite(signal).all():
        return signal
    from scipy.signal import butter, sosfiltfilt  # noqa: PLC0415 - a second to import

    sections = butter(4, FASTEST, fs=1 / (times[1] - times[0]), output="sos")
    return np.asarray(sosfiltfilt(sections, signal))


def extrema(
    times: Numbers, signal: Numbers, start: float, resolution: float = RESOLUTION
) -> list[Extremum]:
    """Turning points after a time, maxima and minima in turn.

    ``resolution``: Smallest movement that counts, as a part of the range of the signal after the event."""
    after = times >= start - 1e-9
    t, y = times[after], signal[after]
    least = resolution * float(np.ptp(y))
    if least == 0:
        return []
    found: list[Extremum] = []
    high = low = 0
    rising: bool | None = None
    for k in range(1, len(y)):
        high, low = (k if y[k] > y[high] else high), (k if y[k] < y[low] else low)
        if rising is not False and y[high] - y[k] > least:
            if rising:
                found.append(Extremum(float(t[high]), float(y[high]), True))
            rising, low = False, k
        elif rising is not True and y[k] - y[low] > least:
            if rising is False:
                found.append(Extremum(float(t[low]), float(y[low]), False))
            rising, high = True, k
    return found


def swings_of(points: list[Extremum]) -> tuple[RecordedSwing, ...]:
    """Swings between successive maxima; a minimum before the first maximum belongs to none."""
    maxima = [p for p in points if p.is_maximum]
    minima = [p for p in points if not p.is_maximum and maxima and p.time > maxima[0].time]
    parts = zip(maxima, minima, maxima[1:], strict=False)
    return tuple(RecordedSwing(k, *part) for k, part in enumerate(parts, start=1))


def swing_test(
    times: Numbers, signal: Numbers, start: float, *, drop_first: bool = True
) -> SwingTest:
    """Apply the criterion after an event [s], without the extremum to which the oscillation starts or with it."""
    if not np.isfinite(signal).all():
        return SwingTest(None, (), None, False, "the signal is not finite")
    points = extrema(times, signal, start)
    dropped = points[0] if points and drop_first else None
    swings = swings_of(points[1:] if drop_first else points)
    if len(swings) >= JUDGED_SWING:
        ratio = swings[JUDGED_SWING - 1].depth / swings[0].depth
        accepted = abs(ratio) < LARGEST_RATIO
        sign = "<" if accepted else "≥"
        return SwingTest(
            dropped, swings, ratio, accepted, f"ΔP5M5/ΔP1M1 = {ratio:.3f} {sign} {LARGEST_RATIO}"
        )
    quiet = points[-1].time if points else start
    if times[-1] - quiet <= SLOWEST_PERIOD:
        return SwingTest(
            dropped, swings, None, False, "the record ends before the fifth swing; make it longer"
        )
    count = {0: "no swing", 1: "one swing"}.get(len(swings), f"{len(swings)} swings")
    least = f"{100 * RESOLUTION:.1f} % of the signal's range"
    reason = f"died out after {count}: from {quiet:.1f} s on no turn above {least}"
    return SwingTest(dropped, swings, 0.0, True, reason)

"""The response after an event: an oscillation that grows, or one that neither grows nor decays."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers
from orchestrator.simulation.watch import oscillation as oscillations
from orchestrator.simulation.watch import swing_findings
from orchestrator.simulation.watch.confirmation import (
    KEPT,
    STEADY,
    KnownModes,
    Swing,
    change,
    doubt,
    irregular_doubt,
    rms,
)
from orchestrator.simulation.watch.finding import NOT_JUDGED, Finding, Kind
from orchestrator.simulation.watch.limit import is_inner
from orchestrator.simulation.watch.seen import Seen, is_derivative, unit
from orchestrator.simulation.watch.stretches import Stretch
from orchestrator.systems.coupling.system import System

FEWEST_LOOKS = 60
"""Least number of looks in the judged part: the last three quarters of the time from one event to the next, or to the
end."""

SMALLEST = 1e-7  # smallest oscillation that is reported, as a part of 1 or of the signal's start
# smallest reported oscillation that is too fast for the looks; only its extent is known
SMALLEST_FAST = 1e-5
# smallest reported oscillation, as a part of the signal's largest deviation since the event
SMALLEST_PART = 0.01
SAME_FREQUENCY = 0.05
"""An oscillation is confirmed if the stretch and its second half show the same frequency, with at most this relative
difference."""

# A swing consists of one oscillation if the oscillation makes at least this part of it
EXPLAINED = 0.5
# smallest reported swing without a single oscillation, as a part of 1 or of the signal's start
IRREGULAR = 1e-3
_PASSES = 8  # least number of crossings of an irregular swing with its trend within the last third
# number of turns between two looks from which an output is judged by its extremes between the looks
_FAST = 0.25
_RESOLVED = 4.0
"""An output is judged by its looks, however often it turns, if it moves by this factor more over several turns than
between two looks: a small ripple makes the turns, and a swing that the looks resolve makes the motion."""

_TURNS = 6  # turns that are combined to one figure for the extent of an output's swing
_FEWEST_GROUPS = 12  # such figures without which a growth is not told from chance

CLEAN = 0.15
"""In a stretch with noise, the largest part of a swing that a reported oscillation leaves unexplained. An oscillation
that noise excites wanders in amplitude and phase, and leaves more."""

# signals in which a clean oscillation is searched in a stretch with noise: those least noisy
_SMOOTHEST = 3
_TRIED = 8  # number of signals in which oscillations are searched: those that swing most at the end
ONE = 0.3
"""An oscillation continues over events if it explains the swing between any two of them except for less than this
part."""


def unsettled_response(
    seen: Seen,
    system: System,
    stretch: Stretch,
    units: Sequence[str],
    known: KnownModes,
    *,
    noisy: bool = False,
) -> list[Finding]:
    """At most one growing and one sustained oscillation in a stretch, each in the signal where it is strongest.

    If an oscillation is faster than the looks, only such oscillations are reported, because the looks would show it as
    a slower one. In a stretch with unnoticed events, only oscillations that continue over all of these events are
    reported."""
    seen = seen.until(stretch.end)
    first = int(np.searchsorted(seen.times, stretch.begin))
    if not enough_looks(seen, stretch):
        return []
    begin = _judged_from(stretch)
    times = seen.times[first:]
    slow = (
        _swing(name, y[first:], times, begin) for name, y in resting_signals(seen, system).items()
    )
    fast = (_fast_swing(name, seen, first, begin) for name in seen.turns)
    swings = [replace(swing, known=known) for swing in chain(slow, fast) if swing is not None]
    swings.sort(key=lambda s: (s.name.partition(".")[0] not in units, -s.size))
    # An oscillation faster than the looks appears in the signals as a slower one, therefore it is searched first.
    quick = [s for s in swings if s.turns_hz is not None]
    others = [
        s
        for s in swings
        if s.turns_hz is None and not (quick and oscillations.too_fast(s.times, s.signal))
    ]
    if noisy:
        grown = [s for s in swings if swing_findings.swing_rises(s)]
        told = _describe_swings(
            grown[:_TRIED], system, stretch, irregular_as_well=not stretch.breaks
        )
        smooth = sorted((s for s in swings if s.turns_hz is None), key=_roughness)[:_SMOOTHEST]
        return told or _describe_swings(
            smooth, system, stretch, irregular_as_well=False, clean=True
        )
    told = _describe_swings(quick[:_TRIED], system, stretch, irregular_as_well=False)
    if judgements(told):
        return told
    return (
        _describe_swings(
            others[:_TRIED], system, stretch, irregular_as_well=not quick and not stretch.breaks
        )
        or told
    )


def judgements(found: Sequence[Finding]) -> list[Finding]:
    return [finding for finding in found if finding.kind != NOT_JUDGED]


def enough_looks(seen: Seen, stretch: Stretch) -> bool:
    judged = (seen.times >= _judged_from(stretch)) & (seen.times <= stretch.end * (1 + 1e-12))
    return int(judged.sum()) >= FEWEST_LOOKS


def _judged_from(stretch: Stretch) -> float:
    """Where the last three quarters begin [s]."""
    return stretch.begin + (stretch.end - stretch.begin) / 4


def _describe_swings(
    swings: Sequence[Swing],
    system: System,
    stretch: Stretch,
    *,
    irregular_as_well: bool,
    clean: bool = False,
) -> list[Finding]:
    """The first finding of each kind; a swing without a frequency only where there is none with one, and a remark on a
    swing in doubt only where there is no finding."""
    told: dict[Kind, Finding] = {}
    irregular, doubtful = list[Finding](), list[Finding]()
    for swing in swings:
        oscillation = _fast(swing) if swing.turns_hz is not None else _single(swing)
        if clean and not (oscillation and _is_clean(swing, oscillation)):
            continue
        if oscillation is not None:
            finding = _regular(swing, oscillation, unit(swing.name, system), stretch)
            if (
                finding is None
                or finding.kind in told
                or not _goes_on(swing, oscillation, stretch.breaks)
            ):
                continue
            if swing.is_explained(oscillation.frequency_hz):
                continue
            why = "" if clean else doubt(swing, oscillation)
            if not why:
                told[finding.kind] = finding
            elif not doubtful:
                doubtful.append(swing_findings.doubtful_swing(swing, oscillation, why, stretch))
        elif irregular_as_well and _is_irregular(swing):
            why = "" if swing_findings.swing_rises(swing) else irregular_doubt(swing)
            if not why:
                irregular.append(
                    swing_findings.irregular_swing(swing, unit(swing.name, system), stretch)
                )
            elif not doubtful:
                doubtful.append(
                    swing_findings.doubtful_irregular_swing(
                        swing, why, unit(swing.name, system), stretch
                    )
                )
    return [*told.values()] or irregular[:1] or doubtful


def resting_signals(seen: Seen, system: System) -> dict[str, Numbers]:
    """Signals that rest in a steady state at any frequency: no angles, magnitudes of real and imaginary parts."""
    everything: Mapping[str, Numbers] = {**seen.values, **seen.last}
    found = {}
    for name, signal in everything.items():
        rests = unit(name, system) != "rad" and np.isfinite(signal).all()
        if not rests or is_derivative(name) or is_inner(name, system):
            continue
        if not name.endswith(("_re", "_im")):
            found[name] = signal
        elif name.endswith("_re") and f"{name[:-3]}_im" in everything:
            found[name] = np.hypot(signal, everything[f"{name[:-3]}_im"])
    return found


def _swing(name: str, signal: Numbers, times: Numbers, begin: float) -> Swing | None:
    deviation, scale = float(np.abs(signal - signal[0]).max()), max(1.0, abs(float(signal[0])))
    rows = times >= begin
    _, middle, last = (rms(part) for part in np.array_split(signal[rows], 3))
    if last < KEPT * middle or np.sqrt(2) * last < max(SMALLEST * scale, SMALLEST_PART * deviation):
        return None
    return Swing(name, last / scale, scale, (times, signal), times[rows], signal[rows])


def _goes_on(swing: Swing, oscillation: oscillations.Oscillation, breaks: Sequence[float]) -> bool:
    """Return whether one oscillation, with one phase, makes the swing before and after each of these times."""
    if not breaks:
        return True
    since = swing.times - swing.times[-1]
    shortest = 1 / oscillation.frequency_hz if swing.turns_hz is None else 0.0
    pieces = _pieces(swing.times, breaks, shortest)
    if swing.turns_hz is not None:
        rest = np.log(swing.signal) - oscillation.rate * since
        middles = [float(np.median(rest[rows])) for rows in pieces]
        return max(middles) - min(middles) < ONE
    turn = np.exp((oscillation.rate + 2j * np.pi * oscillation.frequency_hz) * since)
    shapes = [
        oscillations.without_trend(np.column_stack([turn[rows].real, turn[rows].imag]))
        for rows in pieces
    ]
    swings = [oscillations.without_trend(swing.signal[rows]) for rows in pieces]
    share = np.linalg.lstsq(np.concatenate(shapes), np.concatenate(swings), rcond=None)[0]
    return all(
        np.linalg.norm(y - shape @ share) < ONE * np.linalg.norm(y)
        for shape, y in zip(shapes, swings, strict=True)
    )


def _pieces(times: Numbers, breaks: Sequence[float], shortest: float) -> list[NDArray[np.int_]]:
    """Rows between the breaks, in pieces of a least length [s]."""
    kept = [float(times[0])]
    for time in breaks:
        if time - kept[-1] >= shortest and times[-1] - time >= shortest:
            kept.append(time)
    pieces = np.split(np.arange(len(times)), np.searchsorted(times, kept[1:], side="right"))
    return [rows for rows in pieces if len(rows)]


def _roughness(swing: Swing) -> float:
    return float(np.std(np.diff(swing.signal))) / (swing.size * swing.scale)


def _is_clean(swing: Swing, oscillation: oscillations.Oscillation) -> bool:
    """Return whether one oscillation, with one phase, makes the whole swing, so that its growth is certain."""
    since = swing.times - swing.times[-1]
    turn = np.exp((oscillation.rate + 2j * np.pi * oscillation.frequency_hz) * since)
    shape = oscillations.without_trend(np.column_stack([turn.real, turn.imag]))
    whole = oscillations.without_trend(swing.signal)
    rest = whole - shape @ np.linalg.lstsq(shape, whole, rcond=None)[0]
    part = float(np.linalg.norm(rest) / np.linalg.norm(whole))
    return part < (CLEAN if change(swing, oscillation.rate) > STEADY + 2 * part else CLEAN / 3)


def _fast_swing(name: str, seen: Seen, first: int, begin: float) -> Swing | None:
    """The swing of an output between the looks. Its signal is the extent of the swing, without the way of its
    middle."""
    turns, last = seen.turns[name][first + 1 :], seen.last[name][first:]
    often = float(np.array_split(turns, 4)[3].mean())
    if often < _FAST:
        return None
    group = int(np.ceil(_TURNS / often))
    rows = np.arange(0, len(turns) - group + 1, group)
    high = np.maximum.reduceat(seen.high[name][first + 1 :], rows)
    low = np.minimum.reduceat(seen.low[name][first + 1 :], rows)
    # The distance of the extremes contains the oscillation and the way of its middle.
    middles = (high + low) / 2
    drift = np.abs(np.gradient(middles)) if len(rows) > 1 else np.zeros(1)
    ripple, times = np.maximum(high - low - drift, 0.0), seen.times[first:][rows]
    deviation, scale = float(np.abs(last - last[0]).max()), max(1.0, abs(float(last[0])))
    stretch = times >= begin
    if stretch.sum() < _FEWEST_GROUPS:
        return None
    between = seen.high[name][first + 1 :] - seen.low[name][first + 1 :]
    if ripple[stretch].mean() > _RESOLVED * between[len(between) // 4 :].mean():
        return None
    _, middle, end = (float(part.mean()) for part in np.array_split(ripple[stretch], 3))
    if end < KEPT * middle or end / 2 < max(SMALLEST_FAST * scale, SMALLEST_PART * deviation):
        return None
    size, hz = end / (2 * np.sqrt(2)) / scale, often / 2 / seen.interval
    return Swing(
        name,
        size,
        scale=scale,
        response=(times, ripple),
        times=times[stretch],
        signal=ripple[stretch],
        turns_hz=hz,
    )


def _regular(
    swing: Swing, oscillation: oscillations.Oscillation, unit: str, stretch: Stretch
) -> Finding | None:
    grown = change(swing, oscillation.rate)
    if grown < -STEADY:
        return None
    return (swing_findings.growing if grown > STEADY else swing_findings.sustained)(
        swing, oscillation, unit, stretch
    )


def _is_irregular(swing: Swing) -> bool:
    passes = (
        2
        * oscillations.crossings_hz(swing.times, swing.signal)
        * float(swing.times[-1] - swing.times[0])
        / 3
    )
    return swing.turns_hz is None and swing.size >= IRREGULAR and passes >= _PASSES


def _single(swing: Swing) -> oscillations.Oscillation | None:
    """The oscillation that makes the swing; None if there is no such oscillation, or if the second half of the stretch
    does not show it."""
    half = len(swing.times) // 2
    whole = oscillations.strongest_oscillation(swing.times, swing.signal)
    late = oscillations.strongest_oscillation(
        swing.times[half:], swing.signal[half:], least_periods=1
    )
    if (
        whole is None
        or late is None
        or whole.amplitude < EXPLAINED * np.sqrt(2) * swing.size * swing.scale
    ):
        return None
    if abs(whole.frequency_hz - late.frequency_hz) > SAME_FREQUENCY * whole.frequency_hz:
        return None
    enough = (
        late.frequency_hz * float(swing.times[-1] - swing.times[half]) >= oscillations.LEAST_PERIODS
    )
    return late if enough else whole


def _fast(swing: Swing) -> oscillations.Oscillation | None:
    """Frequency from the turns, growth rate from the extent. A rate within its own uncertainty is taken as 0."""
    if swing.turns_hz is None or not (swing.signal > 0).all():
        return None
    half = len(swing.times) // 2
    times, sizes = swing.times[half:], np.log(swing.signal[half:])
    rate, start = (float(c) for c in np.polyfit(times, sizes, 1))
    scatter = float(np.std(sizes - rate * times - start))
    if abs(rate) * float(times[-1] - times[0]) < scatter:
        rate = 0.0
    return oscillations.Oscillation(
        swing.turns_hz, rate, float(swing.signal[-max(1, len(sizes) // 10) :].mean()) / 2
    )

"""The response after an event: an oscillation that grows, or one that neither grows nor decays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from orchestrator.arrays import Numbers
from orchestrator.coupling.system import System
from orchestrator.watch.finding import Finding, Kind
from orchestrator.watch.oscillation import (
    LEAST_PERIODS,
    Oscillation,
    crossings_hz,
    strongest_oscillation,
    too_fast,
    without_trend,
)
from orchestrator.watch.seen import Seen, is_derivative, unit
from orchestrator.watch.stretches import Stretch

FEWEST_LOOKS = 60
"""In what is looked at: the last three quarters of the time from one event to the next, or to the end."""

KEPT = 0.7
"""What has lost more than this leaves of its swing, from the middle to the last third of the stretch, is decaying."""

SMALLEST = 1e-7
"""Of 1 or of the signal's start: less is no oscillation that anybody could see."""

SMALLEST_FAST = 1e-5
"""The same for one that is too fast for the looks, of which only the extent is known."""

SMALLEST_PART = 0.01
"""Of the signal's own deviation since the event."""

STEADY = 0.05
"""An oscillation whose amplitude changes by less than this in the logarithm, over the stretch, is sustained."""

SAME_FREQUENCY = 0.05
"""An oscillation is one if both the stretch and its second half show the same frequency, to this part of it."""

EXPLAINED = 0.5
"""An oscillation is what swings if it makes at least this part of the swing."""

IRREGULAR = 1e-3
"""A swing in which no single oscillation is found is told from this part of 1 or of the signal's start on."""

_PASSES = 8
"""An irregular swing passes its trend at least so often within the last third."""

_FAST = 0.25
"""Turns from one look to the next from which on an output is judged by its extremes between the looks."""

_TURNS, _FEWEST_GROUPS = 6, 12
"""So many turns make one figure of how far an output goes to and fro, and so many of these figures are needed."""

_TRIED = 8
"""Signals in which oscillations are looked for: those that swing most at the end."""

ONE = 0.3
"""An oscillation goes on over events if it leaves less than this of the swing between any two of them unexplained."""

_PARTS, _SHORT = 40, 0.1
"""At most so many pieces of at least this length [s], of which the first is looked for with an oscillation in full."""


@dataclass(frozen=True)
class Swing:
    """A signal that still swings at the end as it did before.

    Attributes
    ----------
    size
        Root mean square in the last third without the trend, beside the scale.
    scale
        1 or the start's magnitude [the signal's unit].
    response
        Times [s] since the event, and the signal at them.
    times, signal
        The same in the last three quarters.
    turns_hz
        Half of how often the signal turns [Hz], step by step; only for what was followed between the looks.
    """

    name: str
    size: float
    scale: float
    response: tuple[Numbers, Numbers]
    times: Numbers
    signal: Numbers
    turns_hz: float | None = None


def unsettled_response(seen: Seen, system: System, stretch: Stretch, units: Sequence[str]) -> list[Finding]:
    """At most one growing and one sustained oscillation in a stretch, where they are strongest.

    Where one is faster than the looks, only such are told: in the looks it would pass for a slower one.
    In a stretch with events that nobody notices only what goes on over all of them is told.

    Parameters
    ----------
    seen
        What was seen of the run.
    system
        What ran.
    stretch
        The part of the run that is looked at.
    units
        Components that feed the grid: they are named rather than the grid where both swing.
    """
    seen = seen.until(stretch.end)
    first = int(np.searchsorted(seen.times, stretch.begin))
    begin = stretch.begin + (stretch.end - stretch.begin) / 4
    if (seen.times >= begin).sum() < FEWEST_LOOKS:
        return []
    times = seen.times[first:]
    slow = (_swing(name, y[first:], times, begin) for name, y in resting_signals(seen, system).items())
    fast = (_fast_swing(name, seen, first, begin) for name in seen.turns)
    swings = [swing for swing in chain(slow, fast) if swing is not None]
    swings.sort(key=lambda s: (_component(s.name) not in units, -s.size))
    # What is faster than the looks shows in the signals as something slower, so it goes first.
    quick = [s for s in swings if s.turns_hz is not None]
    others = [s for s in swings if s.turns_hz is None and not (quick and too_fast(s.times, s.signal))]
    told = _told(quick[:_TRIED], system, stretch, irregular_as_well=False)
    return told or _told(others[:_TRIED], system, stretch, irregular_as_well=not quick and not stretch.breaks)


def _told(swings: Sequence[Swing], system: System, stretch: Stretch, *, irregular_as_well: bool) -> list[Finding]:
    """The first finding of each kind; a swing without a frequency only where there is none with one."""
    told: dict[Kind, Finding] = {}
    irregular = []
    for swing in swings:
        oscillation = _fast(swing) if swing.turns_hz is not None else _single(swing)
        if oscillation is not None:
            finding = _regular(swing, oscillation, unit(swing.name, system), stretch)
            if finding is not None and finding.kind not in told and _goes_on(swing, oscillation, stretch.breaks):
                told[finding.kind] = finding
        elif irregular_as_well and _is_irregular(swing):
            irregular.append(_irregular(swing, unit(swing.name, system), stretch))
    return [*told.values()] or irregular[:1]


def resting_signals(seen: Seen, system: System) -> dict[str, Numbers]:
    """Signals that rest in a steady state at any frequency: no angles, magnitudes of real and imaginary parts."""
    everything: Mapping[str, Numbers] = {**seen.values, **seen.last}
    found = {}
    for name, signal in everything.items():
        if is_derivative(name) or unit(name, system) == "rad" or not np.isfinite(signal).all():
            continue
        if not name.endswith(("_re", "_im")):
            found[name] = signal
        elif name.endswith("_re") and f"{name[:-3]}_im" in everything:
            found[name] = np.hypot(signal, everything[f"{name[:-3]}_im"])
    return found


def _component(name: str) -> str:
    return name.partition(".")[0]


def _swing(name: str, signal: Numbers, times: Numbers, begin: float) -> Swing | None:
    """What of a signal is worth a closer look; the signal and its times begin with the event."""
    deviation, scale = float(np.abs(signal - signal[0]).max()), max(1.0, abs(float(signal[0])))
    rows = times >= begin
    _, middle, last = (_rms(part) for part in np.array_split(signal[rows], 3))
    if last < KEPT * middle or np.sqrt(2) * last < max(SMALLEST * scale, SMALLEST_PART * deviation):
        return None
    return Swing(name, last / scale, scale, (times, signal), times[rows], signal[rows])


def _rms(signal: Numbers) -> float:
    return float(np.sqrt(np.mean(without_trend(signal) ** 2)))


def _goes_on(swing: Swing, oscillation: Oscillation, breaks: Sequence[float]) -> bool:
    """Whether one oscillation, with one phase, makes the swing before and after each of these times."""
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
    shapes = [without_trend(np.column_stack([turn[rows].real, turn[rows].imag])) for rows in pieces]
    swings = [without_trend(swing.signal[rows]) for rows in pieces]
    share = np.linalg.lstsq(np.concatenate(shapes), np.concatenate(swings), rcond=None)[0]
    return all(np.linalg.norm(y - shape @ share) < ONE * np.linalg.norm(y)
               for shape, y in zip(shapes, swings, strict=True))  # fmt: skip


def _pieces(times: Numbers, breaks: Sequence[float], shortest: float) -> list[NDArray[np.int_]]:
    """Rows between the breaks, in pieces of at least so long [s]."""
    kept = [float(times[0])]
    for time in breaks:
        if time - kept[-1] >= shortest and times[-1] - time >= shortest:
            kept.append(time)
    pieces = np.split(np.arange(len(times)), np.searchsorted(times, kept[1:], side="right"))
    return [rows for rows in pieces if len(rows)]


def _since(swing: Swing, frequency: float | None) -> float:
    """The first time [s] from which on the swing is about as large as at the end."""
    times, signal = swing.response
    length = float(times[-1] - times[0])
    periods = length * frequency / 2 if frequency and swing.turns_hz is None else length / _SHORT
    count = int(min(_PARTS, periods, len(times) // 4))
    if count < 2:
        return float(times[0])
    sizes = [float(y.mean()) if swing.turns_hz else _rms(y) for y in np.array_split(signal, count)]
    last = float(np.mean(sizes[-max(1, count // 4) :]))
    ago = next((k for k, size in enumerate(reversed(sizes)) if not KEPT * last < size < last / KEPT), count)
    return float(np.array_split(times, count)[count - max(ago, 1)][0])


def _fast_swing(name: str, seen: Seen, first: int, begin: float) -> Swing | None:
    """An output that goes to and fro between the looks; its signal is how far, beyond where it got in the meantime."""
    turns, last = seen.turns[name][first + 1 :], seen.last[name][first:]
    often = float(np.array_split(turns, 4)[3].mean())
    if often < _FAST:
        return None
    group = int(np.ceil(_TURNS / often))
    rows = np.arange(0, len(turns) - group + 1, group)
    high = np.maximum.reduceat(seen.high[name][first + 1 :], rows)
    low = np.minimum.reduceat(seen.low[name][first + 1 :], rows)
    # The extremes hold the oscillation and how far its middle went.
    middles = (high + low) / 2
    drift = np.abs(np.gradient(middles)) if len(rows) > 1 else np.zeros(1)
    ripple, times = np.maximum(high - low - drift, 0.0), seen.times[first:][rows]
    deviation, scale = float(np.abs(last - last[0]).max()), max(1.0, abs(float(last[0])))
    stretch = times >= begin
    if stretch.sum() < _FEWEST_GROUPS:
        return None
    _, middle, end = (float(part.mean()) for part in np.array_split(ripple[stretch], 3))
    if end < KEPT * middle or end / 2 < max(SMALLEST_FAST * scale, SMALLEST_PART * deviation):
        return None
    size, hz = end / (2 * np.sqrt(2)) / scale, often / 2 / seen.interval
    return Swing(name, size, scale, (times, ripple), times[stretch], ripple[stretch], hz)


def _regular(swing: Swing, oscillation: Oscillation, unit: str, stretch: Stretch) -> Finding | None:
    """A finding, unless the oscillation decays."""
    change = oscillation.rate * float(swing.times[-1] - swing.times[0])
    if change < -STEADY:
        return None
    return (_growing if change > STEADY else _sustained)(swing, oscillation, unit, stretch)


def _is_irregular(swing: Swing) -> bool:
    passes = 2 * crossings_hz(swing.times, swing.signal) * float(swing.times[-1] - swing.times[0]) / 3
    return swing.turns_hz is None and swing.size >= IRREGULAR and passes >= _PASSES


def _single(swing: Swing) -> Oscillation | None:
    """The oscillation that makes the swing, if there is one and the second half of the stretch shows it as well."""
    half = len(swing.times) // 2
    whole = strongest_oscillation(swing.times, swing.signal)
    late = strongest_oscillation(swing.times[half:], swing.signal[half:], least_periods=1)
    if whole is None or late is None or whole.amplitude < EXPLAINED * np.sqrt(2) * swing.size * swing.scale:
        return None
    if abs(whole.frequency_hz - late.frequency_hz) > SAME_FREQUENCY * whole.frequency_hz:
        return None
    enough = late.frequency_hz * float(swing.times[-1] - swing.times[half]) >= LEAST_PERIODS
    return late if enough else whole


def _fast(swing: Swing) -> Oscillation | None:
    """Frequency from the turns, growth rate from the extent; a rate that its scatter does not bear out is 0."""
    if swing.turns_hz is None or not (swing.signal > 0).all():
        return None
    half = len(swing.times) // 2
    times, sizes = swing.times[half:], np.log(swing.signal[half:])
    rate, start = (float(c) for c in np.polyfit(times, sizes, 1))
    scatter = float(np.std(sizes - rate * times - start))
    if abs(rate) * float(times[-1] - times[0]) < scatter:
        rate = 0.0
    return Oscillation(swing.turns_hz, rate, float(swing.signal[-max(1, len(sizes) // 10) :].mean()) / 2)


def _growing(swing: Swing, oscillation: Oscillation, unit: str, stretch: Stretch) -> Finding:
    message = (
        f"the response grows from t = {stretch.begin:.4g} s on: {_shown(swing.name)} swings at "
        f"{oscillation.frequency_hz:.4g} Hz and grows at {oscillation.rate:+.3g} 1/s; at {_end(stretch)} its amplitude "
        f"is {oscillation.amplitude:.3g} {unit}"
    )
    return _finding("growing_oscillation", stretch.begin, swing, message, oscillation, stretch)


def _sustained(swing: Swing, oscillation: Oscillation, unit: str, stretch: Stretch) -> Finding:
    since = _since(swing, oscillation.frequency_hz)
    message = (
        f"the response neither decays nor grows, as in a limit cycle: from t = {since:.4g} s to {_end(stretch)} "
        f"{_shown(swing.name)} swings at {oscillation.frequency_hz:.4g} Hz with an amplitude of "
        f"{oscillation.amplitude:.3g} {unit}"
    )
    return _finding("sustained_oscillation", since, swing, message, oscillation, stretch)


def _irregular(swing: Swing, unit: str, stretch: Stretch) -> Finding:
    amplitude, since = float(np.sqrt(2)) * swing.size * swing.scale, _since(swing, None)
    fast = ", too fast for the looks at it" if too_fast(swing.times, swing.signal) else ""
    message = (
        f"the response does not settle: from t = {since:.4g} s to {_end(stretch)} {_shown(swing.name)} swings by about "
        f"{amplitude:.3g} {unit}, at no single frequency{fast}"
    )
    figures = {"amplitude": amplitude}
    return Finding("sustained_oscillation", since, *_place(swing.name), message, _until(stretch), figures)


def _finding(
    kind: Kind, time: float, swing: Swing, message: str, oscillation: Oscillation, stretch: Stretch
) -> Finding:
    figures = {
        "growth_rate": oscillation.rate,
        "frequency_hz": oscillation.frequency_hz,
        "amplitude": oscillation.amplitude,
    }
    return Finding(kind, time, *_place(swing.name), message, _until(stretch), figures)


def _end(stretch: Stretch) -> str:
    return "the end" if stretch.last else f"the next event at t = {stretch.end:.4g} s"


def _until(stretch: Stretch) -> float | None:
    return None if stretch.last else stretch.end


def _place(name: str) -> tuple[str, str]:
    component, _, variable = name.partition(".")
    return component, variable


def _shown(name: str) -> str:
    """A pair of real and imaginary part is shown as its magnitude."""
    return f"|{name[:-3]}|" if name.endswith(("_re", "_im")) else name

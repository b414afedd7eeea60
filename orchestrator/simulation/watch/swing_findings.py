"""Findings on a swing that does not decay, and since when it swings like that."""

from dataclasses import replace

import numpy as np

from orchestrator.simulation.watch.confirmation import (
    KEPT,
    STEADY,
    Swing,
    change,
    needed_end,
    rises,
    rms,
)
from orchestrator.simulation.watch.finding import NOT_JUDGED, Finding, Kind, remedy_of, rounded_up
from orchestrator.simulation.watch.oscillation import Oscillation, too_fast
from orchestrator.simulation.watch.seen import shown_name
from orchestrator.simulation.watch.stretches import Stretch

_PARTS = 40  # pieces in which an oscillation is searched, at most
_SHORT = 0.1  # their least length [s]


def swing_rises(swing: Swing) -> bool:
    return rises(swing.signal, extents=swing.turns_hz is not None)


def _since(swing: Swing, frequency: float | None) -> float:
    """The first time [s] from which on the swing is about as large as at the end."""
    times, signal = swing.response
    length = float(times[-1] - times[0])
    periods = length * frequency / 2 if frequency and swing.turns_hz is None else length / _SHORT
    count = int(min(_PARTS, periods, len(times) // 4))
    if count < 2:
        return float(times[0])
    sizes = [float(y.mean()) if swing.turns_hz else rms(y) for y in np.array_split(signal, count)]
    last = float(np.mean(sizes[-max(1, count // 4) :]))
    ago = next(
        (k for k, size in enumerate(reversed(sizes)) if not KEPT * last < size < last / KEPT), count
    )
    return float(np.array_split(times, count)[count - max(ago, 1)][0])


def growing(swing: Swing, oscillation: Oscillation, unit: str, stretch: Stretch) -> Finding:
    message = (
        f"the response grows from t = {stretch.begin:.4g} s on: {shown_name(swing.name)} swings at "
        f"{oscillation.frequency_hz:.4g} Hz and grows at {oscillation.rate:+.3g} 1/s; at {_end(stretch)} its amplitude "
        f"is {oscillation.amplitude:.3g} {unit}"
    )
    return _finding("growing_oscillation", stretch.begin, swing, message, oscillation, stretch)


def sustained(swing: Swing, oscillation: Oscillation, unit: str, stretch: Stretch) -> Finding:
    since = _since(swing, oscillation.frequency_hz)
    message = (
        f"the response neither decays nor grows, as in a limit cycle: from t = {since:.4g} s to {_end(stretch)} "
        f"{shown_name(swing.name)} swings at {oscillation.frequency_hz:.4g} Hz with an amplitude of "
        f"{oscillation.amplitude:.3g} {unit}"
    )
    return _finding("sustained_oscillation", since, swing, message, oscillation, stretch)


def doubtful_swing(swing: Swing, oscillation: Oscillation, why: str, stretch: Stretch) -> Finding:
    """A remark on an oscillation that may decay, with the reason of the doubt.

    ``why``: the reason; see `confirmation.doubt`."""
    enough = _enough(swing, oscillation, stretch)
    seems = "grow" if change(swing, oscillation.rate) > STEADY else "last"
    message = (
        f"whether the response to t = {stretch.begin:.4g} s settles is not judged: {shown_name(swing.name)} swings at "
        f"{oscillation.frequency_hz:.4g} Hz and seems to {seems} ({oscillation.rate:+.3g} 1/s until {_end(stretch)}), "
        f"but {why}; {remedy_of(enough)}"
    )
    finding = _finding(NOT_JUDGED, stretch.begin, swing, message, oscillation, stretch)
    return replace(finding, enough=enough)


def _enough(swing: Swing, oscillation: Oscillation | None, stretch: Stretch) -> float | None:
    """Stop of a run that shows the swing for long enough [s]; None where an event ends it."""
    return rounded_up(needed_end(swing, oscillation)) if stretch.last else None


def irregular_swing(swing: Swing, unit: str, stretch: Stretch) -> Finding:
    amplitude, since = _irregular_amplitude(swing), _since(swing, None)
    fast = ", too fast for the looks at it" if too_fast(swing.times, swing.signal) else ""
    grows = swing_rises(swing)
    message = (
        f"the response {'grows' if grows else 'does not settle'}: from t = {since:.4g} s to {_end(stretch)} "
        f"{shown_name(swing.name)} swings by about {amplitude:.3g} {unit}, at no single frequency{fast}"
    )
    kind: Kind = "growing_oscillation" if grows else "sustained_oscillation"
    figures = {"amplitude": amplitude}
    return Finding(kind, since, *_place(swing.name), message, _until(stretch), figures)


def doubtful_irregular_swing(swing: Swing, why: str, unit: str, stretch: Stretch) -> Finding:
    """A remark on a swing at no single frequency that may decay, with the reason of the doubt.

    ``why``: the reason; see `confirmation.irregular_doubt`."""
    amplitude, enough = _irregular_amplitude(swing), _enough(swing, None, stretch)
    message = (
        f"whether the response to t = {stretch.begin:.4g} s settles is not judged: {shown_name(swing.name)} swings by "
        f"about {amplitude:.3g} {unit} at {_end(stretch)}, at no single frequency, but {why}; "
        f"{remedy_of(enough)}"
    )
    place, figures = _place(swing.name), {"amplitude": amplitude}
    return Finding(
        NOT_JUDGED, stretch.begin, *place, message, _until(stretch), figures, enough=enough
    )


def _irregular_amplitude(swing: Swing) -> float:
    return float(np.sqrt(2)) * swing.size * swing.scale


def _finding(
    kind: Kind, time: float, swing: Swing, message: str, oscillation: Oscillation, stretch: Stretch
) -> Finding:
    rate, hertz = oscillation.rate, oscillation.frequency_hz
    figures = {"growth_rate": rate, "frequency_hz": hertz, "amplitude": oscillation.amplitude}
    return Finding(kind, time, *_place(swing.name), message, _until(stretch), figures)


def _end(stretch: Stretch) -> str:
    return "the end" if stretch.last else f"the next event at t = {stretch.end:.4g} s"


def _until(stretch: Stretch) -> float | None:
    return None if stretch.last else stretch.end


def _place(name: str) -> tuple[str, str]:
    component, _, variable = name.partition(".")
    return component, variable

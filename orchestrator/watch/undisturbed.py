"""The undisturbed state: before the first event nothing may move, and nothing may grow."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from orchestrator.watch.finding import Finding
from orchestrator.watch.oscillation import strongest_oscillation
from orchestrator.watch.seen import Numbers, Seen

LEAST_GROWTH = 1e-6
"""A growth is told once a signal is this far from its start, as a part of 1 or of the start."""

LEAST_MOTION = 1e-4
"""The same for a motion that does not grow, such as that of a start that was no steady state."""

_STEEP = 0.2
"""What grows by itself had less than this part of a motion in half the time."""

_FEWEST_LOOKS = 3
"""A growth rises over at least so many looks; else it is a jump."""


def undisturbed_motion(seen: Seen, until: float) -> Iterator[Finding]:
    """How the state moves before the first event, if it does.

    Parameters
    ----------
    until
        Time of the first event, or the end [s].
    """
    count = int(np.searchsorted(seen.times, until * (1 + 1e-12), side="right"))
    if count < _FEWEST_LOOKS:
        return
    motions = _motions(seen, count)
    if not motions:
        return
    most = max(motions, key=lambda name: motions[name][-1])
    size = motions[most][-1]
    steep = _is_growth(motions[most])
    least = LEAST_GROWTH if steep else LEAST_MOTION
    if size < least:
        return
    begin = {name: int(np.argmax(m >= least)) for name, m in motions.items() if m[-1] >= least}
    first = min(begin, key=lambda name: (begin[name], -motions[name][-1]))
    time = float(seen.times[begin[first]])
    who = f"{most} moves first and most" if first == most else f"{first} moves first; {most} moves most"
    sizes = f"{who}, by {size:.3g} of 1 or of its start until t = {until:.4g} s, before anything happens"
    component, _, variable = first.partition(".")
    figures = {"motion": float(size)}
    if not steep:
        message = f"the undisturbed state does not stand still from t = {time:.4g} s: {sizes}"
        yield Finding("undisturbed_motion", time, component, variable, message, None, figures)
        return
    rate, frequency = _growth(seen, most, motions[most])
    figures |= {"growth_rate": rate, "frequency_hz": frequency}
    how = f"at {rate:+.4g} 1/s " + (f"with {frequency:.4g} Hz" if frequency else "without oscillation")
    message = f"the undisturbed state grows {how} from t = {time:.4g} s: {sizes}"
    yield Finding("growth", time, component, variable, message, None, figures)


def _motions(seen: Seen, count: int) -> dict[str, Numbers]:
    """How far every signal has been from its start, beside 1 or its start; shape (count,) each, never falling."""
    found = {}
    for name in {*seen.values, *seen.last}:
        if name.partition(".")[2].startswith("der("):
            continue
        signal = seen.last[name] if name in seen.last else seen.values[name]
        lows, highs = (seen.low.get(name, signal), seen.high.get(name, signal))
        start = signal[0]
        far = np.maximum(highs[:count] - start, start - lows[:count]) / max(1.0, abs(start))
        if np.isfinite(far).all():
            found[name] = np.maximum.accumulate(far)
    return found


def _is_growth(motion: Numbers) -> bool:
    """Whether a motion rose steeply from next to nothing, over several looks."""
    reached = int(np.argmax(motion >= 0.5 * motion[-1]))
    if reached == 0 or motion[reached // 2] > _STEEP * motion[reached]:
        return False
    return int(_rising(motion).sum()) >= _FEWEST_LOOKS


def _rising(motion: Numbers) -> NDArray[np.bool_]:
    """Looks at which a growth is out of the rounding and not yet at its end."""
    floor = max(10 * motion[1], 1e-13)
    rising: NDArray[np.bool_] = (motion > floor) & (motion < 0.3 * motion[-1])
    return rising


def _growth(seen: Seen, name: str, motion: Numbers) -> tuple[float, float]:
    """Growth rate [1/s] and frequency [Hz], 0 where nothing turns.

    The rate is that of the envelope, over every communication step. Where the looks are close enough for the
    frequency, the matrix pencil gives both more exactly.
    """
    rising = np.flatnonzero(_rising(motion))
    rows = slice(int(rising[0]), int(rising[-1]) + 1)
    times = seen.times[rows]
    rate = float(np.polyfit(times, np.log(motion[rows]), 1)[0])
    late = rows if len(times) < 2 * _FEWEST_LOOKS else slice((rows.start + rows.stop) // 2, rows.stop)
    frequency = 0.0
    if name in seen.turns:
        frequency = float(seen.turns[name][late].sum()) / 2 / (seen.interval * (late.stop - late.start))
    signal = (seen.last if name in seen.last else seen.values)[name][rows]
    exact = strongest_oscillation(times, signal) if len(times) > 1 else None
    if exact is not None and abs(exact.rate - rate) < 0.2 * rate:
        return exact.rate, exact.frequency_hz
    return rate, frequency

"""Whether an oscillation is forced or a poorly damped mode of the system, with the evidence."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from orchestrator.oscillations.detection import Oscillation, Signals, envelope, phasors

OscillationKind = Literal["forced", "mode", "not known"]

_STRONGEST = 5
_FEWEST_PERIODS = 8
_STEADY, _RESTLESS = 0.25, 0.35
"""Spread of the envelope as a part of its mean: a sine's below the first; of filtered noise it is 0.52."""

_TREND = 0.7
"""Part of the envelope's variance that an exponential must explain to be one."""

_SINE = 1.85
"""Fourth moment beside the square of the second: 1.5 of a sine, 3 of noise."""

_SHOCK = 6.0
"""Deviation at the begin, in amplitudes, that a forcing's own transient does not reach."""

_COHERENT = 0.975
_CHANGE = 0.25
"""Change of the amplitude over the window from which on an oscillation decays or grows."""


@dataclass(frozen=True)
class Evidence:
    """What tells a forced oscillation from a mode.

    Attributes
    ----------
    damping_percent
        From the envelope; negative where it grows.
    envelope_spread
        Standard deviation of the envelope as a part of its mean.
    kurtosis
        1.5 of a sine, 3 of noise.
    coherence
        Length of the mean phasor beside the phasors' mean length: 1 where the phase stays.
    disturbed
        Whether it begins with a step or a shock in the signals.
    reasons
        In words.
    """

    kind: OscillationKind
    damping_percent: float
    envelope_spread: float
    kurtosis: float
    coherence: float
    periods: float
    disturbed: bool
    reasons: tuple[str, ...]


def evidence_of(signals: Signals, found: Oscillation) -> Evidence:
    """Judge the signals that show the oscillation best."""
    f, step = found.frequency, float(signals.times[1] - signals.times[0])
    settle = 0 if found.begin is None else round(2 / (f * step))
    used = slice(min(found.first + settle, found.last - 2), found.last)
    names = list(found.amplitudes)[:_STRONGEST]
    columns = [signals.names.index(name) for name in names]
    t = signals.times[used]
    periods = len(t) * step * f
    if periods < _FEWEST_PERIODS:
        return Evidence("not known", 0.0, 0.0, 0.0, 0.0, periods, False, (f"only {periods:.1f} periods are seen",))
    spreads, kurtoses, coherences, slopes, changes = [], [], [], [], []
    for k in columns:
        z, half = envelope(t, signals.values[used, k], f)
        size, late = np.abs(z), t[half : len(t) - half]
        slope, level = np.polyfit(late - late.mean(), np.log(np.maximum(size, 1e-300)), 1)
        spreads.append(float(size.std() / size.mean()))
        slopes.append(float(slope))
        trend = np.exp(level + slope * (late - late.mean()))
        explained = 1 - float(((size - trend) ** 2).mean() / size.var())
        changes.append(float(np.expm1(slope * (late[-1] - late[0]))) if explained > _TREND else 0.0)
        coherences.append(float(abs(z.mean()) / size.mean()))
        wave = np.real(z * np.exp(2j * np.pi * f * late))
        kurtoses.append(float((wave**4).mean() / (wave**2).mean() ** 2))
    middle = [float(np.median(x)) for x in (spreads, kurtoses, coherences, slopes, changes)]
    spread, kurtosis, coherence, slope, change = middle
    disturbed = _disturbed(signals, found)
    damping = float(-100 * slope / np.hypot(slope, 2 * np.pi * f))
    kind, reasons = _judged(spread, kurtosis, coherence, change, disturbed, found, periods)
    return Evidence(kind, damping, spread, kurtosis, coherence, periods, disturbed, tuple(reasons))


def _judged(
    spread: float, kurtosis: float, coherence: float, change: float, disturbed: bool, found: Oscillation, periods: float
) -> tuple[OscillationKind, list[str]]:
    harmonics = ", ".join(f"{order} x ({100 * part:.0f} %)" for order, part in found.harmonics.items())
    steady = spread < _STEADY and kurtosis < _SINE and coherence > _COHERENT
    figures = f"envelope ± {100 * spread:.0f} %, kurtosis {kurtosis:.2f}, phase coherence {coherence:.2f}"
    if abs(change) > _CHANGE and coherence > 0.8 and not found.harmonics:
        way = "decays" if change < 0 else "grows"
        return "mode", [f"its amplitude {way}, by {100 * abs(change):.0f} % over {periods:.0f} periods ({figures})"]
    if steady and disturbed and not found.harmonics:
        return "not known", [
            f"it is steady ({figures}), but begins with a disturbance, after which a mode without damping would ring alike"
        ]
    if steady:
        said = [f"it is steady over {periods:.0f} periods ({figures}): noise would make a mode's amplitude wander"]
        said += [f"multiples of its frequency: {harmonics}, as of a limit or a switch"] if harmonics else []
        return "forced", said
    if spread > _RESTLESS and kurtosis > _SINE and coherence < 0.9:
        return "mode", [f"its amplitude and phase wander as noise makes them ({figures})"]
    return "not known", [f"neither steady nor restless: {figures}"]


def _disturbed(signals: Signals, found: Oscillation) -> bool:
    """Whether a level changes, or something far larger than the oscillation happens, where it begins."""
    if found.begin is None:
        return False
    step = float(signals.times[1] - signals.times[0])
    period = max(2, round(1 / (found.frequency * step)))
    at, end = found.first, found.last
    around = slice(max(0, at - 2 * period), at + 2 * period)
    before, after = slice(max(0, at - 4 * period), max(1, at - period)), slice(at + period, min(end, at + 5 * period))
    for name in list(found.amplitudes)[:_STRONGEST]:
        x = signals.values[:, signals.names.index(name)]
        size = float(np.abs(phasors(signals.times[at:end], x[at:end, None], [found.frequency]))[0])
        noise = float(x[before].std())
        shock = float(np.abs(x[around] - np.median(x[before])).max())
        moved = abs(float(np.mean(x[after])) - float(np.mean(x[before])))
        if shock > _SHOCK * size + 4 * noise or moved > size + 4 * noise:
            return True
    return False

"""Oscillations in a record: frequency, begin, harmonics, amplitude by signal."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers, Vector
from orchestrator.studies.oscillations.measurements import Measurements
from orchestrator.studies.oscillations.onset import Onset, onset_of

# the range in which oscillations are sought, from interarea modes to controllers' [Hz]
LOWEST_HZ = 0.08
HIGHEST_HZ = 8.0
# power of a line beside the median of its neighbours: a mode that noise shakes seldom reaches it
_LEAST_ABOVE_NOISE = 35.0
_MOST_LINES = 6  # oscillations that are told, the strongest first
_LEAST_SHARE = 0.01  # part of the strongest oscillation's power from which on a weaker one is told
_AS_CLEAR = 0.1  # power beside its noise, as a part of that of the clearest signal
_FEWEST_PERIODS = 6  # in a record


@dataclass(frozen=True)
class Signals:
    """Deviations of a record's signals from straight lines, shape (n, m), with their names ``place.p`` and so on."""

    times: Numbers
    names: tuple[str, ...]
    values: Numbers


@dataclass(frozen=True)
class SpectralLine:
    frequency: float
    # [s]: from when on it has half of its level; None where it was there before the record
    begin: float | None
    # first, last: the part of the record in which it is analysed, as indices.
    first: int
    last: int
    # multiples of the frequency that are there as well, by order, as parts of the amplitude.
    harmonics: dict[int, float]
    amplitudes: dict[str, float]  # by signal [its unit], the strongest beside its own noise first
    clear: int  # how many of these show it about as well as the first; 0 where none does by itself
    onset: Onset | None = None  # when it begins; None where ``begin`` is

    def periods(self, interval: float) -> float:
        """How many are seen, from the time between two samples [s]."""
        return (self.last - self.first) * interval * self.frequency


def signals_of(measured: Measurements) -> Signals:
    """Powers of all places, speeds of the angles and magnitudes of the voltages of all buses."""
    columns: dict[str, Numbers] = {}
    for place in measured.places:
        columns[f"{place.name}.p"], columns[f"{place.name}.q"] = place.p, place.q
        columns[f"{place.bus}.v"] = place.v
        columns[f"{place.bus}.speed"] = np.gradient(place.angle, measured.interval) / (2 * np.pi)
    values = np.column_stack(list(columns.values()))
    line = np.column_stack([np.ones(len(values)), measured.times - measured.times.mean()])
    flat = values - line @ np.linalg.lstsq(line, values, rcond=None)[0]
    return Signals(measured.times, tuple(columns), flat)


def find_oscillations(signals: Signals) -> list[SpectralLine]:
    """Find the lines in the spectrum of any signal, or of the signals' mean; the strongest in all comes first.

    A line at a multiple of a stronger one's frequency is no oscillation of its own, but a harmonic of that one. Of m
    signals one must exceed the noise by log2(m) more: noise exceeds x times its median with the chance 2^-x."""
    step, count = float(signals.times[1] - signals.times[0]), len(signals.names)
    length = len(signals.times) * step
    grid, each = spectra(signals.values, step)
    power = each.mean(axis=1)
    each = np.column_stack([power, each])
    highest = np.lib.stride_tricks.sliding_window_view(
        np.pad(each, ((12, 12), (0, 0))), 25, axis=0
    ).max(axis=-1)
    low, high = max(LOWEST_HZ, _FEWEST_PERIODS / length), min(HIGHEST_HZ, 0.4 / step)
    at, column = np.nonzero((each == highest) & ((grid >= low) & (grid <= high))[:, None])
    above = each[at, column] / _background(each, at, column) - np.where(
        column > 0, np.log2(count), 0.0
    )
    lines: dict[int, dict[int, float]] = {}
    for j in np.argsort(-above)[: (above > _LEAST_ABOVE_NOISE).sum()]:
        lines.setdefault(int(at[j]), {})[int(column[j]) - 1] = float(above[j])
    strongest = sorted(lines, key=lambda k: -power[k])
    frequencies, found = list[float](), list[SpectralLine]()
    for k in strongest:
        apart = all(abs(grid[k] - other) * length > 3 for other in frequencies)
        if power[k] < _LEAST_SHARE * power[strongest[0]] or not apart or len(found) == _MOST_LINES:
            continue
        shown = {signal: size for signal, size in lines[k].items() if signal >= 0}
        frequency = refined(signals, [*shown] or [*range(count)], float(grid[k]))
        frequencies.append(frequency)
        base = next((o for o in found if _is_multiple(frequency, o.frequency, length)), None)
        if base:
            order = round(frequency / base.frequency)
            base.harmonics[order] = _harmonic_share(signals, base, order)
        else:
            found.append(_describe_line(signals, frequency, shown))
    return found


def spectra(values: Numbers, step: float) -> tuple[Numbers, Numbers]:
    """Frequencies [Hz] and the power of each signal as a part of its own, shape (frequencies, m)."""
    window = np.hanning(len(values))[:, None]
    power = np.abs(np.fft.rfft(values * window, 4 * len(values), axis=0)) ** 2
    share = np.asarray(power / np.maximum(power.sum(axis=0), 1e-300), dtype=np.float64)
    return np.asarray(np.fft.rfftfreq(4 * len(values), step), dtype=np.float64), share


def _background(power: Numbers, at: Vector, column: Vector) -> Numbers:
    """Medians further off than a line's own width: the larger of those of forty and of twelve independent bins."""
    medians = []
    for far in (101, 41):
        # a spectrum is the same below 0 Hz
        beside = np.abs(at[:, None] + np.r_[-far:-14:2, 15:far:2])
        medians.append(
            np.median(power[np.minimum(beside, len(power) - 1), column[:, None]], axis=1)
        )
    return np.asarray(1e-300 + np.maximum(*medians))


def refined(signals: Signals, columns: list[int], guess: float) -> float:
    """The frequency near a guess at which a sine explains most of some of the signals."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - slow to import

    values = signals.values[:, columns]
    strong = values / np.maximum(values.std(axis=0), 1e-300)
    window = np.hanning(len(strong))[:, None]
    t = signals.times - signals.times.mean()

    def unexplained(frequency: float) -> float:
        return -float(
            (np.abs((strong * window).T @ np.exp(-2j * np.pi * frequency * t)) ** 2).sum()
        )

    near = 1 / (t[-1] - t[0])
    best = minimize_scalar(
        unexplained, bounds=(guess - near, guess + near), method="bounded", options={"xatol": 1e-6}
    )
    return float(best.x)


def _is_multiple(frequency: float, base: float, length: float) -> bool:
    """Return whether a frequency is a multiple of another one, as far as a record of that length [s] can tell."""
    order = round(frequency / base)
    return order >= 2 and abs(frequency - order * base) * length < 1


def phasors(times: Numbers, values: Numbers, frequencies: Sequence[float]) -> Numbers:
    """Complex amplitudes of the first frequency, shape (m,), with the other frequencies and a parabola beside it."""
    t = times - times.mean()
    columns = [np.ones_like(t), t, t**2]
    for f in frequencies:
        columns += [np.cos(2 * np.pi * f * times), -np.sin(2 * np.pi * f * times)]
    found = np.linalg.lstsq(np.column_stack(columns), values, rcond=None)[0]
    return np.asarray(found[3] + 1j * found[4])


def envelope(
    times: Numbers, values: Numbers, frequency: float, periods: float = 3.0
) -> tuple[Numbers, int]:
    """Complex amplitude over the time from a sliding window of some periods, and the window's half in samples."""
    step = float(times[1] - times[0])
    half = max(2, round(0.5 * periods / (frequency * step)))
    window = np.hanning(2 * half + 3)[1:-1]
    slow = values - np.convolve(
        np.pad(values, half, mode="edge"), window / window.sum(), mode="valid"
    )
    turned = slow * np.exp(-2j * np.pi * frequency * times)
    return np.convolve(turned, 2 * window / window.sum(), mode="valid"), half


def _describe_line(signals: Signals, frequency: float, shown: dict[int, float]) -> SpectralLine:
    """Describe an oscillation: amplitudes, and its begin and end from the envelope of the signal that shows it best.

    ``shown``: by the numbers of the signals that show it by themselves, its power beside the noise."""
    amplitude = np.abs(phasors(signals.times, signals.values, [frequency]))
    size = amplitude / np.maximum(signals.values.std(axis=0), 1e-300)
    order = [*shown, *(int(k) for k in np.argsort(-size) if k not in shown)]
    z, half = envelope(signals.times, signals.values[:, order[0]], frequency)
    size = np.abs(z)
    level = float(np.median(size[size > 0.5 * size.max()]))
    there = np.flatnonzero(size >= 0.5 * level)
    begin = None if there[0] == 0 else float(signals.times[there[0] + half])
    first = 0 if begin is None else int(there[0]) + half
    last = len(signals.times) if there[-1] == len(size) - 1 else int(there[-1]) + half
    used = slice(first, last)
    strength = np.abs(phasors(signals.times[used], signals.values[used], [frequency]))
    amplitudes = {signals.names[k]: float(strength[k]) for k in order if strength[k] > 0}
    clear = sum(above > _AS_CLEAR * max(shown.values()) for above in shown.values())
    seen = slice(0, last - half if last < len(signals.times) else len(z))
    onset = None if begin is None else onset_of(signals.times, z[seen], half, frequency)
    return SpectralLine(
        frequency,
        begin,
        first=first,
        last=last,
        harmonics={},
        amplitudes=amplitudes,
        clear=clear,
        onset=onset,
    )


def _harmonic_share(signals: Signals, base: SpectralLine, order: int) -> float:
    """Largest amplitude of a multiple beside that of the oscillation itself, among the signals that show it well."""
    used = slice(base.first, base.last)
    t, x = signals.times[used], signals.values[used]
    whole = np.abs(phasors(t, x, [base.frequency]))
    part = np.abs(phasors(t, x, [order * base.frequency, base.frequency]))
    clear = whole > 0.5 * x.std(axis=0)
    return float((part[clear] / whole[clear]).max()) if clear.any() else 0.0

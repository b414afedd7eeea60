"""Whether what looks like one mode is several steady sines whose frequencies a record hardly tells apart."""

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from orchestrator.arrays import Complex, Numbers
from orchestrator.oscillations.detection import phasors

_COUNTS = 2, 3
_REACH = 4.0  # widths of a line, 1/T, around its frequency; one further off is found by itself
_SAMPLES = 128
_LEFT = 0.03
"""Part of the envelope's power that several sines may leave: planted ones left 0.005 and less. Three leave 0.016 and
more of a mode in noise that wanders, and 0.07 and more where they also leave no skirt."""

_SKIRT = 3.0  # power close beside the lines as a multiple of that further off: beside planted ones 0.6 to 1.1
_NOTHING = 1e-4  # left by sines without noise, beside which a skirt is what the fit itself leaves
_BETTER = 0.2  # of what one exponential leaves, from which on sines are the better account
_ALIKE = 2.0  # times what two leave, up to which sines are as good a one: two modes that ring down leave far less


def close_lines(times: Numbers, z: Numbers, values: Numbers, span: Numbers, frequency: float) -> list[float]:
    """Frequencies of two or three sines [Hz] that explain a signal and its complex envelope; none where none do.

    ``times``, ``z``: of the envelope about a frequency; ``span``, ``values``: of the signal itself."""
    length = float(times[-1] - times[0])
    some = np.unique(np.linspace(0, len(times) - 1, _SAMPLES).astype(int))
    t, z = (times[some] - times[0]) / length, z[some]
    one, two = (_exponentials(t, z, _sines(t, z, count)[0]) for count in (1, 2))
    most = min(_LEFT, _BETTER * one, max(_ALIKE * two, _NOTHING))
    for count in _COUNTS:
        offsets, left = _sines(t, z, count)
        lines = [frequency + float(x) / length for x in sorted(offsets)]
        if left < most and (left < _NOTHING or skirt(span, values, lines) < _SKIRT):
            return lines
    return []


def most_explained(t: Numbers, z: Complex, offsets: Numbers, count: int) -> tuple[Numbers, float]:
    """Which of many frequencies together explain most of z over 0 <= t <= 1, and which part of its power."""
    waves = np.exp(2j * np.pi * np.outer(t, offsets))
    chosen = np.array([*combinations(range(len(offsets)), count)])
    gram, seen = waves.conj().T @ waves, (waves.conj().T @ z)[chosen]
    solved = np.linalg.solve(gram[chosen[:, :, None], chosen[:, None, :]], seen[..., None])[..., 0]
    power = (seen.conj() * solved).real.sum(axis=1)
    best = int(power.argmax())
    return offsets[chosen[best]], float(power[best] / np.vdot(z, z).real)


def _sines(t: Numbers, z: Complex, count: int) -> tuple[Numbers, float]:
    """Their frequencies, and the part of the power that they leave."""
    first, _ = most_explained(t, z, np.arange(-_REACH, _REACH + 0.01, 0.25), count)
    return _fitted(lambda offsets: _left(t, z, 2j * np.pi * offsets), first)


def _exponentials(t: Numbers, z: Complex, offsets: Numbers) -> float:
    """Part of the power that as many exponentials, which decay or grow, leave."""
    n = len(offsets)
    starts = [np.concatenate([np.full(n, rate), offsets]) for rate in (-1.0, 1.0)]
    return min(_fitted(lambda x: _left(t, z, x[:n] + 2j * np.pi * x[n:]), start)[1] for start in starts)


def _left(t: Numbers, z: Complex, rates: Complex) -> float:
    waves = np.exp(np.outer(t, rates))
    rest = z - waves @ np.linalg.lstsq(waves, z, rcond=None)[0]
    return float(np.vdot(rest, rest).real / np.vdot(z, z).real)


def _fitted(left: Callable[[Numbers], float], first: Numbers) -> tuple[Numbers, float]:
    from scipy.optimize import minimize  # noqa: PLC0415 - slow to import

    best = minimize(left, first, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-6, "maxiter": 400})
    return best.x, float(best.fun)


def skirt(times: Numbers, values: Numbers, lines: Sequence[float]) -> float:
    """Mean power beside lines that are taken away, within five widths of them, as a multiple of that further off."""
    rest = values.copy()
    for k, frequency in enumerate(lines):
        amplitude = phasors(times, values[:, None], [frequency, *lines[:k], *lines[k + 1 :]])[0]
        rest -= np.real(amplitude * np.exp(2j * np.pi * frequency * times))
    line = np.polyfit(times - times.mean(), rest, 2)
    rest = (rest - np.polyval(line, times - times.mean())) * np.hanning(len(rest))
    power = np.abs(np.fft.rfft(rest)) ** 2
    length = len(times) * float(times[1] - times[0])
    grid = np.fft.rfftfreq(len(rest), length / len(times))
    apart = np.abs(grid[:, None] - np.array(lines)).min(axis=1) * length
    near, far = (apart > 1.5) & (apart < 5), (apart > 8) & (apart < min(25.0, 0.5 * lines[0] * length))
    return float(power[near].mean() / (power[far].mean() or 1e-300)) if near.any() and far.any() else 1.0

"""Whether what looks like one mode is several steady sines whose frequencies a record hardly tells apart."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from orchestrator.arrays import Numbers, Vector
from orchestrator.oscillations.detection import phasors

_REACH = 4.0  # widths of a line, 1/T, around its frequency; one further off is found by itself
_LEFT = 0.03  # part of the power that sines may leave: planted ones 0.005; of a mode in noise 0.07 without a skirt
_SKIRT = 3.0  # power close beside the lines as a multiple of that further off: beside planted ones 0.6 to 1.1
_NOTHING = 1e-4  # left by sines without noise, beside which a skirt is what the fit itself leaves
_BETTER = 0.2  # of what one exponential leaves, from which on sines are the better account
_ALIKE = 2.0  # times what two leave, up to which sines are as good a one: two modes that ring down leave far less


def close_lines(t: Numbers, z: Vector, times: Numbers, values: Numbers, frequency: float) -> list[float]:
    """Frequencies of two or three sines [Hz] that explain a signal and its envelope z over 0 <= t <= 1, or none."""
    one, two = (min(_fitted(t, z, count, [rate] * count)[1] for rate in (-1.0, 1.0)) for count in (1, 2))
    most = min(_LEFT, _BETTER * one, max(_ALIKE * two, _NOTHING))
    for count in (2, 3):
        offsets, left = _fitted(t, z, count)
        lines = [frequency + float(x) / (times[-1] - times[0]) for x in sorted(offsets)]
        if left < most and (left < _NOTHING or skirt(times, values, lines) < _SKIRT):
            return lines
    return []


def most_explained(t: Numbers, z: Vector, offsets: Numbers, count: int) -> tuple[Numbers, float]:
    """Which of many frequencies together explain most of z, and which part of its power."""
    waves = np.exp(2j * np.pi * np.outer(t, offsets))
    chosen = np.array([*combinations(range(len(offsets)), count)])
    gram, seen = waves.conj().T @ waves, (waves.conj().T @ z)[chosen]
    solved = np.linalg.solve(gram[chosen[:, :, None], chosen[:, None, :]], seen[..., None])[..., 0]
    power = (seen.conj() * solved).real.sum(axis=1)
    return offsets[chosen[power.argmax()]], float(power.max() / np.vdot(z, z).real)


def _fitted(t: Numbers, z: Vector, count: int, rates: Sequence[float] = ()) -> tuple[Numbers, float]:
    """Frequencies of sines, or with first rates of exponentials, and the part of the power that they leave."""
    from scipy.optimize import minimize  # noqa: PLC0415 - slow to import

    def left(x: Numbers) -> float:
        waves = np.exp(np.outer(t, 2j * np.pi * x[:count] + (x[count:] if rates else 0.0)))
        rest = z - waves @ np.linalg.lstsq(waves, z, rcond=None)[0]
        return float(np.vdot(rest, rest).real / np.vdot(z, z).real)

    first, _ = most_explained(t, z, np.arange(-_REACH, _REACH + 0.01, 0.25), count)
    best = minimize(left, [*first, *rates], method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-6, "maxfev": 700})
    return best.x[:count], float(best.fun)


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

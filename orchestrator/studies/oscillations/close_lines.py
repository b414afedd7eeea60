"""Lines that stand close beside a line of a spectrum, where a record hardly tells their frequencies apart."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.studies.oscillations.detection import phasors

_REACH = 4.0  # widths of a line, 1/T, around its frequency; one further off is found by itself
# part of the power that close lines may leave: planted ones 0.005; of a mode in noise 0.07
_LEFT = 0.03
# power close beside the lines as a multiple of that further off: beside planted ones 0.6 to 1.1
_SKIRT = 3.0
_NOTHING = 1e-4  # left by sines without noise, beside which a skirt is what the fit itself leaves
_BETTER = 0.3  # of what fewer leave, from which on more are the better account
# times what exponentials leave, up to which sines are as good an account: two modes leave far less
_ALIKE = 2.0
# power of one beside that of all, beyond which they cancel each other and explain nothing
_LARGEST = 4.0
# change of the logarithm of an amplitude over the record up to which it may be a sine's; up to
# half, is
_STEADY = 0.25
_SEEN = 0.01  # power beside that of all from which on one is told


@dataclass(frozen=True)
class _Lines:
    """Exponentials, or sines, that together explain the envelopes of several signals; the strongest first."""

    frequencies: Numbers  # [Hz]
    changes: Numbers  # of the logarithms of their amplitudes over the record
    powers: Numbers
    left: float  # part of the power that they leave

    def __str__(self) -> str:
        return ", ".join(map("{:.3f}".format, sorted(self.frequencies))) + " Hz"


def doubt(kind: str, times: Numbers, z: Numbers, values: Numbers, frequency: float) -> str:
    """Why what looks forced, or a mode, in signals and their envelopes z, shape (n, m), may not be; "" if nothing."""
    some = slice(None, None, max(1, len(z) // 64))
    z, t = z[some] / np.linalg.norm(z[some], axis=0), times[some]
    one, two, three = (_explained(t, z, frequency, count, free=True) for count in (1, 2, 3))
    found = one
    for more, fewer in ((two, one), (three, two)):
        found = more if more.left < _BETTER * fewer.left else found
    apart = np.abs(found.frequencies - frequency)
    near = apart <= max(1 / (t[-1] - t[0]), apart.min())
    change = np.abs(found.changes[near])
    close = len(apart) > 1 and found.left < _LEFT
    if kind == "forced":
        return (
            f"apart from others close by ({found}) it decays or grows"
            if close and change[0] > 0.5 * _STEADY
            else ""
        )
    sines, more = (_explained(t, z, frequency, count, free=False) for count in (2, 3))
    sines = more if more.left < _BETTER * sines.left else sines
    if sines.powers.max() < _LARGEST and sines.left < min(
        _LEFT, one.left, max(_ALIKE * found.left, _NOTHING)
    ):
        beside = np.median([skirt(times, x, sines.frequencies.tolist()) for x in values.T])
        if sines.left < _NOTHING or beside < _SKIRT:
            return f"steady sines at close frequencies ({sines}) would explain it as well"
    return (
        f"apart from others close by ({found}) it is steady"
        if close and change.min() < _STEADY
        else ""
    )


def most_explained(t: Numbers, z: Numbers, offsets: Numbers, count: int) -> tuple[Numbers, float]:
    """Which of many frequencies together explain most of signals z, shape (n, m), and which part of their power."""
    waves = np.exp(2j * np.pi * np.outer(t, offsets))
    chosen = np.array([*combinations(range(len(offsets)), count)])
    gram, seen = waves.conj().T @ waves, (waves.conj().T @ z)[chosen]
    solved = np.linalg.solve(gram[chosen[:, :, None], chosen[:, None, :]], seen)
    power = (seen.conj() * solved).real.sum(axis=(1, 2))
    return offsets[chosen[power.argmax()]], float(power.max() / np.vdot(z, z).real)


def _explained(times: Numbers, z: Numbers, frequency: float, count: int, *, free: bool) -> _Lines:
    """Fit the exponentials, or the sines, that leave least."""
    from scipy.optimize import least_squares  # noqa: PLC0415 - slow to import

    t, span = np.linspace(0, 1, len(z)), times[-1] - times[0]

    def solved(x: Numbers) -> tuple[Numbers, Numbers]:
        waves = np.exp(
            np.outer(t, 2j * np.pi * x[:count] + (np.clip(x[count:], -50, 50) if free else 0))
        )
        waves /= np.linalg.norm(waves, axis=0)
        sizes = np.linalg.lstsq(waves, z, rcond=None)[0]
        return z - waves @ sizes, sizes

    first, _ = most_explained(t, z, np.arange(-_REACH, _REACH + 0.01, 0.25), count)
    start = [*first, *[-1.0] * count * free]
    x = least_squares(
        lambda x: solved(x)[0].view(float).ravel(), start, method="lm", max_nfev=300
    ).x
    rest, sizes = solved(x)
    powers = (np.abs(sizes) ** 2).mean(axis=1)
    seen = [k for k in np.argsort(-powers) if powers[k] >= min(_SEEN, powers.max())]
    changes = x[count:][seen] if free else np.zeros(len(seen))
    left = float(np.vdot(rest, rest).real / z.shape[1])
    return _Lines(frequency + x[:count][seen] / span, changes, powers[seen], left)


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
    near, far = (
        (apart > 1.5) & (apart < 5),
        (apart > 8) & (apart < min(25.0, 0.5 * lines[0] * length)),
    )
    return (
        float(power[near].mean() / (power[far].mean() or 1e-300))
        if near.any() and far.any()
        else 1.0
    )

"""Lines that stand close beside a line of a spectrum, where a record hardly tells their frequencies apart."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
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
_STEEPEST = 50.0  # change of the logarithm of an amplitude over the record: more is a step
_EVALUATIONS = 300  # of a fit; most take some ten
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
    waves, chosen, inverses = _choices(t.tobytes(), offsets.tobytes(), count)
    seen = (waves.conj().T @ z)[chosen]
    power = (seen.conj() * (inverses @ seen)).real.sum(axis=(1, 2))
    return offsets[chosen[power.argmax()]], float(power.max() / np.vdot(z, z).real)


@lru_cache(maxsize=8)  # the same for all signals of one length, and of an archive all have one
def _choices(t: bytes, offsets: bytes, count: int) -> tuple[Numbers, Numbers, Numbers]:
    """Waves of all frequencies, which of them are together, and the inverses of these ones' Gram matrices."""
    frequencies = np.frombuffer(offsets)
    waves = np.exp(2j * np.pi * np.outer(np.frombuffer(t), frequencies))
    chosen = np.array([*combinations(range(len(frequencies)), count)])
    gram = waves.conj().T @ waves
    return waves, chosen, np.linalg.inv(gram[chosen[:, :, None], chosen[:, None, :]])


def _explained(times: Numbers, z: Numbers, frequency: float, count: int, *, free: bool) -> _Lines:
    """Fit the exponentials, or the sines, that leave least."""
    from scipy.optimize import least_squares  # noqa: PLC0415 - slow to import

    t, span = np.linspace(0, 1, len(z)), times[-1] - times[0]
    first, _ = most_explained(t, z, np.arange(-_REACH, _REACH + 0.01, 0.25), count)
    x = least_squares(
        lambda x: _projected(t, z, count, x).rest.view(float).ravel(),
        [*first, *[-1.0] * count * free],
        jac=lambda x: _projected(t, z, count, x).jacobian(),
        method="lm",
        max_nfev=_EVALUATIONS,
    ).x
    fit = _projected(t, z, count, x)
    rest, sizes = fit.rest, fit.sizes
    powers = (np.abs(sizes) ** 2).mean(axis=1)
    seen = [k for k in np.argsort(-powers) if powers[k] >= min(_SEEN, powers.max())]
    changes = x[count:][seen] if free else np.zeros(len(seen))
    left = float(np.vdot(rest, rest).real / z.shape[1])
    return _Lines(frequency + x[:count][seen] / span, changes, powers[seen], left)


@dataclass(frozen=True)
class _Projection:
    """Signals as sums of some waves, and what these leave; each number that says the waves is of one of them."""

    basis: Numbers  # shape (n, rank)
    sizes: Numbers  # of the waves in the signals, shape (count, m)
    rest: Numbers  # what the waves leave of the signals, shape (n, m)
    dual: Numbers  # conjugate transpose of the waves' pseudo-inverse, shape (n, count)
    slopes: Numbers  # of the waves, shape (n, numbers); number j is of wave j modulo count

    def jacobian(self) -> Numbers:
        """Derivatives of the rest, real and imaginary parts in turn, shape (2 n m, numbers).

        From Golub and Pereyra (1973), "The differentiation of pseudo-inverses and nonlinear least squares problems".
        """
        wave = np.arange(self.slopes.shape[1]) % len(self.sizes)
        across = self.slopes - self.basis @ (self.basis.conj().T @ self.slopes)
        seen = self.slopes.conj().T @ self.rest
        moved = across[:, None] * self.sizes.T[:, wave] + self.dual[:, None, wave] * seen.T
        return -np.stack([moved.real, moved.imag], axis=2).reshape(-1, len(wave))


def _projected(t: Numbers, z: Numbers, count: int, x: Numbers) -> _Projection:
    """Project signals on sines, or on exponentials where x has changes of their amplitudes behind the frequencies."""
    changes = np.clip(x[count:], -_STEEPEST, _STEEPEST)
    waves = np.exp(np.outer(t, 2j * np.pi * x[:count] + (changes if len(changes) else 0)))
    waves /= np.linalg.norm(waves, axis=0)
    left, strengths, right = np.linalg.svd(waves, full_matrices=False)
    rank = int((strengths > np.finfo(float).eps * len(t) * strengths[0]).sum())
    basis, inverse = left[:, :rank], right[:rank] / strengths[:rank, None]
    seen = basis.conj().T @ z
    along = t[:, None] * waves
    acts = np.abs(x[count:]) < _STEEPEST  # what is beyond it is cut off
    return _Projection(
        basis=basis,
        sizes=inverse.conj().T @ seen,
        rest=z - basis @ seen,
        dual=basis @ inverse,
        slopes=np.hstack(
            [2j * np.pi * along, along * acts] if len(changes) else [2j * np.pi * along]
        ),
    )


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

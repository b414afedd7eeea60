"""Margins of a loop: changes of gain, phase and delay in all its entries that bring an eigenvalue to −1; the disk's."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Numbers
from orchestrator.studies.immittance.loop import LoopPath

_LEAST = 1e-4  # loci that cross the axis nearer to 0 tell nothing
# part of its size by which a locus that begins on the real axis may leave it
_LEVEL = 0.05
_FLAT = 0.5  # part by which such a locus may change up to three times its first frequency
_TOUCHES = 1e-9  # distance from −1 of an undamped mode: rounding
_FREE = 0.01  # distance from −1 of the locus of a free angle near 0 Hz
_NEAR = 0.3  # distance from −1 up to which a locus may come from there
_SLOWEST = 0.05  # least frequency of a distance [Hz]: below, a free angle moves as far as one likes


@dataclass(frozen=True)
class Crossing:
    """Where a locus crosses the negative real axis: ``upwards`` as the frequency rises."""

    real: float
    frequency_hz: float
    upwards: bool


@dataclass(frozen=True)
class Margin:
    """A margin with the frequency [Hz] of the oscillation that it leaves."""

    value: float
    frequency_hz: float


@dataclass(frozen=True)
class NyquistMargins:
    """Least changes of the whole loop that put an eigenvalue on −1; of an unstable loop, what has to be changed."""

    # gain_up, gain_down: least factor above 1, and largest below; None where no locus crosses there.
    gain_up: Margin | None
    gain_down: Margin | None
    phase_deg: Margin | None  # least shift of the phase to either side [°]
    delay_s: Margin | None  # least delay [s]
    distance: Margin  # least singular value of 1 + L: the largest change of L in any direction
    # α of the symmetric disk: every entry may at once be multiplied by any f with |f − 1| < α/2·|f
    # + 1|
    disk: Margin

    @property
    def gain(self) -> Margin | None:
        both = [m for m in (self.gain_up, self.gain_down) if m is not None]
        return min(both, key=lambda m: abs(np.log(m.value)), default=None)


def crossings_of(path: LoopPath) -> list[Crossing]:
    """Crossings of the negative real axis by all loci on the imaginary axis, lowest frequency first."""
    found = []
    for k in range(path.loci.shape[1]):
        locus = path.loci[:, k]
        for i, t in _zeros(locus.imag):
            if path.on_axis[i] and path.on_axis[i + 1]:
                real = locus[i].real + t * (locus[i + 1].real - locus[i].real)
                if real < -_LEAST:
                    at = path.hertz[i] + t * (path.hertz[i + 1] - path.hertz[i])
                    found.append(
                        Crossing(float(real), float(at), bool(locus[i + 1].imag > locus[i].imag))
                    )
    return sorted(found, key=lambda c: c.frequency_hz)


def gains_of(path: LoopPath, crossings: list[Crossing]) -> list[Margin]:
    """Factors on the loop that put a locus on −1; at 0 Hz where it begins on the negative real axis and is level there,
    so that what grows does not swing."""
    later = int(np.argmax(path.on_axis & (path.hertz >= 3 * path.hertz[path.on_axis][0])))
    begins = [
        Margin(float(-1 / a.real), 0.0)
        for a, b in zip(path.loci[0], path.loci[later], strict=True)
        if a.real < -_LEAST
        and not _is_free(a, b)
        and abs(a.imag) < _LEVEL * abs(a)
        and abs(b - a) < _FLAT * abs(a)
    ]
    return [*begins, *(Margin(-1 / c.real, c.frequency_hz) for c in crossings)]


def _is_free(a: complex, b: complex) -> bool:
    """Return whether a locus comes from −1 at 0 Hz, as that of a free angle does: from its values at f and at 3·f."""
    return abs(1 + a) <= _FREE or (abs(1 + a) < _NEAR and abs(1 + b) > 2 * abs(1 + a))


def distance_of(path: LoopPath) -> Margin:
    """The distance from −1 of `margins_of` alone."""
    return _where_least(path, path.distance)


def gain_up_of(gains: list[Margin]) -> Margin | None:
    """The least factor above 1, of those that `gains_of` gives."""
    return _least([m for m in gains if m.value > 1])


def margins_of(path: LoopPath, crossings: list[Crossing]) -> NyquistMargins:
    gains = gains_of(path, crossings)
    down = max((m for m in gains if m.value <= 1), key=lambda m: m.value, default=None)
    turned, delayed = [], []
    for k in range(path.loci.shape[1]):
        locus = path.loci[:, k]
        for i, t in _zeros(np.log(np.maximum(np.abs(locus), 1e-300))):
            if path.on_axis[i] and path.on_axis[i + 1]:
                angle = np.angle(-locus[i]) + t * np.angle(locus[i + 1] / locus[i])
                hertz = float(path.hertz[i] + t * (path.hertz[i + 1] - path.hertz[i]))
                turned.append(Margin(float(abs(np.rad2deg(np.angle(np.exp(1j * angle))))), hertz))
                delayed.append(Margin(float(angle % (2 * np.pi) / (2 * np.pi * hertz)), hertz))
    counted = where_distance_counts(path)
    one, disk = np.eye(path.L.shape[-1]), np.full(len(path.s), np.inf)
    disk[counted & (path.distance <= _TOUCHES)] = 0.0
    counted = counted & (path.distance > _TOUCHES)
    disk[counted] = 1 / np.linalg.norm(
        np.linalg.inv(one + path.L[counted]) - one / 2, ord=2, axis=(1, 2)
    )
    return NyquistMargins(
        gain_up_of(gains),
        down,
        _least(turned),
        _least(delayed),
        distance_of(path),
        _where_least(path, disk),
    )


def _zeros(values: Numbers) -> list[tuple[int, float]]:
    """Intervals in which values change their sign, and where in each."""
    places = np.flatnonzero((values[:-1] < 0) != (values[1:] < 0))
    return [(int(i), float(values[i] / (values[i] - values[i + 1]))) for i in places]


def _least(margins: list[Margin]) -> Margin | None:
    return min(margins, key=lambda m: m.value, default=None)


def where_distance_counts(path: LoopPath) -> NDArray[np.bool_]:
    """Where a distance counts: from the slowest frequency on, and where a free angle's locus still comes away from −1,
    from there on where it no longer does."""
    counted = path.on_axis & (path.hertz >= min(_SLOWEST, path.hertz[-1]))
    later = int(np.argmax(path.on_axis & (path.hertz >= 3 * path.hertz[path.on_axis][0])))
    if any(_is_free(a, b) for a, b in zip(path.loci[0], path.loci[later], strict=True)):
        first = int(np.argmax(counted))
        falls = np.flatnonzero(np.diff(path.distance[first:]) < 0)
        counted[first : first + (int(falls[0]) if len(falls) else 0)] = False
    return np.asarray(counted)


def _where_least(path: LoopPath, values: Numbers) -> Margin:
    k = int(np.argmin(np.where(where_distance_counts(path), values, np.inf)))
    return Margin(float(values[k]), float(path.hertz[k]))


def margins_json(m: NyquistMargins | None) -> dict[str, Any]:
    keys = ("gain", "gain_up", "gain_down", "phase_deg", "delay_s", "distance", "disk")
    found = {key: None if m is None else getattr(m, key) for key in keys}
    return {key: None if one is None else vars(one) for key, one in found.items()}

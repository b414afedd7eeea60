"""The loop of a cut, L = Z·Y over s = jω: its eigenvalues, and how often they and det(1 + L) go around."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment

from orchestrator.arrays import Complex, Numbers, Vector
from orchestrator.immittance.sides import Exact, Side

_STEP = np.deg2rad(25.0)  # largest turn of det(1 + L) from one point of the path to the next
_ROUNDS = 12
_WITHIN = 6  # points between two frequencies of a scan at first
_ARC = 1e-4  # radius of the way round a pole on the axis, relative to the pole


@dataclass(frozen=True)
class SeriesCapacitors:
    """Capacitors in series at the one port of the cut, in a frame whose q axis leads."""

    reactance: float  # at the rated frequency [Ω or pu]
    omega: float  # rated frequency [rad/s]; the dq impedance has its pole at ±j·omega

    def at(self, s: Vector) -> Complex:
        """Impedance, shape (f, 2, 2)."""
        x, w = self.reactance, self.omega
        down = s**2 + w**2
        along, cross = x * w * s / down, x * w**2 / down
        return np.stack([np.stack([along, cross], -1), np.stack([-cross, along], -1)], -2)


def _det(L: Complex) -> Complex:
    """Of 1 + L; where a free angle's pole makes it 0 to the last digit, next to nothing."""
    found = np.linalg.det(np.eye(L.shape[-1]) + L)
    return np.asarray(np.where(found == 0, 1e-100, found))


@dataclass(frozen=True)
class LoopPath:
    s: Vector  # points [1/s], shape (f,); round a pole on the axis they leave it to the right
    # L, loci: shapes (f, n, n) and (f, n); each column of ``loci`` is one eigenvalue followed along the way.
    L: Complex
    loci: Complex

    @property
    def hertz(self) -> Numbers:
        return np.asarray(self.s.imag / (2 * np.pi))

    @cached_property
    def det(self) -> Complex:
        return _det(self.L)

    @property
    def turns(self) -> Numbers:
        """Turn of det(1 + L) from point to point [rad]."""
        return np.asarray(np.angle(self.det[1:] / self.det[:-1]))

    @cached_property
    def distance(self) -> Numbers:
        """Smallest singular value of 1 + L: how far L is from a matrix with the eigenvalue −1."""
        return np.asarray(np.linalg.svd(np.eye(self.L.shape[-1]) + self.L, compute_uv=False)[:, -1])

    @property
    def on_axis(self) -> Numbers:
        return np.asarray(self.s.real == 0)


@dataclass(frozen=True)
class CutLoop:
    """A device's admittance at a network's impedance, with capacitors in series."""

    device: Side
    network: Side
    capacitors: SeriesCapacitors | None = None

    @property
    def is_exact(self) -> bool:
        return self.device.is_exact and self.network.is_exact

    def values(self, s: Vector) -> Complex:
        """L at points on the axis, or close beside it."""
        return np.asarray(self.impedance(s) @ self.device.at(s))

    def impedance(self, s: Vector) -> Complex:
        Z = self.network.at(s)
        return Z if self.capacitors is None else Z + self.capacitors.at(s)

    def path(self, nodes: Numbers) -> LoopPath:
        """The loop along the axis between the first and the last of some frequencies [Hz], as finely as it turns."""
        between = [np.linspace(a, b, _WITHIN, endpoint=False) for a, b in pairwise(nodes.tolist())]
        w = 2 * np.pi * np.unique(np.concatenate([*between, nodes[-1:]]))
        s = self._round_the_pole(1j * w)
        if self.is_exact:
            s = np.concatenate([w[0] * np.exp(1j * np.linspace(0, np.pi / 2, 17))[:-1], s])
        L = self.values(s)
        for _ in range(_ROUNDS):
            det = _det(L)
            wide = np.flatnonzero(np.abs(np.angle(det[1:] / det[:-1])) > _STEP)
            if not len(wide) or len(s) > 200_000:
                break
            middle = (s[wide] + s[wide + 1]) / 2
            L = np.insert(L, wide + 1, self.values(middle), axis=0)
            s = np.insert(s, wide + 1, middle)
        return LoopPath(s, L, followed(np.linalg.eigvals(L)))

    def _round_the_pole(self, s: Vector) -> Complex:
        """The path with an arc to the right of the capacitors' pole, and points ever closer to it on both sides."""
        if self.capacitors is None or not s[0].imag < self.capacitors.omega < s[-1].imag:
            return s
        w = self.capacitors.omega
        near = np.geomspace(_ARC * w, 0.02 * w, 60)
        arc = 1j * w + _ARC * w * np.exp(1j * np.linspace(-np.pi / 2, np.pi / 2, 31))[1:-1]
        below, above = 1j * (w - near[::-1]), 1j * (w + near)
        outside = s[np.abs(s.imag - w) > 0.02 * w]
        first, last = s[0].imag, s[-1].imag
        sides = [p[(p.imag >= first) & (p.imag <= last)] for p in (below, above)]
        low = np.sort_complex(np.concatenate([outside[outside.imag < w], sides[0]]))
        high = np.sort_complex(np.concatenate([outside[outside.imag > w], sides[1]]))
        return np.concatenate([low, arc, high])


def followed(eigenvalues: Vector) -> Complex:
    """Eigenvalues with each column one of them, followed from point to point by the least sum of distances."""
    found = eigenvalues.copy()
    n = found.shape[1]
    for k in range(1, len(found)):
        before, now = found[k - 1], found[k]
        if n == 2:
            straight, crossed = np.abs(now - before).sum(), np.abs(now[::-1] - before).sum()
            if crossed < straight:
                found[k] = now[::-1]
        else:
            far = np.abs(before[:, None] - now[None, :])
            found[k] = now[linear_sum_assignment(far)[1]]
    return found


def nodes_of(device: Side, network: Side, lowest_hz: float, highest_hz: float) -> Numbers:
    """Frequencies [Hz] at which both sides are best known, in their common range; dense around poles where exact."""
    found = [np.geomspace(lowest_hz, highest_hz, 200)]
    for side in (device, network):
        if isinstance(side, Exact):
            at, wide = np.abs(side.poles.imag) / (2 * np.pi), np.abs(side.poles.real) / (2 * np.pi)
            found += [at + k * wide for k in (-3, -1, -0.5, 0, 0.5, 1, 3)]
        else:
            found.append(side.frequencies)
    if not (device.is_exact and network.is_exact):
        found = found[1:]
    together = np.unique(np.concatenate(found))
    return np.asarray(together[(together >= lowest_hz) & (together <= highest_hz)])


def common_range(device: Side, network: Side, exact: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest frequency [Hz] at which both sides are known."""
    ranges = [(s.frequencies[0], s.frequencies[-1]) for s in (device, network) if not s.is_exact] or [exact]
    return max(low for low, _ in ranges), min(high for _, high in ranges)

"""The loop of a cut, L = Z·Y over s = jω: its eigenvalues, and how often they and det(1 + L) go around."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from orchestrator.core.arrays import Complex, Flags, Numbers, Vector
from orchestrator.studies.immittance.sides import ON_AXIS, Known, Side, Together, Unit

_STEP = np.deg2rad(25.0)  # largest turn of det(1 + L) from one point of the path to the next
_AT_A_BUS = np.deg2rad(60.0)  # the same of the loop at one bus of several
# turns of the determinant and of the loci, added up, differ by less [rad] where loci are followed
# rightly
_ALIKE = 0.1
_ROUNDS = 14  # halvings between two frequencies, at most
_MOST = 60_000  # frequencies at which no more are put in between
_AT_ONCE = 500  # frequencies whose matrices are inverted at a time: bounds the memory
_ROUND = 1e-6  # radius of the way round an undamped pole of a model, relative to it
_NARROW = 0.5  # poles damped by less than this part have points of their own
_WITHIN = 6  # points between two frequencies at first
_ENOUGH = 1000  # frequencies from which on none is put in between at first
_FALLS = 0.3  # part to which det(1 + L) of a free angle falls at least from 1e-3 to 1e-4 rad/s
_ARC = 1e-4  # radius of the way round a pole on the axis, relative to the pole

NO_MODES: Complex = np.zeros(0, dtype=complex)


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
    """Return det(1 + L); where a free angle's pole makes it 0 to the last digit, next to nothing."""
    found = np.linalg.det(np.eye(L.shape[-1]) + L)
    return np.asarray(np.where(found == 0, 1e-100, found))


@dataclass(frozen=True)
class LoopPath:
    s: Vector  # points [1/s], shape (f,); round a pole on the axis they leave it to the right
    # L, loci: shapes (f, n, n) and (f, n); each column of ``loci`` is one eigenvalue followed along the way.
    L: Complex
    loci: Complex
    lead: float = 0.0  # as of `CutLoop`

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

    @cached_property
    def loci_turns(self) -> Numbers:
        """Turns of all 1 + λ from point to point, added up [rad]: that of the determinant, or whole turns from it."""
        return np.asarray(np.angle((1 + self.loci[1:]) / (1 + self.loci[:-1])).sum(axis=1))

    def at_bus(self, k: int) -> "LoopPath":
        """The loop of the devices at one bus of several against all else: 1 + L there is S⁻¹, S that block of
        (1 + L)⁻¹."""
        L = np.asarray(np.linalg.inv(self._blocks[:, k]) - np.eye(2), dtype=complex)
        return LoopPath(self.s, L, followed(np.linalg.eigvals(L)))

    @cached_property
    def _blocks(self) -> Complex:
        return _at_buses(self.L)

    @property
    def buses(self) -> int:
        return int(self.L.shape[-1] // 2)


def _at_buses(L: Complex) -> Complex:
    """Blocks of (1 + L)⁻¹ at each bus, shape (f, buses, 2, 2)."""
    n, found = L.shape[-1], []
    k = np.arange(n // 2)
    for first in range(0, len(L), _AT_ONCE):
        S = np.linalg.inv(np.eye(n) + L[first : first + _AT_ONCE]).reshape(-1, n // 2, 2, n // 2, 2)
        found.append(np.moveaxis(S[:, k, :, k, :], 0, 1))
    return np.concatenate(found)


@dataclass(frozen=True)
class CutLoop:
    """A device's admittance at a network's impedance, with capacitors in series."""

    device: Side
    network: Side
    capacitors: SeriesCapacitors | None = None
    # of det(1 + L) before the real axis at the lowest frequency of a scan [rad]: a quarter turn where an angle is free,
    # so that it begins as c·s
    lead: float = 0.0

    @property
    def is_exact(self) -> bool:
        return self.device.is_exact and self.network.is_exact

    @property
    def units(self) -> tuple[Unit, ...]:
        return self.device.units if isinstance(self.device, Together) else ()

    @property
    def fastest(self) -> float:
        """Size of the largest pole of the exact sides [rad/s]."""
        sides = [x.poles for x in (self.device, self.network) if isinstance(x, Known)]
        return max((float(np.abs(poles).max(initial=0.0)) for poles in sides), default=0.0)

    def values(self, s: Vector) -> Complex:
        """L at points on the axis, or close beside it."""
        return np.asarray(self.impedance(s) @ self.device.at(s))

    @property
    def lead_at_rest(self) -> float:
        """The lead of a loop of two models: a quarter turn where det(1 + L) falls as s does."""
        slow, slower = np.abs(_det(self.values(np.array([1e-3j, 1e-4j]))))
        return np.pi / 2 if slower < _FALLS * slow else 0.0

    def impedance(self, s: Vector) -> Complex:
        Z = self.network.at(s)
        return Z if self.capacitors is None else Z + self.capacitors.at(s)

    def path(self, nodes: Numbers) -> LoopPath:
        """The loop along the axis between the first and the last of some frequencies [Hz], as finely as it turns."""
        within = 1 if self.is_exact and len(nodes) > _ENOUGH else _WITHIN
        between = [np.linspace(a, b, within, endpoint=False) for a, b in pairwise(nodes.tolist())]
        w = 2 * np.pi * np.unique(np.concatenate([*between, nodes[-1:]]))
        s = self._round_the_pole(1j * w)
        if self.is_exact:
            s = np.concatenate([w[0] * np.exp(1j * np.linspace(0, np.pi / 2, 17))[:-1], s])
            for pole in self._on_axis(w[0], w[-1]).tolist():
                far = 1j * _ROUND * pole * np.geomspace(1, 1e4, 30)
                arc = _ROUND * pole * np.exp(1j * np.linspace(-np.pi / 2, np.pi / 2, 31))[1:-1]
                s = np.concatenate(
                    [
                        s[np.abs(s.imag - pole) > 3 * _ROUND * pole],
                        *(1j * pole + x for x in (far, -far, arc)),
                    ]
                )
                s = s[np.argsort(s.imag)]
        L = self.values(s)
        marks = self._marks(L)
        most = [_STEP, *[_AT_A_BUS] * (marks.shape[1] - 1)]
        path: LoopPath | None = None
        for _ in range(_ROUNDS):
            wide = (np.abs(np.angle(marks[1:] / marks[:-1])) > most).any(axis=1)
            path = None if wide.any() else LoopPath(s, L, followed(np.linalg.eigvals(L)), self.lead)
            places = np.flatnonzero(
                wide if path is None else np.abs(path.loci_turns - path.turns) > _ALIKE
            )
            if not len(places) or len(s) > _MOST:
                break
            middle = (s[places] + s[places + 1]) / 2
            more = self.values(middle)
            s = np.insert(s, places + 1, middle)
            L, marks = (
                np.insert(a, places + 1, b, axis=0)
                for a, b in ((L, more), (marks, self._marks(more)))
            )
        return (
            path
            if path and len(path.s) == len(s)
            else LoopPath(s, L, followed(np.linalg.eigvals(L)), self.lead)
        )

    def _on_axis(self, low: float, high: float) -> Numbers:
        """Undamped poles of the exact sides [rad/s], those of one place once."""
        poles = np.concatenate(
            [NO_MODES, *(x.poles for x in (self.device, self.network) if isinstance(x, Known))]
        )
        w = np.sort(
            poles.imag[
                (np.abs(poles.real) <= ON_AXIS * poles.imag)
                & (poles.imag > low)
                & (poles.imag < high)
            ]
        )
        return np.asarray(w[np.diff(w, prepend=0.0) > 0.3 * _ROUND * w])

    def _marks(self, L: Complex) -> Complex:
        """Return what must turn little from point to point: det(1 + L), also of the loop at each of several buses."""
        det = _det(L)[:, None]
        return (
            np.hstack([det, np.linalg.det(_at_buses(L))])
            if self.is_exact and L.shape[-1] > 2
            else det
        )

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
    if n == 2:
        crosses = _crossings(found)
        found[crosses] = found[crosses, ::-1]
        return found
    for k in range(1, len(found)):
        from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - half a second to import

        far = np.abs(found[k - 1][:, None] - found[k][None, :])
        found[k] = found[k][linear_sum_assignment(far)[1]]
    return found


def _crossings(pairs: Vector) -> Flags:
    """Where the two of a point change places: each differs from the point before as it stands by then."""
    straight = np.abs(pairs[1:] - pairs[:-1]).sum(axis=1)
    crossed = np.abs(pairs[1:, ::-1] - pairs[:-1]).sum(axis=1)
    changes, stays = crossed < straight, straight < crossed
    found, is_changed = [False], False
    for change, stay in zip(changes.tolist(), stays.tolist(), strict=True):
        # where neither is nearer, a point stays as it is
        is_changed = stay if is_changed else change
        found.append(is_changed)
    return np.array(found)


def nodes_of(
    device: Side, network: Side, lowest_hz: float, highest_hz: float, modes: Complex = NO_MODES
) -> Numbers:
    """Frequencies [Hz] at which both sides are best known, in their common range; dense around narrow poles where
    exact, and around what is known of the closed system's ``modes`` [rad/s]."""
    found = [side.frequencies for side in (device, network) if not side.is_exact]
    found = found or [np.geomspace(lowest_hz, highest_hz, 400)]
    poles = [x.poles for x in (device, network) if isinstance(x, Known)]
    for narrow in (*poles, modes):
        kept = narrow[(narrow.imag > 0) & (np.abs(narrow.real) < _NARROW * narrow.imag)]
        kept = np.unique(np.round(kept, 6))
        at, wide = kept.imag / (2 * np.pi), np.abs(kept.real) / (2 * np.pi)
        found += [at + k * wide for k in (-3, -1, -0.4, 0.4, 1, 3)]
    together = np.unique(np.concatenate(found))
    return np.asarray(together[(together >= lowest_hz) & (together <= highest_hz)])


def common_range(device: Side, network: Side, exact: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest frequency [Hz] at which both sides are known."""
    ranges = [
        (s.frequencies[0], s.frequencies[-1]) for s in (device, network) if not s.is_exact
    ] or [exact]
    return max(low for low, _ in ranges), min(high for _, high in ranges)

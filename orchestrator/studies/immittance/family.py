"""Loops as functions of one parameter: from a few of them to those between, and what each says."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orchestrator.core.arrays import Complex, Numbers, Vector
from orchestrator.studies.immittance.judgement import encirclements
from orchestrator.studies.immittance.loop import LoopPath, followed
from orchestrator.studies.immittance.margins import (
    crossings_of,
    distance_of,
    gain_up_of,
    gains_of,
)
from orchestrator.studies.immittance.poles import fits

_TURN = np.deg2rad(4.0)  # turn of det(1 + L) between two of the frequencies that are kept of a scan
# relative error of a loop that was scanned below which no further one is gone through
_FITTED = 1e-6
_EVERYWHERE = 2 * np.pi * np.geomspace(0.1, 1000, 15)
"""Frequencies around which modes are sought [rad/s]."""

_WINDOW = 0.5  # reach to both sides of such a frequency, in its natural logarithm
_WITHIN = 60  # points that are fitted within the reach
_LEAST = 12  # points without which nothing is fitted
_SAME_MODE = 0.02  # relative distance up to which two findings are one mode
# relative distance from the rated frequency up to which a mode is a direct current of the network
_DIRECT = 0.02


@dataclass(frozen=True)
class LoopFigures:
    """``distance`` from −1, negative where it is unstable, NaN where that is not known; ``frequency_hz`` of it;
    ``mode`` [rad/s] near the axis that is damped least, if one is; ``weaker``: factor on the network's impedance at
    which stability is lost, infinite for none, below 1 where it has to become smaller."""

    distance: float
    frequency_hz: float
    mode: complex | None
    weaker: float

    @property
    def damping(self) -> float:
        """[%]; NaN without a mode."""
        return math.nan if self.mode is None else -100 * self.mode.real / abs(self.mode)


def figures_of(path: LoopPath, growing: int | None, rated: float) -> LoopFigures:
    """Return the figures of a loop with so many growing modes; None where that is not known. The decaying direct
    current of network and stators, which in dq swings at the rated frequency, is no mode that is meant."""
    gains, distance = gains_of(path, crossings_of(path)), distance_of(path)
    sign = _sign(growing)
    modes = [p for p in light_modes(path) if abs(p.imag - rated) > _DIRECT * rated]
    modes = [p for p in modes if p.real < 0 or not sign > 0]  # the count knows better what grows
    mode = None if not modes or (sign < 0 and modes[0].real < 0) else modes[0]
    beyond = [gain.value for gain in gains if gain.value < 1]
    gain_up = gain_up_of(gains)
    up = gain_up.value if gain_up else math.inf
    weaker = up if sign > 0 else min(beyond, default=math.nan)
    return LoopFigures(sign * distance.value, distance.frequency_hz, mode, weaker)


def _sign(growing: int | None) -> float:
    if growing is None or growing < 0:
        return math.nan
    return 1.0 if growing == 0 else -1.0


def light_modes(path: LoopPath, centres: Numbers = _EVERYWHERE) -> list[complex]:
    """Zeros of det(1 + L) near the axis [rad/s], least damped first, sought around some frequencies [rad/s]."""
    on_axis = np.logical_and(path.on_axis, path.s.imag > 0)
    s, inverse = path.s[on_axis], 1 / path.det[on_axis][:, None]
    found: list[complex] = []
    for w in centres.tolist():
        window = np.flatnonzero(np.abs(np.log(s.imag / w)) < _WINDOW)
        window = window[:: -(-len(window) // _WITHIN)] if len(window) else window
        if len(window) < _LEAST:
            continue
        fitted = [poles for poles, _ in fits(s[window], inverse[window])]
        coarse, fine = fitted[max(len(fitted) - 2, 0)], fitted[-1]
        for p in fine[np.abs(fine.imag - w) < _WINDOW * w].tolist():
            apart = _SAME_MODE * abs(p)
            same = np.abs(coarse - p).min() < apart and all(abs(p - q) > apart for q in found)
            if same and abs(p.real) < 0.5 * p.imag:
                found.append(p)
    return sorted(found, key=lambda p: -p.real / abs(p))


@dataclass(frozen=True)
class Family:
    """Loops over a path as functions of a parameter, rational with one denominator for all entries at each frequency.

    ``nodes``: Values of the parameter that were scanned, rising, shape (n,).
    ``loops``: Shape (n, f, m, m)."""

    nodes: Numbers
    s: Vector
    loops: Complex
    poles: tuple[int, ...]  # unstable poles of the open loop, at each node
    exact: bool
    rated: float  # [rad/s]
    lead: float = 0.0  # as of `CutLoop`

    def at(self, value: float) -> LoopPath:
        here = np.flatnonzero(self.nodes == value)
        return self._path(self.loops[here[0]] if len(here) else self._mixed(value, *self._fitted))

    def distance(self, value: float) -> float:
        """From −1, as `LoopFigures` has it."""
        path, growing = self._path_and_growth(value)
        return _sign(growing) * distance_of(path).value

    def figures(self, value: float) -> LoopFigures:
        return figures_of(*self._path_and_growth(value), self.rated)

    def _path_and_growth(self, value: float) -> tuple[LoopPath, int | None]:
        path = self.at(value)
        k = int(np.clip(np.searchsorted(self.nodes, value), 0, len(self.nodes) - 1))
        beside = {k} if self.nodes[k] == value else {max(k - 1, 0), k}
        # Between two scans the open loop has as many unstable poles as at one of them, the closed one as many, too.
        possible = {self._count(path) + self.poles[i] for i in beside} & {
            self._growing[i] for i in beside
        }
        return path, possible.pop() if len(possible) == 1 else None

    @cached_property
    def _growing(self) -> list[int]:
        return [self._count(self._path(L)) + n for L, n in zip(self.loops, self.poles, strict=True)]

    def _count(self, path: LoopPath) -> int:
        """Encirclements; far below 0 where it is counted in two ways and they do not agree."""
        by_determinant, by_loci = encirclements(path, exact=self.exact)
        return by_determinant if by_determinant == by_loci else -(10**6)

    def without(self, value: float) -> "Family":
        kept = self.nodes != value
        return Family(
            self.nodes[kept],
            self.s,
            loops=self.loops[kept],
            poles=tuple(np.array(self.poles)[kept].tolist()),
            exact=self.exact,
            rated=self.rated,
            lead=self.lead,
        )

    def _path(self, L: Complex) -> LoopPath:
        return LoopPath(self.s, L, followed(np.linalg.eigvals(L)), self.lead)

    def _mixed(self, value: float, support: list[int], weights: Complex) -> Complex:
        shares = weights / (value - self.nodes[support])
        return np.asarray(
            np.einsum("fk,kfab->fab", shares, self.loops[support])
            / shares.sum(axis=1)[:, None, None]
        )

    @cached_property
    def _fitted(self) -> tuple[list[int], Complex]:
        """Nodes that the functions go through, as few as meet the others, and their weights, shape (f, nodes)."""
        n, size = len(self.nodes), np.linalg.norm(self.loops, axis=(2, 3)).max(axis=0)
        support = [0, n - 1]
        while True:
            others = np.setdiff1d(np.arange(n), support)
            differences = self.loops[others][:, None] - self.loops[support][None]
            loewner = (
                differences
                / (self.nodes[others][:, None] - self.nodes[support][None])[..., None, None, None]
            )
            rows = np.moveaxis(loewner.reshape(*loewner.shape[:3], -1), (2, 0, 3, 1), (0, 1, 2, 3))
            rows = rows.reshape(len(self.s), -1, len(support))
            weights = np.linalg.svd(np.swapaxes(rows.conj(), 1, 2) @ rows)[2][:, -1].conj()
            missed = [
                (
                    np.linalg.norm(
                        self._mixed(self.nodes[k], support, weights) - self.loops[k], axis=(1, 2)
                    )
                    / size
                ).max()
                for k in others.tolist()
            ]
            if len(support) > len(others) or max(missed) < _FITTED:
                return support, weights
            support.append(int(others[np.argmax(missed)]))


def kept_points(path: LoopPath) -> Complex:
    """Points of a path between which det(1 + L) turns little."""
    turned = np.r_[0.0, np.cumsum(np.abs(path.turns))]
    kept = np.r_[True, np.diff(np.floor(turned / _TURN)) > 0]
    kept[[-1, int(np.argmin(path.distance))]] = True
    return np.asarray(path.s[kept | np.roll(kept, -1)])

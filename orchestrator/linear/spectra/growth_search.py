"""Search for every growing mode of a system that is too large for its full spectrum: sparse search of the whole right
half-plane.

The half-plane is cut into sectors of rings around 0. Arnoldi's method on (A − σI)⁻¹ around the middle σ of a sector
gives the eigenvalues nearest to it; the sector is done when they reach beyond its edge, and is cut where they do not.
Modes of a step map that grow by a tenth or more in each step stand out: Arnoldi's method on A alone finds them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.block_arnoldi import VectorRoom
from orchestrator.linear.spectra.critical_modes import Search, nearest_pairs
from orchestrator.linear.spectra.modes import Mode, make_mode

# least eigenvalue looked for [rad/s]: smaller grow by less than 0.01 a second
SLOWEST = 2 * np.pi * 1e-3
FASTEST = 2 * np.pi * 1e5  # largest eigenvalue of a continuous model that is looked for [rad/s]
_RING = 1.6  # ratio of the radii of a ring
# numbers of eigenvalues to find around one point: the first number and the largest one
_AT_A_TIME = (20, 80)
_STANDS_OUT = 1.1  # multipliers of a step map beyond this size are found as the largest ones
_THINNEST = 1e-3  # smallest size of a sector, relative to its radius
_REAL = 1e-6
"""Part of an eigenvalue up to which its imaginary part is rounding: a search around a complex point leaves one to real
eigenvalues, of either sign."""

_BESIDE = 1e-4  # part of an eigenvalue by which the point that gives its vectors lies beside it
_NEAREST = 2  # so many modes are found there, of which one is it


@dataclass(frozen=True)
class GrowthSearch:
    """The growing modes of a system.

    ``eigenvalues``: All of them [rad/s], one of each pair, fastest growth first.
    ``fastest``: The mode that grows fastest; None if none grows.
    ``not_searched``: A sentence on the region that was not searched."""

    eigenvalues: tuple[complex, ...]
    fastest: Mode | None
    not_searched: str


@dataclass(frozen=True)
class _Sector:
    """|λ| from ``inner`` to ``outer`` [rad/s], angle of λ from ``low`` to ``high`` [rad]."""

    inner: float
    outer: float
    low: float
    high: float

    @property
    def centre(self) -> complex:
        return complex((self.inner + self.outer) / 2 * np.exp(1j * (self.low + self.high) / 2))

    @property
    def edge(self) -> NDArray[np.complex128]:
        angles, radii = np.linspace(self.low, self.high, 9), np.linspace(self.inner, self.outer, 9)
        arcs = [r * np.exp(1j * angles) for r in (self.inner, self.outer)]
        rays = [radii * np.exp(1j * a) for a in (self.low, self.high)]
        return np.concatenate([*arcs, *rays])

    def holds(self, value: complex) -> bool:
        """Tell if a point lies in the sector, which includes its lower edges but not the upper ones. The last sector of
        a ring includes the imaginary axis."""
        angle = float(np.angle(value))
        return self.inner <= abs(value) < self.outer and self.low <= angle < self.high

    def parts(self) -> tuple["_Sector", ...]:
        radius, angle = float(np.sqrt(self.inner * self.outer)), (self.low + self.high) / 2
        return tuple(
            _Sector(inner, outer, low, high)
            for inner, outer in ((self.inner, radius), (radius, self.outer))
            for low, high in ((self.low, angle), (angle, self.high))
        )


def find_growing_modes(model: LinearModel) -> GrowthSearch:
    """Every mode that grows, of a step map or continuous matrix of any size. Only the fastest gets its vectors."""
    H = model.step_size
    farthest = FASTEST if H is None else np.pi / H
    rings = 1 + int(np.ceil(np.log(farthest / SLOWEST) / np.log(_RING)))
    radii = np.geomspace(SLOWEST, farthest, rings).tolist()
    limit = np.inf if H is None else np.log(_STANDS_OUT) / H
    found = [] if H is None else _standing_out(model, H)
    waiting = [sector for inner, outer in pairwise(radii) for sector in _ring(inner, outer, limit)]
    rooms = (VectorRoom(), VectorRoom())
    while waiting:
        sector = waiting.pop()
        values = _values_in(model, sector, rooms)
        if values is None:
            if sector.outer - sector.inner < _THINNEST * sector.outer:
                here = f"{_AT_A_TIME[1]} modes lie at {sector.centre:.4g} rad/s"
                raise AnalysisError(f"more than {here}; compute the full spectrum instead")
            waiting += sector.parts()
        else:
            found += [value for value in values if value.real <= limit]
    found.sort(key=lambda value: -value.real)
    beyond = f"|λ| below {SLOWEST:.2g} rad/s and above {farthest:.3g} rad/s were not searched"
    return GrowthSearch(tuple(found), _mode_at(model, found[0]) if found else None, beyond)


def _mode_at(model: LinearModel, found: complex) -> Mode:
    """The mode whose eigenvalue [rad/s] was found."""
    pairs = nearest_pairs(model, found + _BESIDE * abs(found), _NEAREST)
    return make_mode(*min(pairs, key=lambda pair: abs(pair[0] - found)), model.names)


def _ring(inner: float, outer: float, limit: float) -> list[_Sector]:
    """The sectors of a ring with real parts up to a limit [1/s]; those of a wide ring are two."""
    low = float(np.arccos(min(1.0, limit / inner)))
    middle = (np.pi / 4,) if low < np.pi / 8 else ()
    # A little below 0, which puts eigenvalues on the real axis inside a sector.
    angles = (low - _REAL, *middle, np.pi / 2)
    return [_Sector(inner, outer, *between) for between in pairwise(angles)]


def _standing_out(model: LinearModel, step_size: float) -> list[complex]:
    """Eigenvalues of a step map that grow so fast that their multipliers are far larger than all others."""
    n = len(model.names)
    step = spla.LinearOperator((n, n), matvec=model.apply, dtype=float)
    start = np.random.default_rng(0).standard_normal(n)
    count = _AT_A_TIME[0]
    try:
        mu = spla.eigs(
            step, k=count, ncv=3 * count, maxiter=30, tol=1e-6, v0=start, return_eigenvectors=False
        )
    except spla.ArpackNoConvergence as error:
        mu = error.eigenvalues  # the largest multipliers converge first
    mu = mu[(np.abs(mu) > _STANDS_OUT) & (mu.imag >= 0)]
    if len(mu) == count:
        raise AnalysisError(
            f"more than {count} modes grow by a tenth in each communication step; take a shorter one"
        )
    return [complex(np.log(value.astype(complex)) / step_size) for value in mu]


def _values_in(
    model: LinearModel, sector: _Sector, rooms: tuple[VectorRoom, VectorRoom]
) -> list[complex] | None:
    """The growing eigenvalues of a sector; None if more of them than are looked for lie around it."""
    search = Search(model, sector.centre, rooms)
    if model.is_searched_in_blocks:
        values = search.reaching(float(np.abs(sector.edge - sector.centre).max()), sector.holds)
    else:
        values = _one_by_one(model, sector, search)
    if values is None:
        return None
    is_real = np.abs(values.imag) <= _REAL * np.abs(values)
    held = [sector.holds(value) for value in values.tolist()]
    found: list[complex] = np.where(is_real, values.real, values)[held].tolist()
    return found


def _one_by_one(
    model: LinearModel, sector: _Sector, search: Search
) -> NDArray[np.complex128] | None:
    """All eigenvalues around a sector, of a model with which a search takes one vector at a time."""
    H = model.step_size
    edge = sector.edge if H is None else np.exp(sector.edge * H)
    needed = float(np.abs(edge - search.sigma).max())
    count, most = _AT_A_TIME
    while count <= most:
        values = search.nearest(count)
        if search.reach > needed:
            return values
        count *= 2
    return None

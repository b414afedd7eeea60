"""The critical modes of a large system, without its full spectrum: sparse shift-and-invert search.

Around a point σ of the complex plane, Arnoldi's method on (A − σI)⁻¹ finds the eigenvalues nearest to σ. All
eigenvalues nearer than the farthest one found are then known. Discs around a few points cover the region of the
critical modes: a range of frequencies, from well into instability to a damping that needs no attention."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from orchestrator.core.arrays import Vector
from orchestrator.core.assignment import least_assignment
from orchestrator.core.errors import AnalysisError
from orchestrator.core.threads import one_thread
from orchestrator.linear.models.linear_model import LinearModel, ShiftedSolver
from orchestrator.linear.spectra import modes as spectra
from orchestrator.linear.spectra.block_arnoldi import (
    MOST,
    WIDTHS,
    BlockArnoldi,
    VectorRoom,
)
from orchestrator.linear.spectra.region_cells import RegionCell

DENSE = 200  # up to this number of states, the full spectrum is cheaper
# ratio of the ends of the stretches of the range: the region is a wedge, so discs grow upwards
_STRETCH = 1.35

_WIDENING = 1.2
"""Where many vectors are taken at once, what of a stretch is not known with `_ENOUGH` of them is searched from other
points. The next stretch is longer than the known part by this factor where fewer vectors were enough, and shorter by it
where there were more: crowds of modes get short stretches."""

_SHORTEST = 1.2
"""Smallest ratio of the ends of such a stretch. A disc is as wide as the region, so that a shorter stretch needs hardly
fewer vectors (112 for a ratio of 1.02 and 140 for 1.2, 9,241 buses)."""

_LONGEST = 2.5  # largest ratio of the ends of such a stretch

_ALONG = 1.2
"""What such a stretch leaves of its range is taken along where the ends' ratio grows by this factor at most: a point of
its own costs a factorisation and forty vectors."""

_ENOUGH = 112
"""Vectors from which on a part of a stretch is enough. Each costs as much as the number of those before it, while one
more point costs a factorisation and the first eighty."""

_PARTS = (0.95, 0.9, 0.85, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)
"""Parts of the radius of a cell's disc for which is asked whether all is known, where it is not in the whole."""

_LEAST_PART = 0.3
"""What a part must have of the frequencies of its cell with `_ENOUGH` vectors, or more are taken; it is less with more,
as a crowd is not waited for."""

_STILL = 0.1
"""The same for a part that has not grown since the last look: behind it stands a crowd, which nearly twice the vectors
did not show either (9,241 buses: 112 and 220 vectors, the same part)."""

_NEARLY = 0.7
"""A part of at least this share of its cell's frequencies does not end a search before `_MANY` vectors: some more show
the whole cell mostly, and what is left on both sides would need points of its own."""

_MANY = 200  # vectors from which on such a part is enough, as they cost more than another point

_AT_A_TIME = (20, 80)
"""Numbers of eigenvalues to find around one point: the first number, and the largest one if the first does not reach
far enough. Many equal units have many equal local modes, and a small number would find only these."""

_KEPT = 100
"""Least number of vectors that Arnoldi's method keeps. With 50 it begins anew more often, and solves a fifth more
equations (299 buses, 0.1 to 2 Hz)."""

# the same where only the eigenvalue nearest to the point is looked for, mostly next to it
_KEPT_FOR_ONE = 30

_TOLERANCE = 1e-9
"""Of Arnoldi's method, relative. The last digits of eigenvalues at the rim, which crowd, cost most of its equations;
eigenvalues inside have settled far beyond it by then."""

_SAME = 1e-5
"""Eigenvalues of the equations and of their adjoint are one where they differ by less than this part of their distance
from σ."""

_FAR, _CIRCLE = 10.0, np.exp(2j * np.pi * np.arange(8) / 8)
"""An eigenvalue that has not settled may be farther from where it seems to be than its equations leave over by this
factor, as none of the matrices is normal; and directions in which it may be."""

_BESIDE = 1e-7
"""An eigenvalue nearer to the point than this part of it drowns the others' digits: 1e-11 rad/s away they were off by
6e-7 rad/s, on it by 1.5e-3. The point moves then."""

_OF_LEFT = 1e-8
"""Part of ν that left eigenvectors may leave over where they are searched: few vectors at once end no further than they
are asked to."""

_SMALLEST = 1e-4  # smallest size of a cell of the region, relative to its distance from 0
# how far into instability the region reaches: to this negative damping ratio
_UNSTABLE_MARGIN = 0.1


def find_critical_modes(
    model: LinearModel,
    lowest_hz: float = spectra.ELECTROMECHANICAL_HZ[0],
    highest_hz: float = spectra.ELECTROMECHANICAL_HZ[1],
    damping: float = 0.2,
) -> list[spectra.Mode]:
    """Modes of a frequency range with less than a given damping, least damped first.

    ``model``: step map or continuous matrix, of any size.
    ``lowest_hz`` and ``highest_hz``: range of Im λ/2π [Hz], both ends included; the lowest must exceed 0.
    ``damping``: damping ratio between 0 and 0.9. All modes with less damping are found, down to a damping ratio of
    −0.1."""
    if not (0 < lowest_hz < highest_hz and 0 < damping <= 0.9):
        raise AnalysisError(
            f"a search from {lowest_hz:g} to {highest_hz:g} Hz below a damping ratio of {damping:g} is none; "
            "the frequencies must rise from above 0, and the damping ratio lie between 0 and 0.9"
        )
    if len(model.names) <= DENSE:
        found = spectra.find_modes(model, lowest_hz, highest_hz)
    else:
        beyond = 1 + _SMALLEST  # a cell does not own its upper edges
        found = _search(
            model, 2 * np.pi * lowest_hz, 2 * np.pi * highest_hz * beyond, damping * beyond
        )
    wanted = (m for m in found if lowest_hz <= m.frequency_hz <= highest_hz)
    return spectra.least_damped_first(
        m for m in wanted if -_UNSTABLE_MARGIN <= m.damping_ratio <= damping
    )


def nearest_eigenvalue(model: LinearModel, wanted: complex) -> complex:
    """The eigenvalue λ [rad/s] nearest to a given one, from the sparse equations alone."""
    if len(model.names) <= DENSE:
        values, _ = spectra.to_continuous(
            np.linalg.eigvals(model.A).astype(complex), model.step_size
        )
        return complex(values[np.argmin(np.abs(values - wanted))])
    values = Search(model, wanted).nearest(2, _KEPT_FOR_ONE)
    return complex(values[np.argmin(np.abs(values - wanted))])


def nearest_pairs(
    model: LinearModel, wanted: complex, count: int
) -> list[tuple[complex, Vector, Vector]]:
    """The eigenvalues λ [rad/s] nearest to a given one, each with its left and right eigenvector."""
    search = Search(model, wanted)
    search.nearest(count)
    return search.pairs(range(count))


def eigenvalues_beside(
    model: LinearModel, known: tuple[Vector, Vector], region: RegionCell
) -> list[complex]:
    """All eigenvalues [rad/s] of a region that are none of the known modes.

    ``known``: left eigenvectors as rows and right ones as columns, with products of 1."""
    return [
        complex(search.values[k])
        for search, places in _covered(model, region, known)
        for k in places
    ]


def _search(
    model: LinearModel, lowest: float, highest: float, damping: float
) -> list[spectra.Mode]:
    modes: list[spectra.Mode] = []
    for search, places in _covered(model, RegionCell(lowest, highest, -_UNSTABLE_MARGIN, damping)):
        modes += search.modes(places)
    return modes


def _covered(
    model: LinearModel, region: RegionCell, without: tuple[Vector, Vector] | None = None
) -> "Iterator[tuple[Search, list[int]]]":
    """Cover the region with discs: searches, each with the places of the eigenvalues that it alone has.

    If a disc is too small, find more eigenvalues around its point, or cut the cell. One search has its vectors at a
    time."""
    stretch, rooms = _STRETCH, (VectorRoom(), VectorRoom())
    waiting = [region]
    along = _ALONG if model.is_searched_in_blocks else 1.0
    while waiting:
        cell, *rest = waiting.pop().highest(stretch, along)
        waiting += rest
        if cell.radius < _SMALLEST * abs(cell.centre):
            raise AnalysisError(
                f"more than {_AT_A_TIME[1]} modes lie at {cell.centre:.4g} rad/s; compute the full spectrum instead"
            )
        search, known = _searched(model, cell, rooms, without)
        if known is None:
            waiting += cell.halves()
        else:
            yield search, [k for k, value in enumerate(search.values) if known.holds(value)]
            if model.is_searched_in_blocks:
                stretch = _next_stretch(known, search.vectors_taken)
            for left in cell.beside(known):
                both = waiting[-1].joined(left) if waiting else None
                if both is not None:
                    waiting.pop()
                waiting.append(both or left)


def _next_stretch(known: RegionCell, vectors: int) -> float:
    """Return the ratio of the next stretch's ends, from what was known with so many vectors."""
    ratio = float(np.exp(known.stretch))
    if vectors < _ENOUGH:
        return min(_WIDENING * ratio, _LONGEST)
    return max(ratio if vectors == _ENOUGH else ratio / _WIDENING, _SHORTEST)


def _searched(
    model: LinearModel,
    cell: RegionCell,
    rooms: tuple[VectorRoom, VectorRoom],
    without: tuple[Vector, Vector] | None,
) -> "tuple[Search, RegionCell | None]":
    """Search around a cell's centre, with the part of the cell in which all is known, None where there is too much.

    The point is not on one of the eigenvalues."""
    for moved in (0.0, 0.02, 0.05):
        search = Search(model, cell.centre + moved * cell.radius, rooms, without)
        known = search.covering(cell, (1 + moved) * cell.radius)
        if (
            known is None
            or not len(search.values)
            or np.abs(search.values - search.centre).min() > _BESIDE * abs(search.centre)
        ):
            break
    return search, known


def _without(solver: ShiftedSolver, known: tuple[Vector, Vector]) -> ShiftedSolver:
    """The solutions without what is in them of known modes, whose eigenvalues are zeros then.

    ``known``: as `eigenvalues_beside` takes them."""
    left, right = known

    def rest(vectors: Vector) -> Vector:
        found: Vector = vectors - right @ (left @ vectors)
        return found

    return replace(
        solver,
        solve=lambda vectors: rest(solver.solve(rest(vectors))),
        solve_exactly=lambda vectors: rest(solver.solve_exactly(rest(vectors))),
    )


_OFF = 1e-6
"""Part by which the point of a search is moved off an eigenvalue that it meets exactly."""


class Search:
    """Arnoldi's method on (A − σI)⁻¹ around one point λ = ``centre``.

    ``sigma``: The point in the plane of A's own eigenvalues.
    ``values``: eigenvalues λ [rad/s] of the last search.
    ``reach``: Distance from ``sigma`` up to which the last search has found every eigenvalue.

    ``rooms``: where right and left vectors stand while they are searched; one search at a time has them.
    ``without``: known modes that are not looked for, as `eigenvalues_beside` takes them; no vectors are made then."""

    def __init__(
        self,
        model: LinearModel,
        centre: complex,
        rooms: tuple[VectorRoom, VectorRoom] | None = None,
        without: tuple[Vector, Vector] | None = None,
    ) -> None:
        self._model, self.centre = model, centre
        self._rooms = rooms or (VectorRoom(), VectorRoom())
        self.sigma = np.exp(centre * model.step_size) if model.step_size else centre
        with one_thread():
            try:
                self._solver = model.shifted(self.sigma)
            except RuntimeError:  # exactly singular, as SuperLU says: the point is an eigenvalue
                self.sigma += _OFF * max(1.0, abs(self.sigma))
                self._solver = model.shifted(self.sigma)
        if without is not None:
            self._solver = _without(self._solver, without)
        self.values: NDArray[np.complex128] = np.zeros(0, dtype=complex)
        self.reach = 0.0
        self._right = np.zeros((len(model.names), 0), dtype=complex)
        self._blocks: BlockArnoldi | None = None

    @property
    def vectors_taken(self) -> int:
        """Vectors of the last search with many at once; 0 where there was none."""
        return self._blocks.count if self._blocks else 0

    def nearest(self, count: int, kept: int = _KEPT) -> NDArray[np.complex128]:
        self._blocks = None
        nu, self._right = self._arnoldi(self._solver.solve_exactly, count, kept)
        self.values = self._to_lambda(nu)
        self.reach = float(1 / np.abs(nu).min())
        return self.values

    def reaching(
        self, radius: float, wanted: Callable[[complex], bool] = lambda _: True
    ) -> NDArray[np.complex128] | None:
        """All eigenvalues nearer than ``radius``; None if there are too many. Those that are not wanted may be rough.

        ``radius``: distance from ``centre`` [rad/s].
        ``wanted``: whether an eigenvalue λ is looked for."""
        if self._solver.takes_many:
            return self._found_in_blocks(lambda found: self._knows(found, radius, wanted))
        return self._reaching_one_by_one(radius)

    def covering(self, cell: RegionCell, radius: float) -> RegionCell | None:
        """Return the part of a cell in which all eigenvalues are known; None where they are too many.

        ``radius``: distance from ``centre`` within which the whole cell lies [rad/s]."""
        if not self._solver.takes_many:
            return None if self._reaching_one_by_one(radius) is None else cell
        known: list[RegionCell] = []
        least = _LEAST_PART * _ENOUGH

        def is_enough(found: BlockArnoldi) -> bool:
            part = self._known_part(found, cell, radius)
            if part is None:
                return False
            share = part.stretch / cell.stretch
            stands = bool(known) and part.stretch <= known[-1].stretch and share >= _STILL
            known.append(part)
            much = found.count >= _ENOUGH and (stands or share * found.count >= least)
            nearly = share >= _NEARLY and found.count < _MANY
            return part is cell or (much and not nearly)

        return None if self._found_in_blocks(is_enough) is None else known[-1]

    def _known_part(
        self, blocks: BlockArnoldi, cell: RegionCell, radius: float
    ) -> RegionCell | None:
        """The largest part of a cell in which all is known; `reach` goes as far."""
        if self._knows(blocks, radius, cell.holds):
            return cell
        for share in _PARTS:
            part = cell.within(self.centre, share * radius)
            if part is None:
                return None
            if self._knows(blocks, share * radius, part.holds):
                return part
        return None

    def _reaching_one_by_one(self, radius: float) -> NDArray[np.complex128] | None:
        count, most = _AT_A_TIME
        while count <= most:
            values = self.nearest(count)
            if np.abs(values - self.centre).max() > radius:
                return values
            count *= 2
        return None

    def modes(self, chosen: Sequence[int]) -> list[spectra.Mode]:
        return [
            spectra.make_mode(value, left, right, self._model.names)
            for value, left, right in self.pairs(chosen)
        ]

    def pairs(self, chosen: Sequence[int]) -> list[tuple[complex, Vector, Vector]]:
        """Eigenvalue, left and right eigenvector of some of the eigenvalues of the last search."""
        if not chosen:
            return []
        if self._blocks is not None:
            return self._pairs_of_blocks(self._blocks, list(chosen))
        nu, left = self._arnoldi(self._solver.solve_adjoint_exactly, len(self.values))
        partners = self._to_lambda(nu.conj())
        return [
            (
                complex(self.values[k]),
                left[:, np.argmin(np.abs(partners - self.values[k]))],
                self._right[:, k],
            )
            for k in chosen
        ]

    def _found_in_blocks(
        self, enough: Callable[[BlockArnoldi], bool]
    ) -> NDArray[np.complex128] | None:
        """Eigenvalues up to `reach`; None where they are too many. Equal ones are looked for with more vectors."""
        for width in WIDTHS:
            blocks = BlockArnoldi(
                self._solver.solve, len(self._model.names), width=width, room=self._rooms[0]
            )
            self._blocks = blocks
            if not _grow(blocks, enough):
                return None
            if self._are_complete(blocks):
                return self.values
        return None

    def _knows(
        self, blocks: BlockArnoldi, radius: float, wanted: Callable[[complex], bool]
    ) -> bool:
        """Return whether all eigenvalues nearer than ``radius`` are known."""
        self.reach = self._farthest(radius)

        def may_be_wanted(place: int) -> bool:
            (value,) = self._to_lambda(blocks.values[place : place + 1])
            around = value + _FAR * blocks.accuracy[place] * abs(value - self.centre) * _CIRCLE
            return wanted(complex(value)) or any(map(wanted, around.tolist()))

        return blocks.knows_all_beyond(1 / self.reach, may_be_wanted)

    def _are_complete(self, blocks: BlockArnoldi) -> bool:
        """Take the eigenvalues up to `reach`; none of them is there so often that there may be more of it."""
        count = int((np.abs(blocks.values) >= 1 / self.reach).sum())
        self.values = self._to_lambda(blocks.values[:count])
        return blocks.is_complete(count)

    def _pairs_of_blocks(
        self, blocks: BlockArnoldi, chosen: list[int]
    ) -> list[tuple[complex, Vector, Vector]]:
        """The same, from the space of both sides' vectors: its eigenvalues have the square of their accuracy."""
        wanted = blocks.values[chosen]
        with one_thread():
            left = self._left_by_search(wanted, blocks.duals(chosen), blocks.width)
            found = self._both_sides(wanted, left, blocks.vectors(chosen))
        if found is None:
            raise self._not_converging
        nu, left, right = found
        values = self._to_lambda(nu)
        return [(complex(values[k]), left[:, k], right[:, k]) for k in range(len(chosen))]

    def _left_by_search(self, wanted: NDArray[np.complex128], near: Vector, width: int) -> Vector:
        """Left eigenvectors of some ν by a search in the adjoint equations.

        ``near``: What is near them, where the search begins. Where that leads nowhere, another one begins with as many
        random vectors at once as ``width``."""
        for first, most in ((near, MOST), (None, 2 * MOST)):
            adjoint = BlockArnoldi(
                self._solver.solve_adjoint,
                len(near),
                most,
                width=width,
                first=first,
                room=self._rooms[1],
            )
            if _grow(adjoint, lambda found: _partners(found, wanted) is not None):
                return adjoint.vectors(_partners(adjoint, wanted) or ())
        raise self._not_converging

    def _both_sides(
        self, wanted: NDArray[np.complex128], left: Vector, right: Vector
    ) -> tuple[NDArray[np.complex128], Vector, Vector] | None:
        """Return ν, left and right eigenvectors in the space of some; None where they are not those wanted."""
        moved = self._solver.solve_exactly(right)
        nu, of_left, of_right = scipy.linalg.eig(
            left.conj().T @ moved, left.conj().T @ right, left=True
        )
        if not np.isfinite(nu).all():
            return None
        _, order = least_assignment(np.abs(wanted[:, None] - nu[None, :]))
        nu, of_left, of_right = nu[order], of_left[:, order], of_right[:, order]
        left, right, moved = left @ of_left, right @ of_right, moved @ of_right
        rest = np.linalg.norm(moved - right * nu, axis=0) / (
            np.abs(nu) * np.linalg.norm(right, axis=0)
        )
        moves = np.abs(nu - wanted) / np.abs(wanted)
        # nor is it where one is not a number
        is_same = bool((np.concatenate([rest, moves]) <= _SAME).all())
        return (nu, left, right) if is_same else None

    def _farthest(self, radius: float) -> float:
        """Distance from ``sigma`` of the farthest point of the circle around ``centre``."""
        if not self._model.step_size:
            return radius
        circle = self.centre + radius * np.exp(1j * np.linspace(0, 2 * np.pi, 65))
        return float(np.abs(np.exp(circle * self._model.step_size) - self.sigma).max())

    def _to_lambda(self, nu: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return spectra.to_continuous(self.sigma + 1 / nu, self._model.step_size)[0]

    @property
    def _not_converging(self) -> AnalysisError:
        return AnalysisError(
            f"the search for modes around {self.centre:.3g} rad/s does not converge; compute the full spectrum"
        )

    def _arnoldi(
        self, solve: Callable[[Vector], Vector], count: int, kept: int = _KEPT
    ) -> tuple[Vector, Vector]:
        n = len(self._model.names)
        # the same search gives the same answer
        start = np.random.default_rng(0).standard_normal(n).astype(complex)
        inverse = spla.LinearOperator((n, n), matvec=solve, dtype=complex)
        try:
            with one_thread():
                nu, vectors = spla.eigs(
                    inverse,
                    k=count,
                    ncv=min(n, max(kept, 2 * count + 10)),
                    v0=start,
                    tol=_TOLERANCE,
                )
        except spla.ArpackNoConvergence as error:
            raise self._not_converging from error
        return nu, vectors


def _grow(blocks: BlockArnoldi, enough: Callable[[BlockArnoldi], bool]) -> bool:
    """Take vectors until there are enough; whether they suffice before there are too many."""
    with one_thread():
        while not enough(blocks):
            if not blocks.grow():
                return False
    return True


def _partners(blocks: BlockArnoldi, wanted: NDArray[np.complex128]) -> list[int] | None:
    """Places of the settled values of the adjoint equations that are those wanted, one for each; None if one lacks."""
    settled = np.flatnonzero(blocks.accuracy <= _OF_LEFT)
    if len(settled) < len(wanted):
        return None
    apart = (
        np.abs(wanted[:, None] - blocks.values[settled].conj()[None, :]) / np.abs(wanted)[:, None]
    )
    rows, columns = least_assignment(np.minimum(apart, 1.0))
    return settled[columns].tolist() if bool((apart[rows, columns] <= _SAME).all()) else None

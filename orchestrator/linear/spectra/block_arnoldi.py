"""Arnoldi's method with many vectors at once, for systems whose equations are dense in part.

A solution for one vector reads a whole dense factor and does little with it; one for four takes hardly longer. What
ARPACK saves by beginning anew with few vectors it pays in solutions, so all vectors are kept here. They are orthogonal
in their images (`sketch`), which leaves eigenvalues as they are: whatever the basis is, its image under the operator is
written in it to the last digit."""

from collections.abc import Callable, Sequence

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix, Vector
from orchestrator.linear.models.divided_hub import times
from orchestrator.linear.spectra.sketch import sketch

WIDTHS = (4, 16)
"""Vectors at once, and where an eigenvalue is there so often that there may be more of it: to begin with, and at most.
Few vectors make a space of high powers, which find what crowds with a third of the vectors (2,869 buses: 708, 1,184 and
2,032 vectors by 4, 8 and 16 at once)."""

MOST = 640  # largest number of vectors; 48,000 states take 0.5 GB for them
# of ν: what the rest may be of what is found; left and right vectors together give ν to its square
TOLERANCE = 1e-7

ROUGH = 1e-2
"""A value beyond a limit has settled if it moves by less than this part of itself, or of half its distance from the
limit: its place need not be known better."""

_FIRST = 10
"""Powers of the operator before the first look, each with as many vectors as are taken at once."""

# the largest values beyond a limit that have to have settled before the search there may end
_BEYOND = 8

# values are looked at where the vectors are more by this factor; there are many operations in it
_GROWTH = 1.25
_DEPENDENT = 1e-12  # A direction that is smaller than this part of the largest one is none
# where what is new of the vectors is less than this part of them, it is made orthogonal twice
_AGAIN = 1e-2
_IMAGE = 4
"""Elements of a vector's image for each of the most vectors: lengths in a space of all vectors are those of the images
to a factor of two, and with a fifth of the vectors to a quarter."""
_EQUAL = 1e-6  # values of ν that differ by less than this part are one


class VectorRoom:
    """Memory for the vectors of one search after the other: to fill new memory takes longer than to use it again."""

    def __init__(self) -> None:
        self._numbers = np.empty(0, dtype=complex)

    def columns(self, rows: int, count: int) -> Vector:
        """Return vectors as columns, whatever stands in them; those returned before are no longer to be used."""
        if rows * count > len(self._numbers):
            self._numbers = np.empty(rows * count, dtype=complex)
        return self._numbers[: rows * count].reshape((rows, count), order="F")


class BlockArnoldi:
    """The eigenvalues ν of largest size of an operator, and vectors, from a space that grows.

    ``apply``: The operator, for complex vectors as columns, shape (n, k).
    ``width``: Vectors that are taken at once.
    ``first``: Vectors to begin with, as many; random ones where none are given.
    ``room``: Where the vectors stand; the search is over when another one takes it.

    ``values``, ``accuracy``: Approximations of the eigenvalues, largest first; and how large what they leave over is,
    as a part of each."""

    def __init__(
        self,
        apply: Callable[[Vector], Vector],
        size: int,
        most: int = MOST,
        *,
        width: int = WIDTHS[0],
        first: Vector | None = None,
        room: VectorRoom | None = None,
    ) -> None:
        self._apply, self._size = apply, size
        self.width = max(1, min(width, size // 2)) if first is None else first.shape[1]
        self._most = max(min(most, size - self.width), self.width)
        self._random = np.random.default_rng(0)  # the same search gives the same answer
        self._basis = (room or VectorRoom()).columns(size, self._most + self.width)
        self._image = np.zeros((self._most + self.width, self._most), dtype=complex)
        self._sketch = sketch(size, _IMAGE * (self._most + self.width))
        self._images = np.empty(
            (self._sketch.shape[0], self._most + self.width), dtype=complex, order="F"
        )
        self._done = -self.width
        self._keep(
            self._random.standard_normal((size, self.width)) + 0j if first is None else first
        )
        self.values: NDArray[np.complex128] = np.zeros(0, dtype=complex)
        self.accuracy: NDArray[np.float64] = np.zeros(0)
        self._coordinates: Matrix = np.zeros((0, 0), dtype=complex)

    @property
    def count(self) -> int:
        """Number of vectors that have been taken."""
        return self._done

    def grow(self) -> bool:
        """Take more vectors, and look at the values; False where there are as many as may be."""
        wanted = min(self._most, max(_FIRST * self.width, int(np.ceil(_GROWTH * self._done))))
        if self._done + self.width > self._most:
            return False
        while self._done < wanted and self._done + self.width <= self._most:
            self._extend()
        self._look()
        return True

    def vectors(self, places: Sequence[int]) -> Vector:
        """Eigenvectors of some of the values, shape (n, number of places)."""
        found: Vector = (
            self._basis[:, : len(self._coordinates)] @ self._coordinates[:, list(places)]
        )
        return found

    def duals(self, places: Sequence[int]) -> Vector:
        """Vectors to which those of all other values are at right angles, shape (n, number of places).

        They are near left eigenvectors: the left eigenvectors of other values that have settled are not in them, and
        what is in them of smaller values dies away as the adjoint operator is applied."""
        turned = self._coordinates.conj().T
        of_places = np.eye(len(turned))[:, list(places)]
        parts = np.linalg.lstsq(turned, of_places.astype(complex), rcond=None)[0]
        return times(self._sketch.T, self._images[:, : len(parts)] @ parts)

    def knows_all_beyond(self, size: float, wanted: Callable[[int], bool]) -> bool:
        """Return whether all values of that size or more are known, and the next ones are seen to be smaller."""
        larger = int((np.abs(self.values) >= size).sum())
        beyond = slice(larger, larger + _BEYOND)
        allowed = np.maximum(ROUGH, (size / np.abs(self.values[beyond]) - 1) / 2)
        if (
            len(allowed) < min(_BEYOND, self._size - larger)
            or (self.accuracy[beyond] > allowed).any()
        ):
            return False
        near = self.accuracy[:larger]
        return bool((near <= ROUGH).all()) and not any(
            map(wanted, np.flatnonzero(near > TOLERANCE).tolist())
        )

    def is_complete(self, larger: int) -> bool:
        """Return whether none of the largest values is there so often that there may be more of it."""
        among = self.values[:larger]
        apart = np.abs(among[:, None] - among[None, :])
        return bool((apart <= _EQUAL * np.abs(among)).sum(axis=1).max(initial=0) < self.width)

    def _extend(self) -> None:
        first = self._done
        last = first + self.width
        part, sizes = self._keep(self._apply(self._basis[:, first:last]))
        self._image[:last, first:last] = part
        self._image[last : last + self.width, first:last] = sizes

    def _keep(self, new: Vector) -> tuple[Vector, Vector]:
        """Add vectors to the basis, made independent of it; return what they are in it, and in what is added."""
        last = self._done + self.width
        image = times(self._sketch, new)
        part, directions, sizes = self._apart(image, last)
        before = np.linalg.norm(image, axis=0).max()
        dependent = np.abs(np.diag(sizes)) <= _DEPENDENT * before
        given, rest = part, sizes
        if dependent.any():
            new = new.copy()
            new[:, dependent] = self._random.standard_normal((self._size, int(dependent.sum())))
            left = image - self._images[:, :last] @ part
            given, directions, rest = self._apart(times(self._sketch, new), last)
            sizes = directions.conj().T @ left
        vectors = self._without(new, given, rest)
        if np.linalg.svd(rest, compute_uv=False).min() < _AGAIN * before:
            again, directions, turned = self._apart(times(self._sketch, vectors), last)
            vectors = self._without(vectors, again, turned)
            part, sizes = part + again @ sizes, turned @ sizes
        self._basis[:, last : last + self.width] = vectors
        self._images[:, last : last + self.width] = directions
        self._done = last
        return part, sizes

    def _apart(self, image: Vector, count: int) -> tuple[Vector, Vector, Vector]:
        """Return parts of the first vectors' images in some images, and directions of the rest with its parts."""
        known = self._images[:, :count]
        part = (image.conj().T @ known).conj().T
        rest = image - known @ part
        more = (rest.conj().T @ known).conj().T
        directions, sizes = np.linalg.qr(rest - known @ more)
        return part + more, directions, sizes

    def _without(self, new: Vector, part: Vector, sizes: Vector) -> Vector:
        """New vectors, less what they are of those before, as directions; column by column, as all are kept."""
        rest = np.asfortranarray(new)
        rest = rest - (part.T @ self._basis[:, : len(part)].T).T
        return np.asarray((np.linalg.inv(sizes).T @ rest.T).T)

    def _look(self) -> None:
        m = self._done
        nu, vectors = scipy.linalg.eig(self._image[:m, :m], check_finite=False)
        rest = np.linalg.norm(self._image[m : m + self.width, :m] @ vectors, axis=0)
        order = np.argsort(-np.abs(nu), kind="stable")
        self.values, self._coordinates = nu[order], vectors[:, order]
        self.accuracy = rest[order] / np.abs(self.values)

"""Following all modes from one operating point to the next by their eigenvectors.

Sorted lists of eigenvalues lose a mode where two eigenvalues cross; eigenvectors stay the same. The similarity of
two modes is the magnitude of a product, and these products sum to 1 over all modes b of a point. A similarity above a
half therefore means that most of mode a is in mode b."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Complex, Vector
from orchestrator.linear.spectra.modes import Mode

THRESHOLD = 0.5  # least similarity with which two modes count as the same mode
# A mode is left unmatched if the similarities of its two best candidates differ by less than this
_MARGIN = 0.3
# of the relative distance between eigenvalues; the similarity, from 0 to 1, has 1
_DISTANCE_WEIGHT = 0.1
# A mode whose frequency is within this factor of an end of the range may leave or enter the range
# there
_EDGE = 1.1

At = TypeVar("At", bound=Hashable)


@dataclass(frozen=True)
class ModeSet:
    eigenvalues: Complex  # λ [rad/s], shape (m,)
    # left, right: eigenvectors as rows, shape (m, n), in any scaling
    left: Complex
    right: Complex
    names: tuple[str, ...]

    @classmethod
    def of(cls, modes: Sequence[Mode], names: tuple[str, ...]) -> Self:
        def rows(vectors: Iterable[Mapping[str, complex]]) -> Complex:
            return np.array([[v[name] for name in names] for v in vectors], dtype=complex).reshape(
                len(modes), len(names)
            )

        values = np.array([mode.eigenvalue for mode in modes], dtype=complex)
        return cls(values, rows(m.left for m in modes), rows(m.shape for m in modes), names)

    @property
    def frequencies(self) -> NDArray[np.float64]:
        return np.asarray(self.eigenvalues.imag / (2 * np.pi), dtype=float)

    def participation(self) -> NDArray[np.float64]:
        """Factors of all states, shape (m, n); those of a mode sum to 1."""
        factors = np.abs(self.left.conj() * self.right)
        return np.asarray(factors / factors.sum(axis=1, keepdims=True), dtype=float)


@dataclass(frozen=True)
class Link:
    source: int
    target: int
    similarity: float


def similarities(a: ModeSet, b: ModeSet) -> NDArray[np.float64]:
    """Similarity of every mode of one point with every mode of another, shape (m_a, m_b), from 0 to 1.

    A state that only one of the points has counts as 0 in the other's eigenvectors, and those of an identified model
    in both: each identification has states of its own."""
    place_in_b = {name: k for k, name in enumerate(b.names)}
    both = [
        (k, place_in_b[name])
        for k, name in enumerate(a.names)
        if name in place_in_b and ".identified." not in name
    ]
    of_a, of_b = [k for k, _ in both], [k for _, k in both]
    norm_a, norm_b = (np.einsum("ij,ij->i", s.left.conj(), s.right) for s in (a, b))
    product = similarity(
        a.left[:, of_a], a.right[:, of_a], b.left[:, of_b], b.right[:, of_b]
    ) / np.abs(np.outer(norm_a, norm_b))
    # The product exceeds 1 only near a double eigenvalue, where eigenvectors say little; its inverse is used then.
    return np.asarray(np.where(product > 1, 1 / np.maximum(product, 1.0), product), dtype=float)


def match(a: ModeSet, b: ModeSet, threshold: float = THRESHOLD) -> list[Link]:
    """Pair the modes of two points so that the sum of their similarities is largest.

    Pairs below the threshold, and pairs with another candidate that is nearly as good, are left out: the mode is
    ambiguous, new or gone."""
    if not (len(a.eigenvalues) and len(b.eigenvalues)):
        return []
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - half a second to import

    alike = similarities(a, b)
    sizes = np.abs(a.eigenvalues)[:, None] + np.abs(b.eigenvalues)[None, :]
    distance = np.abs(a.eigenvalues[:, None] - b.eigenvalues[None, :]) / np.where(
        sizes > 0, sizes, 1.0
    )
    cost = np.where(
        alike >= threshold, 1 - alike + _DISTANCE_WEIGHT * distance, 1 + 2 * _DISTANCE_WEIGHT
    )
    links = []
    for i, k in zip(*linear_sum_assignment(cost), strict=True):
        rivals = [*np.delete(alike[i], k), *np.delete(alike[:, k], i)]
        if alike[i, k] >= max(threshold, max(rivals, default=0.0) + _MARGIN):
            links.append(Link(int(i), int(k), float(alike[i, k])))
    return links


def near_an_end(frequency: float, frequency_range: tuple[float, float]) -> bool:
    """Return whether a mode of this frequency may just have entered the range, or may leave it next [Hz]."""
    return not frequency_range[0] * _EDGE < frequency < frequency_range[1] / _EDGE


def is_ambiguous(
    a: ModeSet, b: ModeSet, frequency_range: tuple[float, float], threshold: float = THRESHOLD
) -> bool:
    """Return whether a mode of one point has no partner in the other without being near an end of the range [Hz]."""
    links = match(a, b, threshold)
    paired = ({link.source for link in links}, {link.target for link in links})
    return any(
        i not in known and not near_an_end(float(frequency), frequency_range)
        for s, known in zip((a, b), paired, strict=True)
        for i, frequency in enumerate(s.frequencies)
    )


@dataclass
class Followed(Generic[At]):
    # numbers of the trajectories of a point's modes
    trajectory: dict[At, list[int]] = field(default_factory=dict)
    # similarity of each mode to its predecessor; NaN where a trajectory begins
    similarity: dict[At, list[float]] = field(default_factory=dict)
    # the predecessor's point; None where a trajectory begins
    origin: dict[At, list[At | None]] = field(default_factory=dict)


def number_trajectories(
    points: Mapping[At, ModeSet],
    route: Iterable[tuple[At, Sequence[At]]],
    threshold: float = THRESHOLD,
) -> Followed[At]:
    result: Followed[At] = Followed()
    count = 0
    for place, origins in route:
        modes = points[place]
        numbers: dict[int, tuple[int, float, At | None]] = {}
        for origin in origins:
            for link in match(points[origin], modes, threshold):
                number = result.trajectory[origin][link.source]
                if link.target not in numbers and all(
                    number != taken for taken, _, _ in numbers.values()
                ):
                    numbers[link.target] = (number, link.similarity, origin)
        for i in range(len(modes.eigenvalues)):
            if i not in numbers:
                numbers[i] = (count, np.nan, None)
                count += 1
        entries = [numbers[i] for i in range(len(modes.eigenvalues))]
        result.trajectory[place] = [number for number, _, _ in entries]
        result.similarity[place] = [alike for _, alike, _ in entries]
        result.origin[place] = [origin for _, _, origin in entries]
    return result


def similarity(
    left_a: Vector, right_a: Vector, left_b: Vector, right_b: Vector
) -> NDArray[np.float64]:
    """|l_aᴴ·r_b|·|l_bᴴ·r_a| of every mode a with every mode b, shape (m_a, m_b)."""
    forth = left_a.conj() @ right_b.T
    back = (left_b.conj() @ right_a.T).T
    return np.asarray(np.abs(forth * back), dtype=float)

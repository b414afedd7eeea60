"""Following one mode by its eigenvectors while a parameter changes. The linear model can be computed for any value of
the parameter."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Self

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from orchestrator.core.arrays import Vector
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import IDENTIFIED, LinearModel
from orchestrator.linear.spectra.critical_modes import DENSE, nearest_pairs
from orchestrator.linear.spectra.mode_tracking import similarity
from orchestrator.linear.spectra.modes import Mode, Spectrum, eigenvectors, in_range

_SAME = 0.6  # least similarity with which two modes of neighbouring models count as the same mode
_SHORTEST = 1 / 64  # length of the shortest stride, as a part of the path
_NEIGHBOURS = 8
_LITTLE = 0.3  # A mode of which less is in the states that are looked at is not recognised by them
_DEFECTIVE = 1e-12
"""Below this lᴴ·r is rounding: equal stages side by side share one eigenvector, and such a mode is like no other."""


class ModesMeetError(AnalysisError):
    """A mode merges with another one on its way, and cannot be told from it; ``beyond`` is where on the path."""

    def __init__(self, eigenvalue: complex, beyond: float, end: float) -> None:
        self.eigenvalue, self.beyond = eigenvalue, beyond
        super().__init__(
            f"the mode {eigenvalue:.4g} rad/s cannot be followed beyond {beyond:.4g} on the way to {end:.4g}: "
            "there it merges with another mode; take a smaller gain or other lead/lag time constants"
        )


@dataclass(frozen=True)
class Eigenpair:
    """An eigenvalue λ [rad/s] with its left and right eigenvectors, scaled so that lᴴ·r = 1."""

    eigenvalue: complex
    left: Vector
    right: Vector

    def similarity(self, other: "Eigenpair") -> float:
        """Similarity of two modes, from 0 to about 1; it exceeds 1 only near a double eigenvalue."""
        mine, theirs = (self.left[None], self.right[None]), (other.left[None], other.right[None])
        return float(similarity(*mine, *theirs).item())

    def within(self, places: Sequence[int]) -> "Eigenpair":
        """The part of the mode that is in some of the states, scaled anew; like no other where that is little."""
        left, right = self.left[places], self.right[places]
        return _pair(
            self.eigenvalue, left if abs(np.vdot(right, left)) > _LITTLE else 0 * left, right
        )


def eigenpairs(
    model: LinearModel, lowest_hz: float, highest_hz: float
) -> tuple[list[Eigenpair], Vector]:
    """The eigenpairs of a frequency range [Hz], one of each conjugate pair, and all eigenvalues [rad/s]."""
    lambdas, left, right = eigenvectors(model)
    return pairs_of(lambdas, left, right, lowest_hz, highest_hz), lambdas


def pairs_of(
    lambdas: Vector,
    left: Vector,
    right: Vector,
    lowest_hz: float = 0.0,
    highest_hz: float = np.inf,
) -> list[Eigenpair]:
    """The pairs of a frequency range [Hz] among eigenvalues [rad/s] with their eigenvectors as columns."""
    chosen = in_range(lambdas, lowest_hz, highest_hz)
    return [_pair(complex(lambdas[k]), left[:, k], right[:, k]) for k in chosen]


def pairs_near(model: LinearModel, wanted: complex) -> list[Eigenpair]:
    """The pairs nearest to a point [rad/s]; of a small model, all pairs of the upper half plane."""
    if len(model.names) <= DENSE:
        return eigenpairs(model, 0.0, np.inf)[0]
    return [_pair(*found) for found in nearest_pairs(model, wanted, _NEIGHBOURS)]


Near = Callable[[LinearModel, complex], Sequence[Eigenpair]]
"""Gives a model's pairs near a point [rad/s]."""


def near_with(known: LinearModel, spectrum: Spectrum) -> Near:
    """Return `pairs_near`, which takes the pairs of one model from what is known of it."""
    if spectrum.vectors is None or len(known.names) > DENSE:
        return pairs_near
    pairs = cache(partial(pairs_of, spectrum.eigenvalues, *spectrum.vectors))
    return lambda model, wanted: pairs() if model is known else pairs_near(model, wanted)


def pair_at(model: LinearModel, eigenvalue: complex) -> Eigenpair:
    return min(pairs_near(model, eigenvalue), key=lambda pair: abs(pair.eigenvalue - eigenvalue))


@dataclass(frozen=True)
class Strides:
    same: float = _SAME  # least similarity with which a mode is taken for the same
    # Largest similarity that another one may have beside it. Near a double eigenvalue everything is like both.
    rival: float = np.inf
    shortest: float = _SHORTEST


USUAL, CAREFUL, COSTLY = Strides(), Strides(0.8, 0.4, 1 / 512), Strides(0.8, 0.4, 1 / 16)
"""Along a gain that a design turns up; between two systems that may differ in anything; and where each model on the way
is a system that has to be started.
"""


def follow_along(
    start: Eigenpair,
    model_at: Callable[[float], LinearModel],
    begin: float,
    end: float,
    strides: Strides = USUAL,
    common: Sequence[str] = (),
    *,
    near: Near = pairs_near,
) -> Eigenpair:
    """Follow a mode along a path from ``begin`` to ``end``, in strides short enough to recognise it.

    ``common``: states by which modes are recognised, where not all models have the same; the start's vectors hold these
    alone. ``near``: gives a model's pairs near a point, as `pairs_near`."""
    shortest = abs(end - begin) * strides.shortest
    here, pair, stride = begin, start, end - begin
    while here != end:
        there = end if abs(end - here) <= abs(stride) * (1 + 1e-12) else here + stride
        model = model_at(there)
        states = [model.names.index(name) for name in common]
        found = _recognise(
            pair,
            [p.within(states) if states else p for p in near(model, pair.eigenvalue)],
            strides,
        )
        if found is not None:
            here, pair, stride = there, found, 2 * stride
        elif abs(stride) > shortest:
            stride = (there - here) / 2
        else:
            raise ModesMeetError(pair.eigenvalue, here, end)
    return pair


def between(one: LinearModel, other: LinearModel) -> Callable[[float], LinearModel] | None:
    """The linear models on the straight way from one (0) to another (1), both of the same operating point.

    A gain that stands in one element of a component's matrices runs from one value to the other on this way. There is
    none between models of other states or over another step, nor with states that were fitted."""
    alike = one.names == other.names and one.G.shape == other.G.shape
    if not alike or (one.step_size, one.period) != (other.step_size, other.period):
        return None
    if IDENTIFIED in {*one.sources.values(), *other.sources.values()}:
        return None

    mixtures = [
        _Mixture.of(a, b)
        for a, b in zip(
            (one.F, one.G, one.H, one.K), (other.F, other.G, other.H, other.K), strict=True
        )
    ]

    def model_at(part: float) -> LinearModel:
        if part == 1:
            return other
        F, G, H, K = (mixture.at(part) for mixture in mixtures)
        return LinearModel(
            F,
            G,
            H=H,
            K=K,
            names=other.names,
            step_size=other.step_size,
            disagreement=0.0,
            period=other.period,
        )

    return model_at


@dataclass(frozen=True)
class _Mixture:
    """Two sparse matrices with their values in the same places, so that mixing them is mixing values."""

    one: Vector
    other: Vector
    columns: NDArray[np.int32]
    starts: NDArray[np.int32]
    shape: tuple[int, int]

    @classmethod
    def of(cls, one: sp.csr_array, other: sp.csr_array) -> Self:
        rows, columns = one.shape
        width = max(1, columns)
        keys = [
            np.repeat(np.arange(rows) * width, np.diff(matrix.indptr)) + matrix.indices
            for matrix in (one, other)
        ]
        places = np.union1d(*keys)
        starts = np.searchsorted(places, np.arange(rows + 1) * width)
        a, b = (
            np.bincount(np.searchsorted(places, of), matrix.data, len(places))
            for of, matrix in zip(keys, (one, other), strict=True)
        )
        return cls(
            a,
            b,
            columns=(places % width).astype(np.int32),
            starts=starts.astype(np.int32),
            shape=(rows, columns),
        )

    def at(self, part: float) -> sp.csr_array:
        mixed = (1 - part) * self.one + part * self.other
        return sp.csr_array((mixed, self.columns, self.starts), shape=self.shape)


def pair_of(mode: Mode, names: Sequence[str]) -> Eigenpair:
    return _pair(
        mode.eigenvalue, *(np.array([v[name] for name in names]) for v in (mode.left, mode.shape))
    )


def _recognise(
    pair: Eigenpair, candidates: Sequence[Eigenpair], strides: Strides
) -> Eigenpair | None:
    if not candidates:
        return None
    left, right = (np.array([getattr(c, side) for c in candidates]) for side in ("left", "right"))
    (alike,) = similarity(pair.left[None], pair.right[None], left, right)
    best = int(np.argmax(alike))
    if not alike[best] >= strides.same:
        return None
    # above 1 it is half of a double eigenvalue
    beside = np.delete(alike, best).max(initial=alike[best] - 1)
    return candidates[best] if beside <= strides.rival else None


def _pair(eigenvalue: complex, left: Vector, right: Vector) -> Eigenpair:
    product = complex(np.vdot(right, left))  # rᴴl, the conjugate of lᴴr
    size = float(np.linalg.norm(left) * np.linalg.norm(right))
    if abs(product) <= _DEFECTIVE * size:
        left, product = np.zeros_like(left), complex(1)
    return Eigenpair(eigenvalue, left / product, right)

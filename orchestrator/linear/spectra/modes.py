"""Modes of a linear model: eigenvalues, damping ratio, frequency, participation factors, mode shapes."""

import cmath
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from orchestrator.core.arrays import Vector
from orchestrator.core.read_only import ReadOnlyTable
from orchestrator.core.units import whole_percent
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra.real_schur import RealSchur

ZERO = 1e-3
"""An eigenvalue of at most this size [rad/s] counts as zero: it is the free angle of a system without an infinite bus,
within the accuracy of a perturbation. Without control of the frequency the zero is double, and its two values differ by
up to this size."""

ELECTROMECHANICAL_HZ = (0.1, 2.0)
"""Range of frequencies of electromechanical modes [Hz], which is the default wherever modes are searched, named or
guarded."""

HIGHEST_SWING_HZ = 5.0
"""Frequency [Hz] up to which electromechanical modes outside of a range are named: small machines beside large ones."""

LOCAL_HZ = 3.0
"""Frequency [Hz] up to which single machines swing against the network (Kundur 1994, section 12.8, has 2 Hz for large
ones; small ones have been seen at 2.9 Hz). Above the range they are told of, and not followed."""

_TOLD = 2
"""Components that are told with a mode, those that take part most."""

# A multiplier of the step map smaller than this decays within one step and is not a mode
_DEAD = 1e-9
# up to this number of states, all eigenvectors are computed: they take no time that anyone notices
ALL_VECTORS = 400
# a pair with an imaginary part below this share of the real one is a double real pole split by
# rounding
_REAL = 1e-2


def damping_ratio(eigenvalue: complex) -> float:
    """ζ = −Re λ/|λ|; 0 for λ = 0."""
    size = abs(eigenvalue)
    return -eigenvalue.real / size if size else 0.0


def damping_percent(eigenvalue: complex) -> float:
    """The damping ratio in percent, rounded once; 100·ζ may differ from it in the last digit."""
    return -100 * eigenvalue.real / abs(eigenvalue) if eigenvalue else 0.0


def mode_in_words(eigenvalue: complex, shares: Iterable[tuple[str, float]]) -> str:
    """Return frequency, damping and who takes part most: ``2.034 Hz, 5.19 % (sg3 0.86, sg2 0.12)``.

    ``shares``: participation by component, largest first."""
    hertz = eigenvalue.imag / (2 * np.pi)
    return f"{hertz:.3f} Hz, {damping_percent(eigenvalue):.2f} % ({shares_in_words(shares)})"


def shares_in_words(shares: Iterable[tuple[str, float]]) -> str:
    """Return the components that take part most: ``sg3 0.86, sg2 0.12``."""
    return ", ".join(f"{name} {share:.2f}" for name, share in islice(shares, _TOLD))


class OfEigenvalue:
    """Figures of an eigenvalue λ [rad/s]."""

    __slots__ = ()
    eigenvalue: complex

    @property
    def frequency_hz(self) -> float:
        """Im λ/2π."""
        return self.eigenvalue.imag / (2 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """−Re λ/|λ|; 0 for λ = 0."""
        return damping_ratio(self.eigenvalue)

    @property
    def damping_percent(self) -> float:
        """Damping ratio [%]."""
        return 100 * self.damping_ratio


@dataclass(frozen=True, repr=False)
class Mode(OfEigenvalue):
    """One eigenvalue λ with its participation factors and its shape.

    Attributes
    ----------
    eigenvalue
        λ [rad/s], complex; ``frequency_hz`` and ``damping_percent`` are its own.
    participation
        Factor of every state, largest first; the factors of a mode sum to 1.
    shape
        Right eigenvector by state, scaled so that its largest element is 1; it is read-only, ``dict(shape)`` is a copy.
    left
        Left eigenvector l by state, scaled so that lᴴ·shape is 1: it recognises the mode elsewhere.
    """

    eigenvalue: complex
    participation: tuple[tuple[str, float], ...]
    shape: dict[str, complex]
    left: dict[str, complex] = field(default_factory=dict)

    def __repr__(self) -> str:
        led = ", ".join(f"{state} {factor:.2f}" for state, factor in self.participation[:2])
        return f"<Mode {self.frequency_hz:.3f} Hz, {self.damping_percent:.2f} %: {led}>"

    @property
    def is_oscillation(self) -> bool:
        """Return whether the eigenvalue is neither a real pole nor a zero; see `oscillations`."""
        return bool(oscillations(np.array([self.eigenvalue]))[0])

    @cached_property
    def by_component(self) -> dict[str, float]:
        """Participation of every component as a whole: the sum over its states, largest first."""
        return shares_of_components(self.participation)

    def by_group(self, group_of: Callable[[str], str | None]) -> dict[str, float]:
        """Participation of groups of states, largest first; states whose group is None are left out."""
        return _sum_by_group(self.participation, group_of)

    def by_group_of_components(self, groups: Mapping[str, str]) -> dict[str, float]:
        """Participation of groups of components, largest first; components without a group are left out."""
        return _sum_by_group(self.by_component.items(), groups.get) if groups else {}

    def swing(self, states: Iterable[str], least: float = 0.1) -> tuple[list[str], list[str]]:
        """Two groups of some states, such as all speeds, that swing against each other.

        They are the states less than 90° from the largest one, and the others, each group sorted by size. States that
        move less than ``least`` of the largest are left out."""
        moving = sorted((s for s in states if s in self.shape), key=lambda s: -abs(self.shape[s]))
        if not moving or abs(self.shape[moving[0]]) == 0:
            return [], []
        leader = self.shape[moving[0]]
        moving = [s for s in moving if abs(self.shape[s]) >= least * abs(leader)]
        together = [s for s in moving if (self.shape[s] * leader.conjugate()).real > 0]
        return together, [s for s in moving if s not in together]

    def swing_groups(self, states: Iterable[str], least: float = 0.1) -> "SwingGroups":
        """Groups of some states by the angle to the largest one: beside it, against it, and in between.

        ``least``: states that move less than this part of the largest are left out; where none swings against it that
        moves more, those against it that move less are kept apart."""
        known = [s for s in states if s in self.shape]
        together, others = self.swing(known, least)
        moving = [*together, *others]
        angles = {
            state: math.degrees(cmath.phase(self.shape[state] / self.shape[moving[0]]))
            for state in moving
        }
        alike = tuple(s for s in moving if abs(angles[s]) <= _ALIKE_DEG)
        against = tuple(s for s in moving if abs(angles[s]) >= 180 - _ALIKE_DEG)
        between = {s: angles[s] for s in moving if s not in {*alike, *against}}
        faint = {} if against or not moving else self._faintly_against(known, moving[0], least)
        still = bool(moving) and len(known) > len(moving) and not faint
        return SwingGroups(alike, against, between, faint, still)

    def _faintly_against(
        self, states: Sequence[str], leader: str, least: float
    ) -> dict[str, float]:
        """States against the largest one that move less than a part of it, each with its own part, largest first."""
        turned = {s: self.shape[s] / self.shape[leader] for s in states}
        parts = {
            s: abs(z)
            for s, z in turned.items()
            if _FAINTEST <= abs(z) < least and abs(math.degrees(cmath.phase(z))) >= 180 - _ALIKE_DEG
        }
        return dict(sorted(parts.items(), key=lambda entry: -entry[1]))

    def participation_of(self, states: Iterable[str]) -> float:
        """Participation of some states together."""
        wanted = set(states)
        return sum(factor for name, factor in self.participation if name in wanted)


_FAINTEST = 0.01
"""Part of the largest motion from which on a state is named as the other side of a swing that has no larger one."""

_ALIKE_DEG = 45.0
"""Two states swing together, or against each other, if their angle is within this of 0 or of 180 degrees: then the
greater part of each motion is along that of the other one."""


def shares_of_components(factors: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Return the participation of every component, the sum over its states, largest first."""
    return _sum_by_group(factors, lambda state: state.partition(".")[0])


def _sum_by_group(
    factors: Iterable[tuple[str, float]], group_of: Callable[[str], str | None]
) -> dict[str, float]:
    """Return the sum of each group, largest first; what has no group is left out."""
    sums: dict[str, float] = {}
    for name, factor in factors:
        group = group_of(name)
        if group is not None:
            sums[group] = sums.get(group, 0.0) + factor
    return ReadOnlyTable(sorted(sums.items(), key=lambda entry: -entry[1]))


@dataclass(frozen=True)
class SwingGroups:
    """States that swing with the largest one, against it, and those in between with their angles to it [degrees].

    ``faint``: where none is against it, those that are with less motion than counts, as parts of the largest one's;
    ``is_still``: whether others are there and none of them is against it even so."""

    together: tuple[str, ...]
    against: tuple[str, ...]
    between: dict[str, float]
    faint: dict[str, float] = field(default_factory=dict)
    is_still: bool = False

    @property
    def other_side(self) -> list[str]:
        """Components against the largest one, those that move little with their part of its motion."""
        faint = [f"{_component(s)} ({whole_percent(part)})" for s, part in self.faint.items()]
        return [_component(s) for s in self.against] or faint

    def words(self, most: Callable[[Sequence[str]], str]) -> str:
        """Who swings against whom: ``sg1, sg2 against sg3; sg4 leads by 87°``; "" if nothing moves.

        ``most``: Writes a list of components."""
        sides = [most([_component(s) for s in self.together]), most(self.other_side)]
        said = " against ".join(side for side in sides if side)
        apart = most([f"{_component(s)} {_ahead(angle)}" for s, angle in self.between.items()])
        if apart:
            return f"{said}; {apart}"
        if len(self.together) == 1 and not self.other_side:
            return f"{said} alone"
        return f"{said}, and the others hardly move" if self.is_still else said


def _component(state: str) -> str:
    return state.partition(".")[0]


def _ahead(angle: float) -> str:
    """Return an angle [degrees] in words, as ``leads by 87°``."""
    return f"{'leads' if angle > 0 else 'lags'} by {abs(angle):.0f}°"


@dataclass(frozen=True)
class Spectrum:
    """All eigenvalues [rad/s] of a model, and the modes of a frequency range, least damped first."""

    eigenvalues: NDArray[np.complex128]
    modes: list[Mode]
    # the mode of the largest real part at any frequency, zeros left out; None if all eigenvalues are zeros
    rightmost: Mode | None
    # left and right ones of all eigenvalues, as columns; None where they were not computed at once
    vectors: tuple[Vector, Vector] | None = None


def eigenvalues(model: LinearModel) -> NDArray[np.complex128]:
    """All eigenvalues [rad/s] without eigenvectors; ln(μ)/H for a step map."""
    return to_continuous(np.linalg.eigvals(model.A).astype(complex), model.step_size)[0]


def eigenvectors(model: LinearModel) -> tuple[NDArray[np.complex128], Vector, Vector]:
    """All eigenvalues [rad/s], with the left and the right eigenvectors as columns."""
    values, left, right = scipy.linalg.eig(model.A, left=True, right=True)
    lambdas, alive = to_continuous(values, model.step_size)
    return lambdas, left[:, alive], right[:, alive]


def in_range(values: NDArray[np.complex128], lowest_hz: float, highest_hz: float) -> list[int]:
    """Mask of the eigenvalues [rad/s] with a frequency in a range [Hz], both ends included, one of each conjugate
    pair."""
    hertz = values.imag / (2 * np.pi)
    mask = (values.imag >= 0) & (lowest_hz <= hertz) & (hertz <= highest_hz)
    return [int(k) for k in np.flatnonzero(mask)]


def find_modes(
    model: LinearModel,
    lowest_hz: float = ELECTROMECHANICAL_HZ[0],
    highest_hz: float = ELECTROMECHANICAL_HZ[1],
) -> list[Mode]:
    """Modes with a frequency in a range; see `find_spectrum`."""
    return find_spectrum(model, lowest_hz, highest_hz).modes


def find_spectrum(
    model: LinearModel,
    lowest_hz: float = ELECTROMECHANICAL_HZ[0],
    highest_hz: float = ELECTROMECHANICAL_HZ[1],
) -> Spectrum:
    """Every eigenvalue, and the modes with a frequency in a range, one of each conjugate pair.

    ``model``: step map or continuous matrix.
    ``lowest_hz`` and ``highest_hz``: range of Im λ/2π [Hz], both ends included; 0 includes real eigenvalues."""
    lambdas, vectors, every = _values_and_vectors(model)
    chosen, k = in_range(lambdas, lowest_hz, highest_hz), index_of_rightmost(lambdas)
    wanted = chosen if k is None else [*chosen, k]
    left, right = vectors(wanted)
    modes = [
        make_mode(lambdas[i], left[:, j], right[:, j], model.names) for j, i in enumerate(wanted)
    ]
    rightmost = None if k is None else modes.pop()
    return Spectrum(lambdas, least_damped_first(modes), rightmost, every)


def _values_and_vectors(
    model: LinearModel,
) -> tuple[
    NDArray[np.complex128],
    Callable[[Sequence[int]], tuple[Vector, Vector]],
    tuple[Vector, Vector] | None,
]:
    """All eigenvalues [rad/s], what gives the left and right eigenvectors of some of them, as columns, and all
    eigenvectors where they are there already."""
    if len(model.names) <= ALL_VECTORS:
        lambdas, left, right = eigenvectors(model)
        return lambdas, lambda chosen: (left[:, chosen], right[:, chosen]), (left, right)
    form = RealSchur(model.A)
    lambdas, alive = to_continuous(form.values, model.step_size)
    places = np.flatnonzero(alive)
    return lambdas, lambda chosen: form.vectors(places[chosen].tolist()), None


def index_of_rightmost(values: NDArray[np.complex128]) -> int | None:
    """Place of the largest real part among eigenvalues [rad/s], zeros left out; of a pair, that of the upper half."""
    candidates = np.flatnonzero((np.abs(values) > ZERO) & (values.imag >= 0))
    return int(candidates[np.argmax(values.real[candidates])]) if len(candidates) else None


def oscillations(values: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Mask of the eigenvalues [rad/s] that are oscillations, one of each pair: neither real poles nor zeros."""
    values = np.asarray(values)
    mask: NDArray[np.bool_] = (values.imag > _REAL * np.abs(values.real)) & (np.abs(values) > ZERO)
    return mask


def least_damped_first(modes: Iterable[Mode]) -> list[Mode]:
    return sorted(modes, key=lambda mode: (mode.damping_ratio, mode.frequency_hz))


def to_continuous(
    values: NDArray[np.complex128], step_size: float | None
) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Eigenvalues λ [rad/s] from those of a model's matrix, and a mask of those that are modes."""
    if step_size is None:
        return values.astype(complex), np.ones(len(values), dtype=bool)
    alive = np.abs(values) > _DEAD
    return np.log(values[alive].astype(complex)) / step_size, alive


def make_mode(
    value: complex,
    left: NDArray[np.complex128],
    right: NDArray[np.complex128],
    names: tuple[str, ...],
) -> Mode:
    """A mode from its eigenvalue λ [rad/s] and the eigenvectors of A and Aᴴ, each of shape (n,).

    ``left``: eigenvector of Aᴴ, shape (n,), of any length and angle.
    ``right``: eigenvector of A, shape (n,), of any length and angle."""
    factors = np.abs(left.conj() * right)
    factors /= factors.sum()
    order = np.argsort(-factors)
    shape = right / right[np.argmax(np.abs(right))]
    overlap = np.vdot(left, shape)
    scaled = left / overlap.conjugate() if overlap else left
    return Mode(
        complex(value),
        tuple(zip(map(names.__getitem__, order.tolist()), factors[order].tolist(), strict=True)),
        ReadOnlyTable(zip(names, shape.tolist(), strict=True)),
        ReadOnlyTable(zip(names, scaled.tolist(), strict=True)),
    )

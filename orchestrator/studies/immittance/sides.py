"""The two sides of a cut, each a matrix over s = jω: interpolated from a scan, or exact from a linear model."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Complex, Matrix, Numbers, Vector
from orchestrator.studies.immittance.poles import unstable_poles

# this near to 0 [rad/s] poles are the free angle's and clocks'; the path passes on the right
NEAR_ZERO = 1e-3

ON_AXIS = 1e-7
"""Poles of models whose damping is less than this are on the axis, as of coils and capacitors without losses; the path
goes round them to the right, too."""

_RESOLVED = 0.3
"""A curve is resolved if a cubic through its neighbours predicts a left-out value with at most this part of a straight
line's error."""

_SHARE = 0.5  # part of the cubic's error that bounds the interpolation's, with room to spare
_NOISE = 1e-3  # part of the value up to which the error of an unresolved curve is noise
# a larger error may be the flank of something between the frequencies that is larger by this factor
_UNRESOLVED = 6.0

_AT_ONCE = 200  # points whose matrices are held at a time


class Side(Protocol):
    """A matrix over the imaginary axis, of which it is known how sure it is and how many unstable poles it has.

    ``frequencies``: At which it is known best [Hz]; ``is_exact``: whether at every one."""

    @property
    def name(self) -> str: ...

    @property
    def frequencies(self) -> Numbers: ...

    @property
    def is_exact(self) -> bool: ...

    @property
    def unstable(self) -> tuple[complex, ...]: ...

    def at(self, s: Vector) -> Complex:
        """Its values at s, on the imaginary axis or close beside it, shape (f, n, n)."""

    def error(self, s: Vector) -> Numbers:
        """Bound of their error in the 2-norm, shape (f,)."""


@dataclass(frozen=True)
class Sampled:
    """A matrix known at some frequencies, interpolated by cubics through four of them."""

    name: str
    frequencies: Numbers
    values: Vector
    bounds: Numbers
    is_exact: bool = False
    # scans that it is made of, whose unstable poles no other one covers
    parts: tuple["Sampled", ...] = ()

    @cached_property
    def unstable(self) -> tuple[complex, ...]:
        parts = [unstable_poles(one.frequencies, one.values) for one in self.parts or (self,)]
        return tuple(pole for poles in parts for pole in poles)

    def at(self, s: Vector) -> Complex:
        f = s.imag / (2 * np.pi)
        first = np.clip(np.searchsorted(self.frequencies, f) - 2, 0, len(self.frequencies) - 4)
        return _lagrange(self.frequencies, self.values, f, first[:, None] + np.arange(4))

    def error(self, s: Vector) -> Numbers:
        f = s.imag / (2 * np.pi)
        right = np.clip(np.searchsorted(self.frequencies, f), 1, len(self.frequencies) - 1)
        found = np.maximum(self._left_out[right - 1], self._left_out[right])
        return np.asarray(found + np.maximum(self.bounds[right - 1], self.bounds[right]))

    @cached_property
    def _left_out(self) -> Numbers:
        """Error of the interpolation at each frequency, from predicting its value by those beside it."""
        f, count = self.frequencies, len(self.frequencies)
        k = np.arange(2, count - 2)
        cubic = (
            _lagrange(f, self.values, f[k], k[:, None] + np.array([-2, -1, 1, 2])) - self.values[k]
        )
        straight = _lagrange(f, self.values, f[k], k[:, None] + np.array([-1, 1])) - self.values[k]
        small, large = (np.linalg.norm(e, ord=2, axis=(1, 2)) for e in (cubic, straight))
        size = np.linalg.norm(self.values[k], ord=2, axis=(1, 2))
        factor = np.where(
            small <= _RESOLVED * large, _SHARE, np.where(small < _NOISE * size, 1.0, _UNRESOLVED)
        )
        rounding = 1e-9 * size
        return np.pad(np.minimum(factor * small, large + 10 * small) + rounding, 2, mode="edge")


def _lagrange(f: Numbers, values: Vector, at: Numbers, places: Vector) -> Complex:
    """Polynomials through values at some places (n, m), evaluated at n frequencies."""
    nodes = f[places]
    total = np.zeros((len(at), *values.shape[1:]), dtype=complex)
    for i in range(places.shape[1]):
        others = np.delete(nodes, i, axis=1)
        weight = np.prod((at[:, None] - others) / (nodes[:, i : i + 1] - others), axis=1)
        total += weight[:, None, None] * values[places[:, i]]
    return total


class Known:
    """A side that is known everywhere, and its poles [rad/s] with it."""

    is_exact = True
    poles: Complex

    @property
    def frequencies(self) -> Numbers:
        return np.sort(np.abs(self.poles.imag)) / (2 * np.pi)

    @property
    def unstable(self) -> tuple[complex, ...]:
        return tuple(
            p for p in self.poles.tolist() if p.real > ON_AXIS * abs(p) and abs(p) > NEAR_ZERO
        )

    def error(self, s: Vector) -> Numbers:
        return np.zeros(len(s))


@dataclass(frozen=True)
class Exact(Known):
    """C·(sI − A)⁻¹·B + D of a continuous model; by its modes where they give the same."""

    name: str
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    @cached_property
    def _modes(self) -> tuple[Complex, Complex, Complex] | None:
        """Eigenvalues, and C and B in their coordinates; None where the eigenvectors are nearly dependent."""
        values, vectors = np.linalg.eig(self.A)
        try:
            found = values, self.C @ vectors, np.linalg.solve(vectors, self.B.astype(complex))
        except np.linalg.LinAlgError:
            return None
        probes = np.array([1e-3, 0.3j, 50j + 1, 4e3j])
        direct, modal = self._direct(probes), self._modal(probes, found)
        alike = np.abs(direct - modal).max() <= 1e-9 * max(1.0, np.abs(direct).max())
        return found if alike else None

    @cached_property
    def poles(self) -> Complex:  # type: ignore[override]
        return np.asarray(np.linalg.eigvals(self.A), dtype=complex)

    def at(self, s: Vector) -> Complex:
        return self._direct(s) if self._modes is None else self._modal(s, self._modes)

    def _direct(self, s: Vector) -> Complex:
        found = [
            self.C @ np.linalg.solve(x * np.eye(len(self.A)) - self.A, self.B) for x in s.tolist()
        ]
        return np.asarray(np.array(found, dtype=complex).reshape(len(s), *self.D.shape) + self.D)

    def _modal(self, s: Vector, modes: tuple[Complex, Complex, Complex]) -> Complex:
        values, C, B = modes
        parts = [
            (C / (s[k : k + _AT_ONCE, None, None] - values)) @ B for k in range(0, len(s), _AT_ONCE)
        ]
        return np.asarray(np.concatenate([*parts, np.zeros((0, *self.D.shape))]) + self.D)

    def negated(self) -> "Exact":
        return replace(self, C=-self.C, D=-self.D)


_FEW = 4  # devices that are named one by one

Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Unit:
    """Devices that are connected otherwise than by the network, mostly one: their admittance at rows of the ports."""

    devices: tuple[str, ...]
    rows: Rows
    side: Exact


@dataclass(frozen=True)
class Together(Known):
    """The admittances of units at ``size`` rows; those at one bus add up."""

    name: str
    units: tuple[Unit, ...]
    size: int

    @cached_property
    def poles(self) -> Complex:  # type: ignore[override]
        return np.concatenate([unit.side.poles for unit in self.units])

    def at(self, s: Vector) -> Complex:
        found = np.zeros((len(s), self.size, self.size), dtype=complex)
        for unit in self.units:
            found[:, unit.rows[:, None], unit.rows] += unit.side.at(s)
        return found


@dataclass(frozen=True)
class Behind(Known):
    """The impedance at some rows of a network with the other devices connected; ``poles`` are of both together."""

    name: str
    alone: Exact
    others: Together
    rows: Rows
    poles: Complex

    def at(self, s: Vector) -> Complex:
        return np.concatenate(
            [self._at(s[k : k + _AT_ONCE]) for k in range(0, max(len(s), 1), _AT_ONCE)]
        )

    def _at(self, s: Vector) -> Complex:
        Z = self.alone.at(s)
        closed = np.linalg.solve(np.eye(Z.shape[-1]) + Z @ self.others.at(s), Z[:, :, self.rows])
        return np.asarray(closed[:, self.rows])


def short_name(devices: str) -> str:
    """A side's name for a line: many devices are counted."""
    count = devices.count(",") + 1
    return devices if count <= _FEW else f"{devices.partition(',')[0]} and {count - 1} more"

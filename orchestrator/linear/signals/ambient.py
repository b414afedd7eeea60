"""Modes of a system that noise shakes: covariance-driven stochastic subspace identification, with what the data allow.

Van Overschee and De Moor, "Subspace identification for linear systems", Kluwer, 1996; Peeters and De Roeck,
"Reference-based stochastic subspace identification", Mechanical Systems and Signal Processing 13(6), 1999. Errors are
the jackknife's over parts of the record."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import AnalysisError
from orchestrator.linear.spectra.modes import OfEigenvalue, damping_percent

_RATE = 4.0  # samples used per period of the highest frequency
# rows of the covariance's matrix [s]; longer ones take noise for modes in a record of a minute
_LAGS = 1.5
_PARTS = 10  # of the record, each left out once
_ORDERS = range(4, 13, 2)
_NEAR = 0.1  # distance of two eigenvalues, in sizes, up to which they are one mode
_OFTEN = 0.6  # part of the orders in which a mode has to be
_LARGEST_DAMPING = 30.0
# half-width of the frequency's interval, as a part of it, beyond which a mode is none
_VAGUE = 0.15
_SHORTEST_PERIODS = 12  # of the lowest frequency that is looked for
_STUDENT = 2.262  # standard errors to the end of a 95 % interval from so many parts


@dataclass(frozen=True, slots=True)
class AmbientMode(OfEigenvalue):
    """A mode with half-widths of 95 % intervals, the part of the signals' variance that it makes, and its shape."""

    eigenvalue: complex
    frequency_error_hz: float
    damping_error_percent: float
    share: float
    shape: tuple[complex, ...]  # by signal, each as a part of its own deviation, the largest 1
    forced: bool = False  # whether it is a steady sine, whose damping says nothing


def ambient_modes(times: Numbers, values: Numbers, highest_hz: float = 2.5) -> list[AmbientMode]:
    """Modes in signals, shape (n, m), at even times [s], the one that makes most of their variance first."""
    interval, y = _prepared(times, values, highest_hz)
    lowest = _SHORTEST_PERIODS / (len(y) * interval)
    rows = max(10, round(_LAGS / interval))
    parts = _covariances(y, 2 * rows)
    whole = parts.mean(axis=0)
    basis = _Basis(whole, rows)
    found = {
        order: [
            m
            for m in basis.modes(order, interval)
            if lowest <= m[0].imag / (2 * np.pi) <= highest_hz
            and damping_percent(m[0]) < _LARGEST_DAMPING
        ]
        for order in _ORDERS
    }
    steady = _steady({order: [value for value, _, _ in modes] for order, modes in found.items()})
    others = (
        [_Basis((whole * len(parts) - part) / (len(parts) - 1), rows) for part in parts]
        if steady
        else []
    )
    modes = []
    for order, value in steady:
        again = np.array(
            [_nearest([v for v, _, _ in one.modes(order, interval)], value) for one in others]
        )
        frequency, damping = again.imag / (2 * np.pi), np.array([damping_percent(v) for v in again])
        spread = [
            float(_STUDENT * np.sqrt((len(again) - 1) * np.var(x))) for x in (frequency, damping)
        ]
        if spread[0] > _VAGUE * value.imag / (2 * np.pi):
            continue
        _, share, shape = next(m for m in found[order] if m[0] == value)
        modes.append(AmbientMode(value, spread[0], spread[1], share, tuple(shape.tolist())))
    return sorted(modes, key=lambda m: -m.share)


def _prepared(times: Numbers, values: Numbers, highest_hz: float) -> tuple[float, Numbers]:
    """Time between samples, and the signals without trend and without what is too fast, each of deviation 1."""
    steps = np.diff(times)
    step = float(np.median(steps)) if len(steps) else 0.0
    if not step or np.abs(steps - step).max() > 0.1 * step:
        raise AnalysisError(
            "ambient modes need even samples without gaps; give a part of the record that has them"
        )
    if step > 1 / (_RATE * highest_hz) * 1.01:
        raise AnalysisError(
            f"a sample every {step:g} s shows no modes up to {highest_hz:g} Hz; "
            f"it takes {_RATE * highest_hz:g} samples a second"
        )
    thin = max(1, int(1 / (_RATE * highest_hz * step) + 1e-6))
    x = np.linspace(-1, 1, len(values))
    line = np.column_stack([np.ones(len(values)), x, x**2])
    y = values - line @ np.linalg.lstsq(line, values, rcond=None)[0]
    if thin > 1:
        from scipy.signal import firwin  # noqa: PLC0415 - slow to import

        weights = firwin(8 * thin + 1, 0.8 / thin)
        if len(y) > 4 * len(weights):
            y = np.apply_along_axis(np.convolve, 0, y, weights, "valid")[::thin]
    fewest = 20 * max(_ORDERS)
    if len(y) < fewest or (y.std(axis=0) <= 1e-9 * np.abs(values).max(axis=0)).any():
        what = (
            "a signal is constant"
            if len(y) >= fewest
            else f"{len(values) * step:.3g} s are too short"
        )
        least = 1.2 * fewest / (_RATE * highest_hz)
        raise AnalysisError(
            f"{what}: no ambient modes can be identified; take {least:.0f} s or more of what moves"
        )
    return step * thin, np.asarray(y / y.std(axis=0))


def _covariances(y: Numbers, lags: int) -> Numbers:
    """Covariances of signals some lags apart, shape (parts, lags, m, m), each from one part of the record."""
    n = len(y) - lags
    edges = np.linspace(0, n, _PARTS + 1).astype(int)
    return np.array(
        [
            [y[a + lag : b + lag].T @ y[a:b] / (b - a) for lag in range(1, lags)]
            for a, b in pairwise(edges)
        ]
    )


class _Basis:
    """The subspace that covariances span."""

    def __init__(self, covariances: Numbers, rows: int) -> None:
        self.width = covariances.shape[-1]
        hankel = np.block([[covariances[a + b] for b in range(rows - 1)] for a in range(rows)])
        self.u, self.s, self.vh = np.linalg.svd(hankel, full_matrices=False)

    def modes(self, order: int, interval: float) -> list[tuple[complex, float, Complex]]:
        """Eigenvalue [rad/s], part of the variance, and shape of each oscillation."""
        order = min(order, len(self.s))
        observed = self.u[:, :order] * np.sqrt(self.s[:order])
        A = np.linalg.pinv(observed[: -self.width]) @ observed[self.width :]
        multipliers, right = np.linalg.eig(A)
        seen = observed[: self.width] @ right
        driven = np.linalg.solve(
            right, (np.sqrt(self.s[:order])[:, None] * self.vh[:order])[:, : self.width]
        )
        sizes = np.abs(np.einsum("ik,ki->k", seen, driven))
        values = np.log(multipliers.astype(complex) + 1e-300) / interval
        return [
            (
                complex(values[k]),
                float(2 * sizes[k] / sizes.sum()),
                seen[:, k] / seen[np.abs(seen[:, k]).argmax(), k],
            )
            for k in np.flatnonzero(values.imag > 0)
        ]


def _steady(found: dict[int, list[complex]]) -> list[tuple[int, complex]]:
    """Eigenvalues that are there at most orders, each at the order where it is nearest to the middle of them."""
    left = {order: list(values) for order, values in found.items()}
    kept = []
    for first in [v for order in sorted(left, reverse=True) for v in found[order]]:
        nearest = {order: _nearest(values, first) for order, values in left.items()}
        group = {
            k: v
            for k, v in nearest.items()
            if v is not None and abs(v - first) < _NEAR * abs(first)
        }
        if len(group) < _OFTEN * len(left):
            continue
        middle = complex(
            np.median([v.real for v in group.values()]), np.median([v.imag for v in group.values()])
        )
        order = min(group, key=lambda k: abs(group[k] - middle))
        kept.append((order, group[order]))
        for k, value in group.items():
            left[k].remove(value)
    return kept


def _nearest(values: list[complex], wanted: complex) -> complex | None:
    return min(values, key=lambda v: abs(v - wanted), default=None)

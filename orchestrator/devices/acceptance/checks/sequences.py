"""Positive and negative sequence of voltages and currents that are given as one complex number in the network's frame.

Three phases without a zero sequence are one number x = X₊ + conj(X₋)·e^(−2jωt) in the frame that turns with ω: phase a
is Re(x·e^(jωt)), phases b and c follow 120° and 240° later. X₊ and X₋ are the phasors of both sequences, of peaks."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from orchestrator.core.arrays import Complex, Numbers

THIRD = 2 * pi / 3  # from one phase to the next [rad]
PHASES = ("a", "b", "c")


@dataclass(frozen=True)
class SequencePair:
    """Phasors of the positive and of the negative sequence."""

    positive: complex
    negative: complex

    @property
    def of_phases(self) -> Numbers:
        """Amplitudes of phases a, b and c."""
        turn = np.exp(-1j * THIRD * np.arange(3))
        return np.asarray(np.abs(self.positive * turn + self.negative / turn))


def lines_of(values: Complex, times: Numbers, rates: Sequence[float]) -> Complex:
    """Amplitudes at angular frequencies [rad/s] of the frame, by least squares beside a straight drift."""
    basis = np.exp(1j * np.outer(times, rates))
    drift = (times - times.mean())[:, None]
    return np.asarray(np.linalg.lstsq(np.hstack([basis, drift]), values, rcond=None)[0][:-1])


# what both sequences and a nonlinear part of either make in the frame, in parts of the rated frequency
_SWINGS = (0, -2, 2, -4, 4)


def pair_of(values: Complex, times: Numbers, omega: float) -> SequencePair:
    """Both sequences of what swings at 0, ±2 and ±4 times the rated angular frequency [rad/s] in the frame."""
    constant, negative, *_ = lines_of(values, times, [k * omega for k in _SWINGS])
    return SequencePair(complex(constant), complex(negative.conjugate()))


def remainder_of(values: Complex, times: Numbers, omega: float) -> float:
    """The r.m.s. value of what swings otherwise in the frame, beside a straight drift."""
    rates = [k * omega for k in _SWINGS]
    left = values - np.exp(1j * np.outer(times, rates)) @ lines_of(values, times, rates)
    drift = times - times.mean()
    left -= drift * (left @ drift) / (drift @ drift)
    return float(np.sqrt(np.mean(np.abs(left) ** 2)))


def in_phases(values: Complex, times: Numbers, omega: float) -> Numbers:
    """Instantaneous values of phases a, b and c, shape (n, 3)."""
    angles: Numbers = omega * times[:, None] - THIRD * np.arange(3)
    return np.asarray((values[:, None] * np.exp(1j * angles)).real)


def cycles_of(phases: Numbers, steps: int) -> Numbers:
    """√2 times the r.m.s. value of each phase over each period of so many steps, shape (n − steps + 1, 3)."""
    sums = np.cumsum(np.vstack([np.zeros(3), phases**2]), axis=0)
    return np.asarray(np.sqrt(2 * np.maximum(sums[steps:] - sums[:-steps], 0) / steps))


@dataclass(frozen=True)
class Ripple:
    """Amplitudes of active and reactive power at twice the frequency."""

    p: float
    q: float


def ripple_of(voltage: SequencePair, current: SequencePair) -> Ripple:
    """Swing of the power that both sequences make: P swings by |V₊·I₋ + V₋·I₊|, Q by |V₊·I₋ − V₋·I₊|."""
    one, other = (
        voltage.positive * current.negative,
        voltage.negative * current.positive,
    )
    return Ripple(abs(one + other), abs(one - other))


def swap_b_and_c(values: Complex, times: Numbers, omega: float) -> Complex:
    """Values in the frame once phases b and c are exchanged."""
    return np.asarray(values.conj() * np.exp(-2j * omega * times))

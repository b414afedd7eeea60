"""Modes of two ring-downs that are nearly the same signal: found once, and set apart by the signals' difference.

An identification finds the modes of each signal with an error that is many times what the noise of the difference could
make. So the modes are those of the mean of both, and their shift is found in the difference by least squares: where λ
moves by δ, a swing a·e^(λt) changes by a·δ·t·e^(λt), beside a change of its size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.core.arrays import Complex, Matrix, Numbers, rms
from orchestrator.linear.signals.identification import IdentifiedMode
from orchestrator.studies.validation.correlation import correlation_length

_SMALL = 0.1
"""Part of the swings (rms) that the difference has at most. At a damping of 20 %, two swings are apart by so much if
their damping is by 4 points; a larger shift is not linear."""
_DEVIATIONS = 2.0  # standard deviations that are the doubt of a shift


@dataclass(frozen=True)
class RingDownShift:
    """A mode of the measured and the simulated signal, and the doubt of their shift: [%], [points of percent]."""

    modes: tuple[IdentifiedMode, IdentifiedMode]
    doubt: tuple[float, float]


def shared_modes(
    times: Numbers,
    signals: tuple[Numbers, Numbers],
    modes: Sequence[IdentifiedMode],
    strong: Sequence[IdentifiedMode],
) -> list[RingDownShift]:
    """Set the strong modes of two signals apart; none where the signals differ by more than a small part.

    Parameters
    ----------
    times:
        Of the samples [s].
    signals:
        The measured and the simulated signal.
    modes:
        Those of the mean of both.
    strong:
        Those of them that are set apart.
    """
    measured, simulated = signals
    since = times - times[0]
    drift = np.vander(since, 3)
    swings = {one: np.exp(one.eigenvalue * since) for one in modes}
    residues = _residues(drift, list(swings.values()), 0.5 * (measured + simulated))
    own = [residues[list(swings).index(one)] * swings[one] for one in strong]
    difference = simulated - measured
    if not own or rms(difference - difference.mean()) > _SMALL * rms(np.sum(own, axis=0).real):
        return []
    columns = [np.ones_like(since), since]
    for one, swing in zip(strong, own, strict=True):
        columns += [*_parts(since * swing), *_parts(swings[one])]
    table = np.column_stack(columns)
    if len(times) <= table.shape[1]:
        return []
    found, *_ = np.linalg.lstsq(table, difference, rcond=None)
    deviations = _deviations(table, difference - table @ found)
    return [
        _apart(one, complex(*found[k : k + 2]), complex(*deviations[k : k + 2]))
        for one, k in zip(strong, range(2, len(found), 4), strict=True)
    ]


def _parts(swing: Complex) -> tuple[Numbers, Numbers]:
    """The parts of a real signal that a real and an imaginary factor of a swing make."""
    return swing.real, -swing.imag


def _residues(drift: Matrix, swings: Sequence[Complex], values: Numbers) -> Complex:
    """The complex size of each swing in a signal that drifts as well."""
    columns = [*drift.T, *(part for swing in swings for part in _parts(swing))]
    found, *_ = np.linalg.lstsq(np.column_stack(columns), values, rcond=None)
    sizes = found[drift.shape[1] :]
    return np.asarray(sizes[::2] + 1j * sizes[1::2])


def _deviations(table: Matrix, rest: Numbers) -> Numbers:
    """The standard deviations of coefficients, from a rest that is alike from sample to sample."""
    free = len(rest) - table.shape[1]
    variance = float(rest @ rest) / free * correlation_length(rest)
    return np.asarray(np.sqrt(variance * np.diagonal(np.linalg.pinv(table.T @ table))))


def _apart(mode: IdentifiedMode, shift: complex, deviation: complex) -> RingDownShift:
    """A mode half a shift before and half a shift after where it is in the mean of both signals."""
    at = mode.eigenvalue
    pair = (
        replace(mode, eigenvalue=at - 0.5 * shift),
        replace(mode, eigenvalue=at + 0.5 * shift),
    )
    moved = [
        replace(mode, eigenvalue=at + _DEVIATIONS * step).damping_percent - mode.damping_percent
        for step in (deviation.real, 1j * deviation.imag)
    ]
    frequency = 100 * _DEVIATIONS * deviation.imag / at.imag
    return RingDownShift(pair, (abs(frequency), math.hypot(*moved)))

"""Modes in measured recordings: gaps, uneven samples and waveforms are refused, and the noise is estimated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import AnalysisError
from orchestrator.core.units import whole_percent
from orchestrator.linear.signals.identification import (
    IdentifiedMode,
    averaging,
    identify_modes,
    sampling,
)
from orchestrator.output.results.readers import LINE_FREQUENCY
from orchestrator.studies.signals.common_times import median_interval

if TYPE_CHECKING:
    import xarray as xr


_UNEVEN = 0.01  # part of the interval by which samples may be off
# part of a signal's power near the line's frequency from which it is a value of the grid's wave
_WAVEFORM = 0.5

_NEAR = 0.15  # part of the line's frequency within which power is counted as near it
# singular values below this part of the largest are noise: the resolution of 16 bits
_LEAST_NOISE = 1e-5
_FEWEST = 6  # samples whose Hankel matrix has a median worth the name


def is_measured(curve: xr.DataArray) -> bool:
    return LINE_FREQUENCY in curve.coords


def measured_modes(
    window: xr.DataArray, coarser: float = 1.0, order: int | None = None
) -> list[IdentifiedMode]:
    """Modes of a measured signal; ``order``: of the model, found from the signal's noise where it is not given.

    A model whose order is given needs no noise: the resolution tells which rows say nothing."""
    times, values = window["time"].values, np.asarray(window.values, dtype=float)
    _check(times, values, float(window.coords[LINE_FREQUENCY]))
    noise = _LEAST_NOISE if order else _singular_values(window)[1]
    deviation = values - float(values.mean())
    return identify_modes(times, deviation, tolerance=coarser * noise, order=order)


def order_of(window: xr.DataArray) -> int:
    """Number of exponentials that a measured signal holds beside its noise."""
    singular, noise = _singular_values(window)
    return int((singular > noise * singular[0]).sum())


def _singular_values(window: xr.DataArray) -> tuple[Numbers, float]:
    """Singular values of a signal's Hankel matrix, and below which part of the largest they are noise.

    Those are below 2.2 times the median, for a matrix with half as many columns as rows: Gavish and Donoho, "The
    optimal hard threshold for singular values is 4/sqrt(3)", IEEE Trans. Information Theory 60(8), 2014, equation 5."""
    times, values = window["time"].values, np.asarray(window.values, dtype=float)
    deviation = values - float(values.mean())
    thin = sampling(times).thin
    used = np.convolve(deviation, averaging(deviation, thin), mode="valid")[::thin]
    if len(used) < _FEWEST:
        return np.ones(1), _LEAST_NOISE
    hankel = np.lib.stride_tricks.sliding_window_view(used, len(used) // 3 + 1)
    singular = np.asarray(np.linalg.svd(hankel, compute_uv=False), dtype=float)
    beta = hankel.shape[1] / hankel.shape[0]
    factor = 0.56 * beta**3 - 0.95 * beta**2 + 1.82 * beta + 1.43
    return singular, max(_LEAST_NOISE, float(factor * np.median(singular) / (singular[0] or 1.0)))


def _check(times: Numbers, values: Numbers, line_frequency: float) -> None:
    if len(times) < 2:
        raise AnalysisError(
            "no mode can be identified in a signal of fewer than 2 samples; give an earlier start"
        )
    missing = ~np.isfinite(values)
    if missing.any():
        begin, end = _longest(~missing)
        stretch = f"from {times[begin]:.6g} to {times[end]:.6g} s"
        remedy = f"the longest stretch without a gap is {stretch}; choose it by the "
        raise AnalysisError(
            f"{int(missing.sum())} of {len(values)} samples are missing, the first at t = "
            f"{times[int(missing.argmax())]:.6g} s; {remedy}start and the stop"
        )
    steps = np.diff(times)
    off = np.abs(steps - steps[0]) > _UNEVEN * steps[0]
    if off.any():
        at = times[int(off.argmax())]
        raise AnalysisError(
            f"the sampling rate changes at t = {at:.6g} s, and modes need one rate; choose a start and a stop on one "
            "side of it"
        )
    share = _share_near(times, values, line_frequency)
    if share > _WAVEFORM:
        raise AnalysisError(
            f"{whole_percent(share)} of the signal's power lies near the line's frequency of {line_frequency:g} Hz: it "
            "is an instantaneous voltage or current, whose electromechanical modes cannot be read; use a channel of "
            "its RMS value, frequency, angle or power"
        )


def _share_near(times: Numbers, values: Numbers, frequency: float) -> float:
    """Part of the power within 15 % of a frequency."""
    interval = median_interval(times)
    deviation = (values - values.mean()) * np.hanning(len(values))
    power = np.abs(np.fft.rfft(deviation)) ** 2
    if not frequency or not power.sum() or frequency > 0.5 / interval:
        return 0.0
    at = np.fft.rfftfreq(len(values), interval)
    near = np.abs(at - frequency) < _NEAR * frequency
    return float(power[near].sum() / power.sum())


def _longest(good: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> tuple[int, int]:
    """First and last index of the longest run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    if not len(edges):
        return 0, 0
    begins, ends = edges[::2], edges[1::2] - 1
    k = int((ends - begins).argmax())
    return int(begins[k]), int(ends[k])

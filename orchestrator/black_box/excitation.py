"""Signals that excite a device, and its frequency response from the responses to them.

The device is seen at communication points: u[k] holds over step k, and y[k] is read at its end. Its response is
M(z) = Σ m[k]·z^(−k−1) at z = e^(jωH), where m is the response to u = 1, 0, 0, …"""

import numpy as np
from numpy.typing import NDArray

from orchestrator.arrays import Complex, Numbers

_CHUNK = 4096


def odd_lines(lowest_hz: float, highest_hz: float, count: int) -> NDArray[np.int64]:
    """About ``count`` odd multiples of the lowest frequency up to the highest, spread over its logarithm.

    Even multiples stay silent, so that a quadratic part of the device does not reach the excited ones."""
    last = int((highest_hz / lowest_hz * (1 + 1e-9) - 1) // 2)  # the largest odd multiple is 2·last + 1
    wanted = (np.geomspace(1.0, 2 * last + 1, count) - 1) / 2
    return np.asarray(2 * np.unique(np.round(wanted).astype(np.int64)) + 1)


def multisine(lines: NDArray[np.int64], period: int, amplitude: float) -> Numbers:
    """One period of a sum of cosines of equal size. Schroeder's phases keep its peak low.

    ``lines``: multiples of the base frequency; ``amplitude``: largest magnitude of the sum."""
    n = np.arange(len(lines))
    spectrum = np.zeros(period // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(-1j * np.pi * n * (n + 1) / len(lines))
    signal = np.fft.irfft(spectrum, period)
    return np.asarray(signal * (amplitude / np.abs(signal).max()))


def line_response(u: Numbers, y: Numbers, lines: NDArray[np.int64]) -> Complex:
    """M at the excited lines from whole periods, shape (f, p)."""
    delay = np.exp(-2j * np.pi * lines / len(u))  # y[k] is read one step after u[k] begins
    return np.asarray(np.fft.rfft(y, axis=0)[lines] / np.fft.rfft(u)[lines][:, None] * delay[:, None])


def pulse_response(m: Numbers, frequencies: Numbers, step_size: float) -> Complex:
    """M at any frequencies [Hz] from the response to a pulse of one step, shape (f, p)."""
    total = np.zeros((len(frequencies), m.shape[1]), dtype=complex)
    turn = -2j * np.pi * np.asarray(frequencies)[:, None] * step_size
    within = np.exp(turn * (np.arange(_CHUNK) + 1)[None, :])
    for first in range(0, len(m), _CHUNK):
        part = m[first : first + _CHUNK]
        total += np.exp(turn * first) * (within[:, : len(part)] @ part)
    return total

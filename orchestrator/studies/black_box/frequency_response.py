"""Frequency response of a device on the test bench, by multi-sine or by pulses, each value with a bound.

The device is seen at communication points: u[k] holds over step k, and y[k] is read at its end. Its response is
M(z) = Σ m[k]·z^(−k−1) at z = e^(jωH), where m is the response to u = 1, 0, 0, …"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain, repeat
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import AnalysisError
from orchestrator.core.options import Option, command
from orchestrator.studies.black_box.bench import Bench, Runs

_CHUNK = 4096


def odd_lines(lowest_hz: float, highest_hz: float, count: int) -> NDArray[np.int64]:
    """About ``count`` odd multiples of the lowest frequency up to the highest, spread over its logarithm.

    Even multiples stay silent, so that a quadratic part of the device does not reach the excited ones."""
    # the largest odd multiple is 2·last + 1
    last = int((highest_hz / lowest_hz * (1 + 1e-9) - 1) // 2)
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
    return np.asarray(
        np.fft.rfft(y, axis=0)[lines] / np.fft.rfft(u)[lines][:, None] * delay[:, None]
    )


def pulse_response(m: Numbers, frequencies: Numbers, step_size: float) -> Complex:
    """M at any frequencies [Hz] from the response to a pulse of one step, shape (f, p)."""
    total = np.zeros((len(frequencies), m.shape[1]), dtype=complex)
    turn = -2j * np.pi * np.asarray(frequencies)[:, None] * step_size
    within = np.exp(turn * (np.arange(_CHUNK) + 1)[None, :])
    for first in range(0, len(m), _CHUNK):
        part = m[first : first + _CHUNK]
        total += np.exp(turn * first) * (within[:, : len(part)] @ part)
    return total


METHODS = ("multisine", "pulse")
_DRIFTS = 2e-3  # part of a response by which it may go on changing; its bound is the change of the whole time
_AT_ONE_RATE = (
    0.05  # part by which two such changes may differ; what dies away or grows differs more
)
_MOST_SECONDS = 400.0  # time after which a response must have settled [s]
# shortest time between two compared periods [s]: short ones in direct succession look alike
_APART = 10.0

_AWAY = 0.1
"""Every excitation has a mean of zero or ends at zero, and the response must do the same. A device whose response keeps
more than this part of its size has left the operating point."""


_LINEAR = 5e-4
"""Largest difference of two responses, at an amplitude and at half of it, as a part of them, up to which nobody is
warned: from here on fitted models of our converters had poles too many."""
_AIMED = 1e-4
"""The difference at the amplitude that a warning advises; it grows with the amplitude's square."""


@dataclass(frozen=True)
class Excitation:
    # ``multisine``: periods of many sines until they repeat. ``pulse``: one step up and one step down, each followed
    # until it has died out.
    method: str = "multisine"
    # lowest_hz, highest_hz, lines: range of frequencies [Hz], and approximate number of frequencies
    lowest_hz: float = 0.05
    highest_hz: float = 1000.0
    lines: int = 120
    # Largest deviation of an input [its unit]. Every measurement is repeated with half of it.
    amplitude: float = 1e-3
    # two successive periods, or the rest of a pulse response, may still differ by this part of the largest response
    settled: float = 1e-5

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method {self.method!r}; choose from {', '.join(METHODS)}")


@dataclass(frozen=True)
class FrequencyResponse:
    """A measured response M(e^(jωH)): inputs held over a step, outputs read at its end."""

    frequencies: Numbers  # [Hz], shape (f,)
    values: Complex  # shape (f, p, m)
    # Bound of the error of every value, shape (f, p, m): the sum of its differences from the value at half the
    # amplitude and from the last repetition. It covers noise, transients and the leading nonlinearity.
    bounds: Numbers
    feedthrough: Numbers  # direct effect of inputs on outputs, shape (p, m)
    operating_point: Numbers  # outputs at rest, shape (p,)
    step_size: float  # communication step [s]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    seconds: float  # time simulated on the bench [s]
    method: str
    amplitude: float = 0.0  # largest deviation of an input [its unit]
    # largest difference from the response at half the amplitude, relative to it at the same frequency (2-norms)
    nonlinearity: float = 0.0

    @property
    def z(self) -> Complex:
        return np.asarray(np.exp(2j * np.pi * self.frequencies * self.step_size))

    @property
    def strictly_proper(self) -> Complex:
        """C·(z − A)⁻¹·B: what remains of M without the direct feed-through, which is read a step late."""
        return np.asarray(self.values - self.feedthrough / self.z[:, None, None])

    @property
    def largest_bound(self) -> float:
        """Largest bound of all frequencies, relative to the response at the same frequency (2-norms)."""
        return _largest_part(self.bounds, self.values)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence where the response depends on the amplitude, so that a model of it may have poles of its own."""
        if self.nonlinearity <= _LINEAR:
            return ()
        smaller = self.amplitude * sqrt(_AIMED / self.nonlinearity)
        apart = f"{100 * self.nonlinearity:.2g} %"
        return (
            f"at half the amplitude of {self.amplitude:g} the response differs by up to {apart}: it is not that of "
            "small changes, and the fitted model may have poles that the device does not have; take "
            + Option.AMPLITUDE
            + f" {smaller:.1g}",
        )

    def continuous(self) -> Complex:
        """The response of the device itself, without the hold: M over (1 − e^(−jωH))/(jωH).

        Components above half the communication rate appear at lower frequencies; they are ignored. The result is close
        only well below half the communication rate."""
        x = 2j * np.pi * self.frequencies * self.step_size
        return np.asarray(self.values * (x / (1 - np.exp(-x)))[:, None, None])


def measure(
    bench: Bench, excitation: Excitation, report: Callable[[str], None] | None = None
) -> FrequencyResponse:
    lines = odd_lines(excitation.lowest_hz, excitation.highest_hz, excitation.lines)
    frequencies = lines * excitation.lowest_hz
    if frequencies[-1] * bench.step_size >= 0.5:
        raise AnalysisError(
            f"{frequencies[-1]:g} Hz cannot be seen at communication points {bench.step_size:g} s apart; take a "
            "shorter step or a lower highest frequency"
        )
    values = np.zeros((len(lines), len(bench.outputs), len(bench.inputs)), dtype=complex)
    bounds, differences = np.zeros(values.shape), np.zeros(values.shape)
    seconds = 0.0
    told, runs_in_all = report or (lambda text: None), 2 * len(bench.inputs)
    told(f"{bench.description.path.name}: brought to rest at an ideal bus")
    with bench.runs() as runs:
        direct, operating_point = runs.feedthrough(excitation.amplitude), runs.operating_point
        for column in range(len(bench.inputs)):
            found: list[tuple[Complex, Numbers]] = []
            for amplitude in (excitation.amplitude, excitation.amplitude / 2):
                told(
                    f"{bench.description.path.name}: response to {bench.inputs[column]} from {frequencies[0]:g} to "
                    f"{frequencies[-1]:.4g} Hz, run {2 * column + len(found) + 1} of {runs_in_all}"
                )
                one = _by_pulses if excitation.method == "pulse" else _by_multisine
                response, uncertainty, time = one(runs, bench, excitation, lines, column, amplitude)
                found.append((response, uncertainty))
                seconds += time
            (full, at_full), (half, at_half) = found
            # The error of lowest order grows with the square of the amplitude: from both it can be taken out.
            values[:, :, column] = half + (half - full) / 3
            differences[:, :, column] = np.abs(half - full)
            bounds[:, :, column] = np.abs(half - full) + np.maximum(at_full, at_half)
    names = tuple(bench.inputs), tuple(bench.outputs)
    measured = np.asarray(frequencies, dtype=float), values, bounds, direct, operating_point
    return FrequencyResponse(
        *measured,
        bench.step_size,
        *names,
        seconds,
        excitation.method,
        amplitude=excitation.amplitude,
        nonlinearity=_largest_part(differences, values),
    )


def _largest_part(parts: Numbers, values: Complex) -> float:
    """The largest of some parts of a response, relative to it at the same frequency (2-norms)."""
    size = np.linalg.norm(values, ord=2, axis=(1, 2))
    return float((np.linalg.norm(parts, ord=2, axis=(1, 2)) / size).max())


def _by_multisine(
    runs: Runs, bench: Bench, e: Excitation, lines: NDArray[np.int64], column: int, amplitude: float
) -> tuple[Complex, Numbers, float]:
    """Response at the lines, and the difference of two successive periods, each of shape (f, p)."""
    period = round(1 / (e.lowest_hz * bench.step_size))
    if abs(period * e.lowest_hz * bench.step_size - 1) > 1e-9:
        raise AnalysisError(
            f"a period of {e.lowest_hz:g} Hz is no whole number of steps of {bench.step_size:g} s; choose another"
        )
    u = multisine(lines, period, amplitude)
    deviations = np.zeros((period, len(bench.inputs)))
    deviations[:, column] = u
    seconds = period * bench.step_size
    apart, most = ceil(_APART / seconds), ceil(_MOST_SECONDS / seconds)
    found: list[Complex] = []
    for y in runs.respond(repeat(deviations, max(most, 2 * apart))):
        found.append(line_response(u, y, lines))
        if len(found) > apart:
            change = np.abs(found[-1] - found[-1 - apart])
            if change.max() <= e.settled * np.abs(found[-1]).max():
                mean = y.mean(axis=0)
                _check_returned(bench, column, np.abs(mean).max(), np.abs(y - mean).max())
                return found[-1], change, len(found) * seconds
    if _drifts_evenly(found, apart):
        mean = y.mean(axis=0)
        _check_returned(bench, column, np.abs(mean).max(), np.abs(y - mean).max())
        return found[-1], change * len(found) / apart, len(found) * seconds
    raise AnalysisError(
        f"{bench.description.path.name}: after {len(found) * seconds:g} s of a "
        f"periodic {bench.inputs[column]} its response still changes by "
        f"{change.max() / np.abs(found[-1]).max():.2g} over {apart * seconds:g} s; it "
        "is unstable at an ideal bus, or slower than that, or follows what it "
        "stores, such as a battery's charge: try "
        + command("fmu admittance", (Option.METHOD, "pulse"))
        + ", or a smaller amplitude"
    )


def _drifts_evenly(found: list[Complex], apart: int) -> bool:
    """Return whether a response changes little and at one rate, as that of a battery with its charge."""
    last, before = (found[-1 - k] - found[-1 - k - apart] for k in (0, apart))
    size, moved = np.abs(found[-1]).max(), np.abs(last).max()
    return bool(moved <= _DRIFTS * size and np.abs(last - before).max() <= _AT_ONE_RATE * moved)


def _by_pulses(
    runs: Runs, bench: Bench, e: Excitation, lines: NDArray[np.int64], column: int, amplitude: float
) -> tuple[Complex, Numbers, float]:
    """Response and difference from a pulse up and a pulse down; the even parts of the device cancel."""
    part = round(_APART / bench.step_size)
    silence = np.zeros((part, len(bench.inputs)))
    frequencies: Numbers = np.asarray(lines * e.lowest_hz, dtype=float)
    sums, changes, seconds = [], [], 0.0
    for sign in (1.0, -1.0):
        pulse = silence.copy()
        pulse[0, column] = sign * amplitude
        parts = chain([pulse], repeat(silence, ceil(_MOST_SECONDS / _APART) - 1))
        total = np.zeros((len(lines), len(bench.outputs)), dtype=complex)
        largest = 0.0
        turn = np.exp(-2j * np.pi * frequencies * part * bench.step_size)[:, None]
        for number, y in enumerate(runs.respond(parts)):
            largest = max(largest, float(np.abs(y).max()))
            added = (
                pulse_response(y, frequencies, bench.step_size) * turn**number / (sign * amplitude)
            )
            total += added
            if np.abs(added).max() <= e.settled * np.abs(total).max():
                break
        else:
            raise AnalysisError(
                f"{bench.description.path.name}: its response to a pulse of {bench.inputs[column]} has not died out "
                f"after {_MOST_SECONDS:g} s; it is unstable at an ideal bus, or its slowest time constant is longer"
            )
        _check_returned(bench, column, np.abs(y[-1]).max(), largest)
        seconds += (number + 1) * part * bench.step_size
        sums.append(total)
        changes.append(np.abs(added))
    return np.asarray((sums[0] + sums[1]) / 2), np.maximum(changes[0], changes[1]), seconds


def _check_returned(bench: Bench, column: int, away: float, size: float) -> None:
    """A device that ran away to another operating point answers there as calmly as a stable one."""
    if not away <= _AWAY * size:
        raise AnalysisError(
            f"{bench.description.path.name}: excited by a small {bench.inputs[column]} at an ideal bus, its outputs "
            f"left the operating point by {away:.3g} pu and stayed away, with a response of {size:.3g} pu; it is "
            "unstable at an ideal bus, or at the edge of a limit: check the signs of its controls and its operating "
            "point; a black box is identified only where it is stable at an ideal bus"
        )

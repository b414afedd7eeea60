"""A second event in one recording: a switching or a reclosing later on, a ramp, or a swing that somebody drives.

What rings after it is no ring-down of the first one, and what jumps in it is no error after the first one. Play-back
itself bears it: the voltage holds both events."""

from __future__ import annotations

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.filled import Mask
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.windows import Windows

_GRAIN = 0.02  # time [s] of which the largest bend is looked at: a period
_JUMP = 0.04  # time [s] over which a bend of a signal is a jump: a PMU's means jump within it
_SWING = 0.3  # the same, of a swing
_LATER = 0.3  # time [s] after the first event's window, from which on another one is looked for
_NEAR = 0.08  # time [s] within which voltage and power jump together, and what is before ends
_BESIDE = 0.4  # time [s] before a jump with which it is compared
_STANDS_OUT = 3.0  # times the bends just before, from which on one is a jump
_OF_SWING = 0.05  # part of the first swing's bend that a second jump has at least
_LEAST = 5e-4  # smallest bend [pu] of voltage and of power that is an event's
_BLOCK = 1.0  # time [s] of which the largest bend is a swing's size
_GROWS = 3.0
"""Times the least that a swing had become, from which on a larger one is another event's; two modes that beat reached
2.2."""
_AS_LARGE = 0.5  # part of the swing just after the event that such a swing has at least
_BEGINS = 1.5  # times the least of a swing, up to which it has not grown
_OWN = 2.0  # time [s] after the event's begin in which it moves a plant the most
_ABOVE = 3.0  # times the movement before the event, from which on a frequency moves
_LEAST_HZ = 0.005  # smallest movement [Hz] of the frequency that is an event's
_FEWEST = 2  # means before an event that show how a frequency moves
_CALMS = 0.6  # part of its first swing in 2 s to which P calms down between two events
_TURN = 2 * np.pi
_ENDS = 0.1
"""Time [s] at the end in which a mean or a filter of the recorder ends: 21 of 72 PMU's recordings jumped there."""
_LEAST_VOLTAGE = 0.05  # [pu]: in a deeper dip a logarithm says nothing


def second_event(recording: Recording, windows: Windows) -> float | None:
    """Find when a second event begins after the window of the first one [s from the first sample].

    It shows in voltage and power alike: a jump that stands out from what is just before, or a swing that has become
    small and grows again. A swing that grows from the event on is none: so rings a plant that is unstable."""
    is_over = windows.end + _LATER > recording.length - _ENDS
    if is_over or not (windows.seen or windows.chosen):
        return None
    whole = len(recording.voltage) - round(_ENDS / recording.interval)
    magnitude = np.maximum(np.abs(recording.voltage), _LEAST_VOLTAGE)
    voltage = np.log(magnitude) + 1j * np.unwrap(np.angle(recording.voltage))
    signals = (np.asarray(voltage[:whole]), recording.power[:whole])
    looks = (_jump, _growth, _larger)
    jump, *slow = (look(recording, windows, signals) for look in looks)
    first = min((one for one in slow if one is not None), default=None)
    if jump is not None and (first is None or jump <= first + _BLOCK):
        return jump  # the same event: a jump tells its time best
    return first


def _jump(recording: Recording, windows: Windows, signals: tuple[Complex, Complex]) -> float | None:
    """The begin of the first jump of both signals."""
    grain = _grain(recording)
    near, beside = (max(1, round(time / grain)) for time in (_NEAR, _BESIDE))
    after = int((windows.end + _SWING) / grain) + 1
    both: list[Mask] = []
    for signal in signals:
        bends = _bends(recording, signal, _JUMP)
        if len(bends) <= near:
            return None  # as where times in minutes are read as seconds
        swing = _bends(recording, signal, _SWING)[after:][: round(_BLOCK / grain)]
        behind = np.concatenate([np.full(near, np.inf), bends[: len(bends) - near]])
        before = _largest(np.concatenate([np.full(beside - 1, 0.0), behind]), beside)
        least = np.maximum(_STANDS_OUT * before, max(_LEAST, _OF_SWING * swing.max(initial=0.0)))
        jumps = np.concatenate([bends > least, np.zeros(near - 1, dtype=bool)])
        both.append(_largest(jumps.astype(float), near) > 0)
    wanted = int((windows.end + _LATER) / grain) + 1
    at = np.flatnonzero((both[0] & both[1])[wanted:])
    # a bend is seen from the time over which it is taken before the jump on
    return None if not len(at) else grain * (wanted + int(at[0]) + near)


def _growth(
    recording: Recording, windows: Windows, signals: tuple[Complex, Complex]
) -> float | None:
    """The moment from which on the swing of both signals grows after it had become small."""
    grain = _grain(recording)
    block = max(1, round(_BLOCK / grain))
    first = int((windows.end + _SWING) / grain) + 1
    grown, small = [], []
    for signal in signals:
        bends = _bends(recording, signal, _SWING)[first:]
        if len(bends) <= block:
            return None
        sizes = _largest(bends, block)
        least = np.maximum(np.minimum.accumulate(sizes), _LEAST)
        grown.append(sizes > np.maximum(_GROWS * least, _AS_LARGE * sizes[0]))
        small.append(sizes <= _BEGINS * least)
    at = np.flatnonzero(grown[0] & grown[1])
    if not len(at):
        return None
    quiet = np.flatnonzero((small[0] & small[1])[: at[0]])
    return grain * (first + (int(quiet[-1]) if len(quiet) else 0) + block)


def _larger(
    recording: Recording, windows: Windows, signals: tuple[Complex, Complex]
) -> float | None:
    """The moment from which on the frequency moves by more than after the event, and P swings anew."""
    grain = _grain(recording)
    block, own = (max(1, round(time / grain)) for time in (_BLOCK, _OWN))
    begin, end = (int(time / grain) for time in (windows.begin, windows.end))
    angle, power = (_means(recording, one) for one in (signals[0].imag, signals[1].real))
    frequency = np.gradient(angle, grain) / _TURN
    later = max(begin + own, end + block)
    if len(frequency) < later + block or begin < _FEWEST:
        return None
    first = float(np.ptp(frequency[begin:later]))
    before = float(np.ptp(frequency[: begin - 1]))
    moves = _movement(frequency, block)[later:]
    at = np.flatnonzero(moves > max(first, _ABOVE * before, _LEAST_HZ))
    swings = _movement(power, own)[end : later + int(at[0]) + block - own] if len(at) else at
    if not len(swings):
        return None
    quiet = np.flatnonzero(swings <= _BEGINS * swings.min())
    if (
        swings.min() > _CALMS * swings[0]
    ):  # so an unstable plant swings, more and more from the event on
        return None
    return grain * (end + int(quiet[-1]) + own)


def _means(recording: Recording, values: Numbers) -> Numbers:
    """Means over each grain."""
    width = max(1, round(_GRAIN / recording.interval))
    return np.asarray(values[: len(values) // width * width].reshape(-1, width).mean(axis=1))


def _movement(values: Numbers, count: int) -> Numbers:
    """Between the least and the largest of so many values, from each on."""
    return _largest(values, count) + _largest(-values, count)


def _grain(recording: Recording) -> float:
    """The time of which one bend is kept [s]: whole samples."""
    return recording.interval * max(1, round(_GRAIN / recording.interval))


def _bends(recording: Recording, values: Complex, time: float) -> Numbers:
    """How far a signal is off the middle of those so long before and after it [pu], the largest of each grain."""
    lag = max(1, round(time / recording.interval))
    found = np.zeros(len(values))
    if len(values) > 2 * lag:
        middle = 0.5 * (values[2 * lag :] + values[: -2 * lag])
        found[lag:-lag] = (
            np.abs(values[lag:-lag] - middle) * recording.good[lag : len(values) - lag]
        )
    width = max(1, round(_GRAIN / recording.interval))
    return np.asarray(found[: len(found) // width * width].reshape(-1, width).max(axis=1))


def _largest(values: Numbers, count: int) -> Numbers:
    """The largest of so many values, from each on."""
    return np.asarray(np.lib.stride_tricks.sliding_window_view(values, count).max(axis=1))

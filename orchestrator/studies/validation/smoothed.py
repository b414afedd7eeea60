"""An event that the recorder's filter has smoothed: its voltage grows out of the steady state and begins nowhere.

A switching, a fault or a jump of a load bends the voltage's course within a sample or two, and a swing bends it at once
as well. A filter, above all one without phase lag (filtfilt), lets the bend grow over many samples, from before the
event on. It takes the fast part of P and Q too, with what a model does wrong there."""

from __future__ import annotations

import math

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.record import Recording
from orchestrator.studies.validation.windows import Windows

_MEAN = 0.02  # time [s] of a mean, in which the scatter of dense samples counts less: a period
_NEAR = 0.5  # time [s] around the event's begin in which its bends are looked at
_LATER = 2.0  # time [s] after the begin, up to which a swing bends again
_GREATER = 2.5  # times the largest bend at the event, from which on a later one is another event's
_STANDS_OUT = 4.0  # times the bends before, from which on one is the event's
_LEAST = 1e-4  # bend [pu] that is an event's
_FEWEST = 8  # bends of which is told how they grow
_GROWS = 0.4
"""Sum of the squares by which the bend grows up to its largest, beside the square of that: 1 where it grows in one
step, 1/2 in two equal ones, 1/3 in three. Plants with a swing, a step or a ramp, sampled every 0.1 s or means of that,
have 0.5 and more."""
_FASTEST_HZ = 3.0  # of a filter that spreads a step over the 0.1 s of the shortest window, and more


def ask_of_smoothing(recording: Recording, windows: Windows) -> list[Question]:
    """Ask about an event whose voltage bends little by little, though the samples would show it begin."""
    if recording.instantaneous or not windows.seen:
        return []
    voltage, interval = _means(recording)
    bends = np.diff(voltage, 2)
    since = np.asarray(interval * np.arange(1, len(voltage) - 1) - windows.begin)
    near = bends[np.abs(since) < _NEAR]
    if len(near) < _FEWEST or not _is_event(bends, since):
        return []
    growth = np.abs(np.diff(near, prepend=0.0, append=0.0)) ** 2
    top = int(np.argmax(np.abs(near)))
    part = float(growth[: top + 1].sum()) / abs(near[top]) ** 2
    hertz = _frequency(float(growth.sum() / np.sum(np.abs(near) ** 2)), interval)
    if part > _GROWS or hertz > _FASTEST_HZ:
        return []
    figures = {"at": recording.begin + windows.begin, "hertz": hertz, "fastest": 0.5 / interval}
    return [Question(QuestionKind.SMOOTHED, figures)]


def _means(recording: Recording) -> tuple[Complex, float]:
    """The voltage's means over a period, or its samples where they are no denser, and their interval [s]."""
    width = max(1, round(_MEAN / recording.interval))
    count = len(recording.voltage) // width
    means = recording.voltage[: width * count].reshape(count, width).mean(axis=1)
    return np.asarray(means), width * recording.interval


def _is_event(bends: Complex, since: Numbers) -> bool:
    """Return whether bends stand out near an event's begin from those before it, and no greater ones follow."""
    sizes = np.abs(bends)
    most = float(sizes[np.abs(since) < _NEAR].max())
    before = float(sizes[since <= -_NEAR].max(initial=0.0))
    later = float(sizes[(since >= _NEAR) & (since < _LATER)].max(initial=0.0))
    return most > max(_LEAST, _STANDS_OUT * before) and later <= _GREATER * most


def _frequency(ratio: float, interval: float) -> float:
    """The frequency [Hz] at which the mean square of a signal's changes is so many times that of the signal."""
    return math.asin(min(1.0, math.sqrt(ratio) / 2)) / (math.pi * interval)

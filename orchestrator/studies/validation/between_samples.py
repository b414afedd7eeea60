"""The voltage between two samples: where it jumps, the moment is not known, and a device is run with two.

Of a fast recording the moment is known, and a device that runs in long steps sees the jump late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.core.errors import AnalysisError, ComponentError, InputError
from orchestrator.studies.validation.event import EventComparison, JumpDoubt
from orchestrator.studies.validation.figures import SIGNALS, signals_of
from orchestrator.studies.validation.hidden import jumps_of
from orchestrator.studies.validation.questions import Question, QuestionKind

_LONG = 0.005 * (1 - 1e-6)
"""Interval between samples [s], from which on the moment of a jump matters: times of a file make 4.9999999 ms of 5."""

_SHORT = 0.0005  # the same, from which on it matters to fluxes and filters: a fortieth of a period
_LONG_STEP = 2e-4  # communication step [s] above which a jump is seen late by what matters
# of another step its part of the device's own, how many times what changes with it is the doubt, and how that is named
_OTHER_STEPS = ((0.5, 2.0, JumpDoubt.STEP), (2.0, 1.0, JumpDoubt.FIXED_STEP))
_REFUSED = (ComponentError, AnalysisError, InputError)  # by a device that does not run so


def with_doubt_between(comparison: EventComparison) -> EventComparison:
    """The comparison with figures of noise that count what is not known between samples, or what the step leaves open.

    The device runs again with all jumps right after the sample before, and right before the sample after. Of a
    recording with short intervals that explains an error and makes none: at most the whole error is doubt. If the step
    is long, the device runs with half of it instead: its voltage is held, so that the error falls with the step, and
    is twice what half of it changes. A device that refuses half its step, as a DLL with a
    fixed one does, runs with twice the step, which changes as much as the step itself makes. If it does not run again
    at all, the doubt is not known, and a question says so."""
    event = comparison.event
    recording, device = event.recording, comparison.device
    jumps = [sample for sample, _ in jumps_of(event)]
    if not jumps:
        return comparison
    if recording.interval < _LONG and device.step_size > _LONG_STEP:
        return _with_doubt_of_step(comparison)
    if recording.interval >= _SHORT:
        moved = [replace(recording, jumps=dict.fromkeys(jumps, part)) for part in (0.0, 1.0)]
        try:
            powers = [device.play(one, event.start).power for one in moved]
        except _REFUSED as error:
            return _with_question(comparison, "time between two samples", error)
        known = recording.interval < _LONG
        return replace(_doubted(comparison, powers, bounded=known), doubt=JumpDoubt.SAMPLES)
    return comparison


def _with_doubt_of_step(comparison: EventComparison) -> EventComparison:
    """The comparison with what the communication step makes of a jump counted as noise, or a question in its place."""
    event, device = comparison.event, comparison.device
    refused: Exception | None = None
    for part, factor, doubt in _OTHER_STEPS:
        other = replace(device, step_size=part * device.step_size)
        try:
            power = other.play(event.recording, event.start).power
        except _REFUSED as error:
            refused = refused or error
        else:
            return replace(_doubted(comparison, [power], factor), doubt=doubt)
    step = f"step of {1000 * device.step_size:.4g} ms"
    return comparison if refused is None else _with_question(comparison, step, refused)


def _with_question(comparison: EventComparison, of: str, refused: Exception) -> EventComparison:
    """The comparison with a question: the device did not run again to show what that makes of its error."""
    question = Question(QuestionKind.DOUBT_UNKNOWN, {"of": of, "said": str(refused)})
    return replace(comparison, questions=(*comparison.questions, question))


def _doubted(
    comparison: EventComparison,
    others: Sequence[Complex],
    factor: float = 1.0,
    *,
    bounded: bool = False,
) -> EventComparison:
    """The comparison with what other responses differ from its own as a doubt, times a factor.

    ``bounded``: Whether the doubt of a sample is at most its error, so that it never makes a small error open."""
    event = comparison.event
    recording = event.recording
    doubt: Mapping[str, Numbers] = {name: np.zeros(len(recording.voltage)) for name in SIGNALS}
    for power in others:
        signals = signals_of(recording, power)
        doubt = {
            name: np.maximum(
                doubt[name], factor * np.abs(signals[name] - comparison.simulated[name])
            )
            for name in SIGNALS
        }
    if bounded:
        measured = comparison.measured
        doubt = {
            name: np.minimum(one, np.abs(comparison.simulated[name] - measured[name]))
            for name, one in doubt.items()
        }
    errors = {}
    for window, of in comparison.errors.items():
        inside = event.windows.part(window, recording.times) & recording.good
        errors[window] = {
            name: one.doubted(doubt[name][inside], of_mean=not bounded) for name, one in of.items()
        }
    return replace(comparison, errors=errors)

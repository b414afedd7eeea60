"""The voltage between two samples: where it jumps, the moment is not known, and a device is run with two.

Of a fast recording the moment is known, and a device that runs in long steps sees the jump late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.event import EventComparison, JumpDoubt
from orchestrator.studies.validation.figures import SIGNALS, signals_of
from orchestrator.studies.validation.hidden import jumps_of

_LONG = 0.005  # interval between samples [s], from which on the moment of a jump matters
_LONG_STEP = 2e-4  # communication step [s] above which a jump is seen late by what matters


def with_doubt_between(comparison: EventComparison) -> EventComparison:
    """The comparison with figures of noise that count what is not known between samples, or what the step leaves open.

    The device runs again with all jumps right after the sample before, and right before the sample after. Of a
    recording with short intervals it runs with half the step, if that is long: its voltage is held, so that the error
    falls with the step, and is twice what half of it changes."""
    event = comparison.event
    recording, device = event.recording, comparison.device
    jumps = [sample for sample, _ in jumps_of(event)]
    if not jumps:
        return comparison
    if recording.interval >= _LONG:
        moved = [replace(recording, jumps=dict.fromkeys(jumps, part)) for part in (0.0, 1.0)]
        powers = [device.play(one, event.start).power for one in moved]
        return replace(_doubted(comparison, powers), doubt=JumpDoubt.SAMPLES)
    if device.step_size > _LONG_STEP:
        finer = replace(device, step_size=0.5 * device.step_size)
        powers = [finer.play(recording, event.start).power]
        return replace(_doubted(comparison, powers, 2.0), doubt=JumpDoubt.STEP)
    return comparison


def _doubted(
    comparison: EventComparison, others: Sequence[Complex], factor: float = 1.0
) -> EventComparison:
    """The comparison with what other responses differ from its own as a doubt, times a factor."""
    event = comparison.event
    recording = event.recording
    doubt: Mapping[str, Numbers] = {name: np.zeros(len(recording.voltage)) for name in SIGNALS}
    for power in others:
        signals = signals_of(power, recording.voltage)
        doubt = {
            name: np.maximum(
                doubt[name], factor * np.abs(signals[name] - comparison.simulated[name])
            )
            for name in SIGNALS
        }
    errors = {}
    for window, of in comparison.errors.items():
        inside = event.windows.part(window, recording.times) & recording.good
        errors[window] = {name: one.doubted(doubt[name][inside]) for name, one in of.items()}
    return replace(comparison, errors=errors)

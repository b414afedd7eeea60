"""The voltage between two samples: where it jumps, the moment is not known, and a device is run with two."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.studies.validation.event import EventComparison
from orchestrator.studies.validation.figures import SIGNALS, signals_of
from orchestrator.studies.validation.hidden import jumps_of

_LONG = 0.005  # interval between samples [s], from which on the moment of a jump matters


def with_doubt_between(comparison: EventComparison) -> EventComparison:
    """The comparison with figures of noise that count what is not known between samples.

    The device runs again with all jumps right after the sample before, and right before the sample after."""
    event = comparison.event
    recording = event.recording
    jumps = [sample for sample, _ in jumps_of(event)]
    if recording.interval < _LONG or not jumps:
        return comparison
    doubt: Mapping[str, Numbers] = {name: np.zeros(len(recording.voltage)) for name in SIGNALS}
    for part in (0.0, 1.0):
        other = replace(recording, jumps=dict.fromkeys(jumps, part))
        power = comparison.device.play(other, event.start).power
        signals = signals_of(power, recording.voltage)
        doubt = {
            name: np.maximum(doubt[name], np.abs(signals[name] - comparison.simulated[name]))
            for name in SIGNALS
        }
    errors = {}
    for window, of in comparison.errors.items():
        inside = event.windows.part(window, recording.times) & recording.good
        errors[window] = {name: one.doubted(doubt[name][inside]) for name, one in of.items()}
    return replace(comparison, errors=errors)

"""Two models of one plant, such as its phasor and its EMT model, beside the same recordings and beside each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.core.arrays import Numbers, rms
from orchestrator.studies.validation.event import EventComparison
from orchestrator.studies.validation.filled import Mask

_SIGNALS = ("p", "q")
_FARTHER = 1.5  # times the larger error: two errors that have nothing to do with each other make the square root of 2


@dataclass(frozen=True)
class WindowApart:
    """Rms values of one signal in one window [pu of the rating]: each model from the recording, and both apart."""

    recording: str
    window: str
    signal: str
    first: float
    second: float
    apart: float
    largest: float  # of how far the models are apart

    @property
    def more_than_from_record(self) -> bool:
        """Return whether the models are farther from each other than each is from the recording."""
        return self.apart > _FARTHER * max(self.first, self.second)

    def as_json(self) -> dict[str, Any]:
        return {
            "recording": self.recording,
            "window": self.window,
            "signal": self.signal,
            "first_rms_pu": self.first,
            "second_rms_pu": self.second,
            "apart_rms_pu": self.apart,
            "apart_max_pu": self.largest,
            "more_than_from_record": self.more_than_from_record,
        }


def models_apart(first: EventComparison, second: EventComparison) -> list[WindowApart]:
    """Both models' distances of one event, by windows and signals."""
    recording, windows = first.event.recording, first.event.windows
    found = []
    for window in first.errors:
        inside = windows.part(window, recording.times) & recording.good
        for signal in _SIGNALS:
            one, other = (_inside(x.simulated, signal, inside) for x in (first, second))
            seen = _inside(first.measured, signal, inside)
            row = WindowApart(
                recording.label,
                window,
                signal,
                first=rms(one - seen),
                second=rms(other - seen),
                apart=rms(one - other),
                largest=float(np.abs(one - other).max()),
            )
            found.append(row)
    return found


def _inside(signals: Mapping[str, Numbers], name: str, part: Mask) -> Numbers:
    return np.asarray(signals[name][part])

"""How many phasors a second a recording has, and in which grids that is usual."""

from __future__ import annotations

from orchestrator.studies.validation.record import Recording

RATED_HZ = (50.0, 60.0)
"""Rated frequencies of grids [Hz]."""

_FRAMES = {50.0: (25, 50), 60.0: (15, 30, 60)}
"""Rated frequency [Hz] and phasors a second that a PMU sends in grids of this one alone: IEEE C37.118.1-2011."""

_NEAR = 0.02  # part by which a recording may miss such a number


def frames_of(recording: Recording) -> float:
    """Phasors a second; 0 of instantaneous values."""
    return 0.0 if recording.instantaneous else 1 / recording.interval


def grid_of_frames(recording: Recording) -> float | None:
    """The rated frequency [Hz] of grids in which alone so many phasors a second are usual; None where both may be."""
    frames = frames_of(recording)
    for hertz, usual in _FRAMES.items():
        if any(abs(frames / one - 1) < _NEAR for one in usual):
            return hertz
    return None

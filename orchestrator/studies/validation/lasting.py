"""Errors after an event that last and are no noise, though a planner's limits may allow them: something is off."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from orchestrator.studies.validation.event import EventComparison
from orchestrator.studies.validation.figures import ErrorFigures
from orchestrator.studies.validation.swing import swings_of

_TIMES_MEAN = 6.0
"""Times what noise makes of a mean, from which on it is none: right models reached 3.9, as a jump's ringing lasts.

Of 32 more two were beyond 6 and the least error, both after a deep dip: one by 1.4e-3 pu, and one that fell out of step
beside slow samples. Of 32 with one wrong value 26 were beyond one of both figures."""

_TIMES_USUAL = 2.0
"""Times what noise and the jump's doubt make of the mean magnitude; right models reached 1.21."""

_LEAST = 5e-4  # [pu]: less may be the gain error of instruments


@dataclass(frozen=True)
class LastingError:
    """An error of P or Q after an event, beyond what the recording leaves open [pu of the rating].

    ``part``: its rms value as part of the plant's swing; None where the event did not move the signal."""

    device: str
    recording: str
    signal: str
    mean: float
    usual: float
    part: float | None


def lasting_errors(comparisons: Sequence[EventComparison]) -> list[LastingError]:
    """The lasting errors of all events, the largest first."""
    found = [error for one in comparisons for error in _of_event(one)]
    return sorted(found, key=lambda one: -one.usual)


def _of_event(comparison: EventComparison) -> Iterator[LastingError]:
    swings = swings_of(comparison)
    after = comparison.errors.get("after", {})
    for signal in ("p", "q"):
        figures = after.get(signal)
        if figures is not None and _is_beyond(figures):
            yield LastingError(
                comparison.device.name,
                comparison.event.recording.label,
                signal,
                figures.mean_error,
                figures.mean_abs_error,
                swings[signal].rms_part,
            )


def _is_beyond(figures: ErrorFigures) -> bool:
    """Return whether the mean error, or the mean of its magnitude, is clearly more than the recording leaves open."""
    mean = abs(figures.mean_error) > max(_LEAST, _TIMES_MEAN * figures.mean_of_noise)
    usual = figures.mean_abs_error > max(_LEAST, _TIMES_USUAL * figures.mean_abs_of_noise)
    return mean or usual

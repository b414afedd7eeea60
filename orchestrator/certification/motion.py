"""Synchronism and rest in a response: a converter that slips or never stops swinging is not accepted."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.certification.point import FREQUENCY, POWER
from orchestrator.certification.swings import SLOWEST_PERIOD
from orchestrator.watch.finding import NOT_JUDGED, UNSTABLE

LARGEST_DEVIATION = 2.5
"""Largest accepted deviation of the frequency at bus 2 from its start [Hz]; the study moves it by about 0.1 Hz."""

LATE_SWING = 0.5
"""Largest accepted swing in the last third of the record, as a part of the swing in the first 10 s after the event.

A mode of 0.1 Hz with 5 % of damping, the slowest and least damped that the norm accepts, keeps 0.29 in 61 s.
"""


def motion_faults(
    times: Numbers, signals: Mapping[str, Numbers], event_time: float, findings: Sequence[Mapping[str, Any]] = ()
) -> Iterator[str]:
    yield from (str(finding["message"]) for finding in findings if finding["kind"] in UNSTABLE)
    frequency = signals.get(FREQUENCY)
    if frequency is not None and len(times) > 1:
        far = np.abs(frequency - frequency[0]) > LARGEST_DEVIATION
        if far.any():
            yield (
                f"{FREQUENCY} goes from {frequency.min():.4g} to {frequency.max():.4g} Hz, first more than "
                f"{LARGEST_DEVIATION:g} Hz from its start at t = {times[int(np.argmax(far))]:g} s: synchronism is lost"
            )
    for name in (POWER, FREQUENCY):
        if name in signals and len(times) > 1:
            yield from _late_swing(times, name, signals[name], event_time)


def not_judged(findings: Sequence[Mapping[str, Any]]) -> str:
    """What the watch could not judge of a run, in its words; empty where it judged all of it."""
    return "; ".join(str(finding["message"]) for finding in findings if finding["kind"] == NOT_JUDGED)


def _late_swing(times: Numbers, name: str, signal: Numbers, event_time: float) -> Iterator[str]:
    """The swing from peak to peak in the last third after the event, after removing a straight drift."""
    begin = float(times[-1]) - (float(times[-1]) - event_time) / 3
    first, last = (times >= event_time) & (times <= event_time + SLOWEST_PERIOD), times >= begin
    if last.sum() < 3 or not first.any() or not np.isfinite(signal).all():
        return
    drift = np.polyval(np.polyfit(times[last] - begin, signal[last], 1), times[last] - begin)
    late, early = float(np.ptp(signal[last] - drift)), float(np.ptp(signal[first]))
    if late > LATE_SWING * early:
        yield (
            f"{name} still swings by {late:.3g} from peak to peak from t = {begin:.3g} s to the end, and by "
            f"{early:.3g} in the first {SLOWEST_PERIOD:g} s after the event: more than {LATE_SWING:g} of it, so that "
            "it does not come to rest"
        )

"""A signal that still swings at the end of a stretch."""

from dataclasses import dataclass

from orchestrator.arrays import Numbers

KEPT = 0.7  # A swing is decaying if its last third is smaller than this part of its middle third


@dataclass(frozen=True)
class Swing:
    name: str
    size: float  # root mean square in the last third without the trend, relative to ``scale``
    scale: float  # 1 or the start's magnitude [the signal's unit]
    response: tuple[Numbers, Numbers]  # times [s] since the event, and the signal at them
    # times, signal: the same in the last three quarters
    times: Numbers
    signal: Numbers
    # half of the rate at which the signal turns [Hz], counted at every communication step; only for signals that were
    # followed between the looks
    turns_hz: float | None = None

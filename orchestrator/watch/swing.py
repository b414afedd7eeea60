"""A signal that still swings at the end of a stretch."""

from dataclasses import dataclass

from orchestrator.arrays import Numbers

KEPT = 0.7
"""A swing is decaying if its last third is smaller than this part of its middle third."""


@dataclass(frozen=True)
class Swing:
    """A signal that still swings at the end as it did before.

    Attributes
    ----------
    size
        Root mean square in the last third without the trend, relative to ``scale``.
    scale
        1 or the start's magnitude [the signal's unit].
    response
        Times [s] since the event, and the signal at them.
    times, signal
        The same in the last three quarters.
    turns_hz
        Half of the rate at which the signal turns [Hz], counted at every communication step; only for signals that were
        followed between the looks.
    """

    name: str
    size: float
    scale: float
    response: tuple[Numbers, Numbers]
    times: Numbers
    signal: Numbers
    turns_hz: float | None = None

"""What samples hold of a device: the frequencies up to half their rate, and the times that act no faster."""

from __future__ import annotations

import math


def fastest_hertz(interval: float) -> float:
    """The highest frequency [Hz] that samples so far apart [s] hold: half their rate (Shannon, Proc. IRE 37, 1949)."""
    return 0.5 / interval


def is_too_fast(time: float, interval: float) -> bool:
    """Return whether a time constant [s] acts beyond what samples so far apart [s] hold.

    That is where its corner, 1/(2πτ), is: a change that follows a time constant lies below it for the most part. A time
    of zero acts on nothing."""
    return time > 0 and 1 / (2 * math.pi * time) > fastest_hertz(interval)

"""Which times of a device samples tell: those no shorter than the interval between two of them."""

from __future__ import annotations

import math


def fastest_corner(interval: float) -> float:
    """The highest corner [Hz] of a control that samples so far apart [s] tell: of a time constant of one interval.

    Half the rate, up to which samples hold a frequency, is not enough: a control of 0.05 s, 3.2 Hz, was fitted as
    0.20 s to samples 0.1 s apart. Within one interval a shorter one has done the most of its way, unseen."""
    return 1 / (2 * math.pi * interval)


def is_too_fast(time: float, interval: float) -> bool:
    """Return whether a time constant [s] has its corner, 1/(2πτ), beyond the highest that samples so far apart tell.

    A time of zero acts on nothing."""
    return 0 < time < interval

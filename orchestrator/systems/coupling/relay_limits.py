"""Limits of relays, apart from what looks at buses: a case is read without libraries for numbers."""

from dataclasses import dataclass
from typing import Literal

Quantity = Literal["voltage", "frequency"]


@dataclass(frozen=True, slots=True)
class RelayLimits:
    """Limits of a voltage [pu] or a frequency [Hz], −∞ and ∞ where there is none, and times [s].

    ``delay``: time beyond a limit after which the relay trips; ``opening``: time of the breaker after that.
    ``window``: the last seconds of which all that was beyond counts together; 0 where coming back forgets it."""

    low: float
    high: float
    delay: float
    opening: float
    window: float = 0.0

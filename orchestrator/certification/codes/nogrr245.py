"""ERCOT's NOGRR245: voltage ride-through of inverter-based resources."""

from orchestrator.certification.codes.ride_through import step
from orchestrator.certification.codes.row import GridCode

ZERO = (0.0, 0.15)  # no voltage [pu], and its time [s]
LEVELS = (0.2, 0.45, 0.65, 0.85)  # voltages of the dips between 0 and 0.9 [pu]
SWELLS = ((1.15, 1.0), (1.175, 0.5), (1.2, 0.2))  # highest voltage of each band [pu], and its time [s]
RECOVERY = 1.0  # time after which the power is back [s]


def longest(level: float) -> float:
    """How long a voltage up to 0.9 pu has to be ridden through [s]."""
    return round((level + 0.084375) / 0.5625, 4)


NOGRR245 = GridCode.of(
    "nogrr245",
    tuple(
        step(level, lasts, "voltage ride-through", RECOVERY)
        for level, lasts in (ZERO, *((level, longest(level)) for level in LEVELS), *SWELLS)
    ),
)

"""Rows of ERCOT's NOGRR245: voltage ride-through."""

from orchestrator.studies.certification.codes.common_rows import RECOVERY, step_row
from orchestrator.studies.certification.codes.row import GridCode

NOGRR_ZERO = (0.0, 0.15)  # no voltage [pu], and its time [s]
NOGRR_LEVELS = (0.2, 0.45, 0.65, 0.85)  # voltages of the dips between 0 and 0.9 [pu]
# highest voltage of each band [pu], and its time [s]
NOGRR_SWELLS = ((1.15, 1.0), (1.175, 0.5), (1.2, 0.2))


def longest(level: float) -> float:
    """How long NOGRR245 asks for riding through a voltage up to 0.9 pu [s]."""
    return round((level + 0.084375) / 0.5625, 4)


NOGRR245 = GridCode.of(
    "nogrr245",
    tuple(
        step_row(level, lasts, "voltage ride-through", RECOVERY)
        for level, lasts in (
            NOGRR_ZERO,
            *((level, longest(level)) for level in NOGRR_LEVELS),
            *NOGRR_SWELLS,
        )
    ),
)

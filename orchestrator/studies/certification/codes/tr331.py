"""Energinet's rows: TR 3.3.1."""

from orchestrator.studies.certification.codes.common_rows import (
    SETTLED_AND_BACK,
    STRENGTH,
    jump_row,
    profile_row,
    ramp_row,
    step_row,
)
from orchestrator.studies.certification.codes.row import GridCode

# TR 3.3.1's profile of a dip
NONE = 0.15  # time at no voltage [s]
BACK = 1.5  # time of the profile's end [s]
PARTS = 9  # steps between them: the profile's slope as a staircase
AREAS = {"dk1": 0.85, "dk2": 0.9}  # voltage at that end, in the west and in the east [pu]


def _stairs(end: float) -> tuple[tuple[float, float], ...]:
    """TR 3.3.1's line as a staircase beneath it, so that no step is easier than the line."""
    stairs = ((NONE + k * (BACK - NONE) / PARTS, k * end / PARTS) for k in range(PARTS))
    return ((0.0, 0.0), *((round(time, 6), level) for time, level in stairs), (BACK, 1.0))


TR331 = GridCode.of(
    "tr331",
    (
        *(
            profile_row(
                f"dip_{area}",
                f"No voltage for {NONE:g} s, then up to {end:g} pu at {BACK:g} s, half power",
                f"fault ride-through, {area.upper()}",
                _stairs(end),
                None,
            )
            for area, end in AREAS.items()
        ),
        step_row(1.2, 5.0, "overvoltage", None),
        ramp_row(
            "rocof",
            "50 → 49 → 50 → 51 → 50 Hz at 2 Hz/s, half power",
            "rate of change of frequency",
            *SETTLED_AND_BACK,
            scr=STRENGTH,
            rate=2.0,
            steps=(-1.0, 1.0, 1.0, -1.0),
        ),
        jump_row("phase_jumps", "−20°, +20°, half power", "phase jump", STRENGTH, (-20.0, 20.0)),
    ),
)

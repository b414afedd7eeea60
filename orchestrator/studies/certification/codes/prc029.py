"""Rows of NERC's PRC-029-1: voltage and frequency ride-through of inverter-based resources."""

from orchestrator.studies.certification.codes.common_rows import (
    RECOVERY,
    SETTLED_AND_BACK,
    STRENGTH,
    jump_row,
    profile_row,
    ramp_row,
    step_row,
)
from orchestrator.studies.certification.codes.row import GridCode
from orchestrator.systems.coupling.no_trip_regions import PRC029_HIGH, PRC029_LOW

_WITHIN = 0.05  # distance of a voltage that is tried from the end of its band [pu]
PRC_DIPS = tuple((round(below - _WITHIN, 2), lasts) for below, lasts in PRC029_LOW)
"""Voltage [pu], each within its band (below 0.25, 0.50, 0.70, 0.90), and for how long it has to be ridden through [s];
resources other than wind."""

PRC_SWELL = (
    1.15,
    dict(PRC029_HIGH)[1.1],
)  # voltage within the band above 1.10 [pu], and its time [s]

PRC029 = GridCode.of(
    "prc029",
    (
        *(
            step_row(level, lasts, "R1, table 1", RECOVERY)
            for level, lasts in (*PRC_DIPS, PRC_SWELL)
        ),
        profile_row(
            "dips_in_10_s",
            "0.2 pu for 0.16 s twice in 10 s, half power",
            "R1, cumulative times",
            ((0.0, 0.2), (0.16, 1.0), (3.0, 0.2), (3.16, 1.0)),
            RECOVERY,
        ),
        ramp_row(
            "rocof",
            "60 → 58.9 → 60 → 61.1 → 60 Hz at 5 Hz/s, half power",
            "R3, rate of change of frequency",
            *SETTLED_AND_BACK,
            scr=STRENGTH,
            rate=5.0,
            steps=(-1.1, 1.1, 1.1, -1.1),
        ),
        jump_row(
            "phase_jumps", "−25°, +25°, half power", "R1, jumps up to 25°", STRENGTH, (-25.0, 25.0)
        ),
    ),
)

"""ERCOT's rows: advanced grid support of storage (AGS-ESR), model quality tests."""

from orchestrator.studies.certification.codes import criteria as c
from orchestrator.studies.certification.codes.common_rows import OPPOSED, jump_row, ramp_row
from orchestrator.studies.certification.codes.row import GridCode

LEAST_INERTIA = 2.5  # least inertia constant [s]: ERCOT, model quality tests, revision 24

ERCOT = GridCode.of(
    "ercot",
    (
        ramp_row(
            "inertia_down",
            "The frequency falls at 1 Hz/s for 0.5 s",
            "inertia",
            c.inertia(0, -1.0, 0.5, LEAST_INERTIA),
            c.settles(),
            scr=3.0,
            rate=1.0,
            steps=(-0.5,),
        ),
        ramp_row(
            "inertia_up",
            "The frequency rises at 1 Hz/s for 0.5 s",
            "inertia",
            c.inertia(0, 1.0, 0.5, LEAST_INERTIA),
            c.settles(),
            scr=3.0,
            rate=1.0,
            steps=(0.5,),
        ),
        jump_row(
            "phase_jumps", "−10°, +10° at SCR 3, 50 %", "phase jump", 3.0, (-10.0, 10.0), *OPPOSED
        ),
    ),
)

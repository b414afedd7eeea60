"""MISO's rows: BPM-015, appendix H, grid-forming storage."""

from orchestrator.studies.certification.codes import criteria as c
from orchestrator.studies.certification.codes.common_rows import (
    OPPOSED,
    droop_ramp_row,
    jump_row,
    last_machine_row,
    weakening_row,
)
from orchestrator.studies.certification.codes.row import GridCode

MISO = GridCode.of(
    "miso",
    (
        last_machine_row(
            "llsm_charging",
            "both plants charge at 50 %, load 50 %",
            "H, LLSM case 1",
            -0.5,
            -0.5,
            0.5,
        ),
        last_machine_row(
            "llsm_limit", "plant 0 %, duplicate 100 %, load 100 %", "H, LLSM case 2", 0.0, 1.0, 1.0
        ),
        last_machine_row(
            "llsm_balance", "both plants 50 %, load 75 %", "H, LLSM case 3", 0.5, 0.5, 0.75
        ),
        droop_ramp_row("60 → 61 → 60 → 59 → 60 Hz at 4 Hz/s, SCR 10, 50 %", "H, ROCOF"),
        jump_row(
            "phase_jumps",
            "−10°, +10°, −25°, +25° at SCR 3, 50 %",
            "H, phase jump",
            3.0,
            (-10.0, 10.0, -25.0, 25.0),
            *OPPOSED,
            c.responds_within(0, 1, 0.015),
            c.responds_within(1, -1, 0.015),
        ),
        weakening_row("H, SCR ramp down with fault"),
    ),
)

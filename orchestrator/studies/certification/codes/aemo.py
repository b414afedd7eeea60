"""AEMO's rows: the test framework for grid-forming inverters."""

from orchestrator.studies.certification.codes.common_rows import (
    OPPOSED_FOUR,
    droop_ramp_row,
    jump_row,
    weakening_row,
)
from orchestrator.studies.certification.codes.row import GridCode

AEMO = GridCode.of(
    "aemo",
    (
        droop_ramp_row("50 → 51 → 50 → 49 → 50 Hz at 4 Hz/s, SCR 10, 50 %", "test 5"),
        weakening_row("test 6"),
        *(
            jump_row(
                f"jump_{by:.0f}",
                f"±{by:g}° at SCR 3, 50 %",
                "test 7",
                3.0,
                (-by, by, by, -by),
                *OPPOSED_FOUR,
                shown_only=by == 60.0,
            )
            for by in (10.0, 30.0, 60.0)
        ),
    ),
)

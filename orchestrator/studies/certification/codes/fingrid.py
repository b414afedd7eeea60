"""Fingrid's rows: SJV2024, grid-forming storage."""

from orchestrator.studies.certification.codes import criteria as c
from orchestrator.studies.certification.codes.common_rows import OPPOSED_FOUR, jump_row, ramp_row
from orchestrator.studies.certification.codes.programme import voltage
from orchestrator.studies.certification.codes.row import CodeRow, GridCode

SJV_DIP = ((0.0, 0.0), (0.2, 0.85), (0.75, 0.90), (1.5, 1.0))
"""Fingrid: voltage over the time after the dip [s, pu], type D, as steps."""

FINGRID = GridCode.of(
    "fingrid",
    (
        CodeRow(
            "dip",
            "The source falls to 0 pu for 200 ms, 0.85 until 0.75 s, 0.90 until 1.5 s",
            "type D",
            lambda f: voltage(10.0, 0.5, SJV_DIP, 9.0),
            (
                c.holds_together(),
                c.returns("power after the dip", 3.0, 0.05, of_code=True, events=(-1,)),
            ),
        ),
        CodeRow(
            "overvoltage",
            "The source rises to 1.20 pu for 3.5 s",
            "overvoltage",
            lambda f: voltage(10.0, 0.5, ((0.0, 1.2), (3.5, 1.0)), 9.5),
            (c.holds_together(), c.returns(events=(-1,))),
        ),
        jump_row(
            "jumps",
            "±30° at SCR 10, 50 %",
            "phase jump",
            10.0,
            (-30.0, 30.0, 30.0, -30.0),
            *OPPOSED_FOUR,
        ),
        ramp_row(
            "rocof",
            "±2 Hz/s to 51 and 49 Hz, SCR 10, 50 %",
            "RoCoF",
            c.settles(),
            scr=10.0,
            rate=2.0,
            steps=(1.0, -1.0, -1.0, 1.0),
        ),
    ),
)

"""Fingrid: grid code specifications for storage, SJV2024."""

from orchestrator.certification.codes import criteria as c
from orchestrator.certification.codes.programme import jumps, ramps, voltage
from orchestrator.certification.codes.row import CodeRow, GridCode

DIP = ((0.0, 0.0), (0.2, 0.85), (0.75, 0.90), (1.5, 1.0))
"""Voltage over the time after the dip [s, pu], type D, as steps: 0 for 200 ms, 0.85 until 0.75 s, 0.90 until 1.5 s."""

FINGRID = GridCode.of(
    "fingrid",
    (
        CodeRow("dip", "The source falls to 0 pu for 200 ms, 0.85 until 0.75 s, 0.90 until 1.5 s", "type D",
                lambda f: voltage(10.0, 0.5, DIP, 9.0),
                (c.holds_together(), c.returns("power after the dip", 3.0, 0.05, of_code=True, events=(-1,)))),
        CodeRow("overvoltage", "The source rises to 1.20 pu for 3.5 s", "overvoltage",
                lambda f: voltage(10.0, 0.5, ((0.0, 1.2), (3.5, 1.0)), 9.5),
                (c.holds_together(), c.returns(events=(-1,)))),
        CodeRow("jumps", "±30° at SCR 10, 50 %", "phase jump", lambda f: jumps(10.0, 0.5, (-30.0, 30.0, 30.0, -30.0)),
                (c.holds_together(), *c.opposes_jumps((1, -1, -1, 1)), c.settles(), c.returns())),
        CodeRow("rocof", "±2 Hz/s to 51 and 49 Hz, SCR 10, 50 %", "RoCoF",
                lambda f: ramps(10.0, 0.5, f, 2.0, (1.0, -1.0, -1.0, 1.0)), (c.holds_together(), c.settles())),
    ),
)  # fmt: skip

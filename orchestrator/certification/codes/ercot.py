"""ERCOT: advanced grid support of energy storage (AGS-ESR)."""

from orchestrator.certification.codes import criteria as c
from orchestrator.certification.codes.programme import jumps, ramps
from orchestrator.certification.codes.row import CodeRow, GridCode

LEAST_INERTIA = 2.5  # least inertia constant [s]: ERCOT, model quality tests, revision 24


ERCOT = GridCode.of(
    "ercot",
    (
        CodeRow("inertia_down", "The frequency falls at 1 Hz/s for 0.5 s", "inertia",
                lambda f: ramps(3.0, 0.5, f, 1.0, (-0.5,)),
                (c.holds_together(), c.inertia(0, -1.0, 0.5, LEAST_INERTIA), c.settles())),
        CodeRow("inertia_up", "The frequency rises at 1 Hz/s for 0.5 s", "inertia",
                lambda f: ramps(3.0, 0.5, f, 1.0, (0.5,)),
                (c.holds_together(), c.inertia(0, 1.0, 0.5, LEAST_INERTIA), c.settles())),
        CodeRow("phase_jumps", "−10°, +10° at SCR 3, 50 %", "phase jump", lambda f: jumps(3.0, 0.5, (-10.0, 10.0)),
                (c.holds_together(), c.opposes_jump(0, 1, 0.2), c.opposes_jump(1, -1, 0.2), c.settles(), c.returns())),
    ),
)  # fmt: skip

"""NERC PRC-029-1: ride-through of inverter-based resources, in force since 1 October 2026."""

from functools import partial

from orchestrator.certification.codes import criteria as c
from orchestrator.certification.codes.programme import jumps, ramps
from orchestrator.certification.codes.ride_through import STRENGTH, profile, step
from orchestrator.certification.codes.row import CodeRow, GridCode

DIPS = ((0.2, 0.32), (0.45, 1.2), (0.65, 3.0), (0.85, 6.0))
"""Voltage [pu], each within its band (below 0.25, 0.50, 0.70, 0.90), and for how long it has to be ridden through [s];
resources other than wind."""

SWELL = (1.15, 1.0)  # voltage within the band above 1.10 [pu], and its time [s]
RECOVERY = 1.0  # time after which the power is back once the voltage is within 0.90 and 1.05 pu [s]

PRC029 = GridCode.of(
    "prc029",
    (
        *(step(level, lasts, "R1, table 1", RECOVERY) for level, lasts in (*DIPS, SWELL)),
        profile("dips_in_10_s", "0.2 pu for 0.16 s twice in 10 s, half power", "R1, cumulative times",
                ((0.0, 0.2), (0.16, 1.0), (3.0, 0.2), (3.16, 1.0)), RECOVERY),
        CodeRow("rocof", "60 → 58.9 → 60 → 61.1 → 60 Hz at 5 Hz/s, half power", "R3, rate of change of frequency",
                partial(ramps, STRENGTH, 0.5, rate=5.0, steps=(-1.1, 1.1, 1.1, -1.1)),
                (c.holds_together(), c.settles(), c.returns(events=(-1,)))),
        CodeRow("phase_jumps", "−25°, +25°, half power", "R1, jumps up to 25°",
                lambda f: jumps(STRENGTH, 0.5, (-25.0, 25.0)), (c.holds_together(), c.settles(), c.returns())),
    ),
)  # fmt: skip

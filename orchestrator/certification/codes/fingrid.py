"""Fingrid: grid code specifications for storage, SJV2024."""

from orchestrator.certification.codes import criteria as c
from orchestrator.certification.codes.programme import jumps, ramps, voltage
from orchestrator.certification.codes.row import CodeRow, GridCode

DIP = ((0.0, 0.0), (0.2, 0.85), (0.75, 0.90), (1.5, 1.0))
"""Voltage over the time after the dip [s, pu], type D, as steps: 0 for 200 ms, 0.85 until 0.75 s, 0.90 until 1.5 s."""

FINGRID = GridCode(
    key="fingrid",
    title="Fingrid SJV2024: grid-forming storage",
    source="Fingrid, SJV2024, by an excerpt of others; the specification itself was not at hand",
    date="2024",
    f_n=50.0,
    rows=(
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
    left_out=("the factor k of the reactive current, 2 to 6, with 90 % in 30 to 50 ms: where it is measured was not at "
              "hand",),
    readings=(
        "the voltage of the profile is that of the source behind SCR 10 and X/R 6; the excerpt gives no strength",
        "each jump is to be opposed by 0.2 pu, which others ask for 10°: the excerpt has no number. Only this row "
        "tells a grid-forming converter from a grid-following one; the others ask for riding through",
        "the 3 s until the power is back within 5 % of the rating count from the last step of the profile",
    ),
)  # fmt: skip

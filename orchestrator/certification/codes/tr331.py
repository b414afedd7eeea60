"""Energinet's TR 3.3.1: storage in Denmark."""

from functools import partial

from orchestrator.certification.codes import criteria as c
from orchestrator.certification.codes.programme import jumps, ramps
from orchestrator.certification.codes.ride_through import STRENGTH, profile, step
from orchestrator.certification.codes.row import CodeRow, GridCode

NONE = 0.15  # time at no voltage [s]
BACK = 1.5  # time of the profile's end [s]
AREAS = {"dk1": 0.85, "dk2": 0.9}  # voltage at the profile's end, in the west and in the east [pu]
PARTS = 9


def _profile(end: float) -> tuple[tuple[float, float], ...]:
    """The profile's line as a staircase beneath it, so that no step is easier than the line."""
    stairs = ((NONE + k * (BACK - NONE) / PARTS, k * end / PARTS) for k in range(PARTS))
    return ((0.0, 0.0), *((round(time, 6), level) for time, level in stairs), (BACK, 1.0))


TR331 = GridCode.of(
    "tr331",
    (
        *(
            profile(f"dip_{area}", f"No voltage for {NONE:g} s, then up to {end:g} pu at {BACK:g} s, half power",
                    f"fault ride-through, {area.upper()}", _profile(end), None)
            for area, end in AREAS.items()
        ),
        step(1.2, 5.0, "overvoltage", None),
        CodeRow("rocof", "50 → 49 → 50 → 51 → 50 Hz at 2 Hz/s, half power", "rate of change of frequency",
                partial(ramps, STRENGTH, 0.5, rate=2.0, steps=(-1.0, 1.0, 1.0, -1.0)),
                (c.holds_together(), c.settles(), c.returns(events=(-1,)))),
        CodeRow("phase_jumps", "−20°, +20°, half power", "phase jump",
                lambda f: jumps(STRENGTH, 0.5, (-20.0, 20.0)), (c.holds_together(), c.settles(), c.returns())),
    ),
)  # fmt: skip

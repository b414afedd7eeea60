"""AEMO: core requirements test framework of the voluntary specification for grid-forming inverters."""

from functools import partial

from orchestrator.certification.codes import criteria as c
from orchestrator.certification.codes.miso import ramp_criteria, weak_row
from orchestrator.certification.codes.programme import jumps, ramps
from orchestrator.certification.codes.row import CodeRow, GridCode


def _jump(degrees: float, *, shown_only: bool = False) -> CodeRow:
    return CodeRow(
        f"jump_{degrees:.0f}", f"±{degrees:g}° at SCR 3, 50 %", "test 7",
        lambda f: jumps(3.0, 0.5, (-degrees, degrees, degrees, -degrees)),
        (c.holds_together(), *c.opposes_jumps((1, -1, -1, 1)), c.settles(), c.returns()), shown_only,
    )  # fmt: skip


AEMO = GridCode.of(
    "aemo",
    (
        CodeRow("rocof", "50 → 51 → 50 → 49 → 50 Hz at 4 Hz/s, SCR 10, 50 %", "test 5",
                partial(ramps, 10.0, 0.5, rate=4.0, steps=(1.0, -1.0, -1.0, 1.0)), ramp_criteria(1, 5)),
        weak_row("test 6"),
        _jump(10.0),
        _jump(30.0),
        _jump(60.0, shown_only=True),
    ),
)  # fmt: skip

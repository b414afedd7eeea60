"""AEMO: core requirements test framework of the voluntary specification for grid-forming inverters."""

from functools import partial

from orchestrator.certification.codes import criteria as c
from orchestrator.certification.codes.miso import BALANCED, ramp_criteria, weak_row
from orchestrator.certification.codes.programme import jumps, ramps
from orchestrator.certification.codes.row import CodeRow, GridCode


def _jump(degrees: float, *, shown_only: bool = False) -> CodeRow:
    return CodeRow(
        f"jump_{degrees:.0f}", f"±{degrees:g}° at SCR 3, 50 %", "test 7",
        lambda f: jumps(3.0, 0.5, (-degrees, degrees, degrees, -degrees)),
        (c.holds_together(), *c.opposes_jumps((1, -1, -1, 1)), c.settles(), c.returns()), shown_only,
    )  # fmt: skip


AEMO = GridCode(
    key="aemo",
    title="AEMO: voluntary specification for grid-forming inverters, core requirements test framework",
    source="AEMO, Core Requirements Test Framework, sections 2 and 3",
    date="January 2024",
    f_n=50.0,
    rows=(
        CodeRow("rocof", "50 → 51 → 50 → 49 → 50 Hz at 4 Hz/s, SCR 10, 50 %", "test 5",
                partial(ramps, 10.0, 0.5, rate=4.0, steps=(1.0, -1.0, -1.0, 1.0)), ramp_criteria(1, 5)),
        weak_row("test 6"),
        _jump(10.0),
        _jump(30.0),
        _jump(60.0, shown_only=True),
    ),
    left_out=(
        "tests 1 to 4, loss of the last synchronous machine: their dispatch and load were not at hand in numbers; "
        "MISO's three cases use the same set-up",
        "two-phase-to-ground faults of test 6: they need the negative sequence, which the model does not have",
        "a verdict on ±60°: the framework judges large angles by the conditions of the connection point",
    ),
    readings=(
        BALANCED,
        "the ramps ask for a droop alone: a grid-following converter with P-f droop meets them, not the phase jumps",
        "the framework's numbers for a jump were not at hand; asked are synchronism, settling, the return, and a power "
        "that opposes each jump by the 0.2 pu that others ask for 10°: a grid-following converter meets all but that",
    ),
)  # fmt: skip

"""MISO: conformity of grid-forming storage, appendix H of its manual BPM-015."""

from functools import partial

from orchestrator.certification.codes import criteria as c
from orchestrator.certification.codes.programme import jumps, last_machine, ramps, weakening
from orchestrator.certification.codes.row import CodeRow, GridCode, Judge

RATIOS = (10.0, 3.0, 2.0, 1.5, 1.25)
"""Short-circuit ratios, down from 20: MISO BPM-015 r32 appendix H, AEMO's test framework of January 2024."""

FAULT = 4.0
"""Conductance of the balanced fault, in parts of the source's admittance: the voltage of the source alone falls to 0.23
pu, so that a plant that feeds into the fault does not lift it above half."""

CYCLES = 6  # duration of the fault, in periods
CLEARED = tuple(range(1, 2 * len(RATIOS), 2))
"""Numbers of the events with which the faults of the steps are cleared: the power is asked for after each of them."""

LIMITS = (c.stays_within(0.8, 1.1, 0.1), c.holds_together(), c.settles(), c.meets_load(), c.frequency_settles(),
          c.frequency_against_power())  # fmt: skip


def fault_time(rated: float) -> float:
    """Six periods [s], as a multiple of the communication step."""
    return round(CYCLES / rated, 4)


def weak_row(clause: str) -> CodeRow:
    """The row with steps of the short-circuit ratio, which two codes share."""
    return CodeRow(
        "scr_steps", "SCR 20 → 10, 3, 2, 1.5, 1.25, each as a balanced fault of six periods is cleared", clause,
        lambda f: weakening(20.0, 1.0, RATIOS, FAULT, fault_time(f)),
        (c.holds_together(), c.settles(), c.returns("does not trip or reduce its power", events=CLEARED)),
    )  # fmt: skip


def ramp_criteria(up: int, down: int) -> tuple[Judge, ...]:
    """What both codes ask after ramps of the frequency; events with which the holds above and below begin."""
    return (c.holds_together(), c.settles(), c.follows_droop(up, -1), c.follows_droop(down, 1))


MISO = GridCode.of(
    "miso",
    (
        CodeRow("llsm_charging", "Loss of the last machine: both plants charge at 50 %, load 50 %", "H, LLSM case 1",
                lambda f: last_machine(-0.5, -0.5, 0.5), LIMITS),
        CodeRow("llsm_limit", "Loss of the last machine: plant 0 %, duplicate 100 %, load 100 %", "H, LLSM case 2",
                lambda f: last_machine(0.0, 1.0, 1.0), LIMITS),
        CodeRow("llsm_balance", "Loss of the last machine: both plants 50 %, load 75 %", "H, LLSM case 3",
                lambda f: last_machine(0.5, 0.5, 0.75), LIMITS),
        CodeRow("rocof", "60 → 61 → 60 → 59 → 60 Hz at 4 Hz/s, SCR 10, 50 %", "H, ROCOF",
                partial(ramps, 10.0, 0.5, rate=4.0, steps=(1.0, -1.0, -1.0, 1.0)), ramp_criteria(1, 5)),
        CodeRow("phase_jumps", "−10°, +10°, −25°, +25° at SCR 3, 50 %", "H, phase jump",
                lambda f: jumps(3.0, 0.5, (-10.0, 10.0, -25.0, 25.0)),
                (c.holds_together(), c.opposes_jump(0, 1, 0.2), c.opposes_jump(1, -1, 0.2),
                 c.responds_within(0, 1, 0.015), c.responds_within(1, -1, 0.015), c.settles(), c.returns())),
        weak_row("H, SCR ramp down with fault"),
    ),
)  # fmt: skip

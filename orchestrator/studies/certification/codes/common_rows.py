"""Rows that several grid codes have: jumps, ramps, ride-through, a weakening network, the last machine."""

from orchestrator.studies.certification.codes import criteria as c
from orchestrator.studies.certification.codes.programme import (
    jumps,
    last_machine,
    ramps,
    voltage,
    weakening,
)
from orchestrator.studies.certification.codes.row import CodeRow, Judge

RATIOS = (10.0, 3.0, 2.0, 1.5, 1.25)
"""Short-circuit ratios, down from 20: MISO BPM-015 r32 appendix H, AEMO's test framework of January 2024."""

FAULT = 4.0
"""Conductance of the balanced fault, in parts of the source's admittance: the voltage of the source alone falls to 0.23
pu, so that a plant that feeds into the fault does not lift it above half."""

CYCLES = 6  # duration of the fault, in periods
CLEARED = tuple(range(1, 2 * len(RATIOS), 2))
"""Numbers of the events with which the faults of the steps are cleared: the power is asked for after each of them."""
# short-circuit ratio of the rows of codes that ask for riding through: they name no grid
STRENGTH = 10.0
AFTER = 5.0  # how long a ride-through is looked at after the last step [s]

# NOGRR245, PRC-029: time after which the power is back once the voltage is within 0.90 and 1.05 pu
# [s]
RECOVERY = 1.0

OPPOSED = c.opposes_jump(0, 1, 0.2), c.opposes_jump(1, -1, 0.2)
OPPOSED_FOUR = tuple(
    c.opposes_jump(k, sign, c.OPPOSED, of_code=False) for k, sign in enumerate((1, -1, -1, 1))
)
SETTLED_AND_BACK = c.settles(), c.returns(events=(-1,))


def jump_row(
    name: str,
    title: str,
    clause: str,
    scr: float,
    degrees: tuple[float, ...],
    *more: Judge,
    shown_only: bool = False,
) -> CodeRow:
    """Jumps of the source's angle, after which all codes ask for the same; ``more``: what one asks besides."""
    criteria = (c.holds_together(), *more, c.settles(), c.returns())
    return CodeRow(
        name, title, clause, lambda f: jumps(scr, 0.5, degrees), criteria, shown_only=shown_only
    )


def ramp_row(
    name: str,
    title: str,
    clause: str,
    *more: Judge,
    scr: float,
    rate: float,
    steps: tuple[float, ...],
) -> CodeRow:
    """Ramps of the source's frequency [Hz/s, Hz]; ``more``: what is asked beside staying in synchronism."""
    return CodeRow(
        name, title, clause, lambda f: ramps(scr, 0.5, f, rate, steps), (c.holds_together(), *more)
    )


def droop_ramp_row(title: str, clause: str) -> CodeRow:
    """A row of two codes; 1 and 5 are the events with which the holds above and below begin."""
    asked = (c.settles(), c.follows_droop(1, -1), c.follows_droop(5, 1))
    steps = (1.0, -1.0, -1.0, 1.0)
    return ramp_row("rocof", title, clause, *asked, scr=10.0, rate=4.0, steps=steps)


def weakening_row(clause: str) -> CodeRow:
    """A row of two codes: steps of the short-circuit ratio."""
    return CodeRow(
        "scr_steps",
        "SCR 20 → 10, 3, 2, 1.5, 1.25, each as a balanced fault of six periods is cleared",
        clause,
        lambda f: weakening(20.0, 1.0, RATIOS, FAULT, round(CYCLES / f, 4)),
        (
            c.holds_together(),
            c.settles(),
            c.returns("does not trip or reduce its power", events=CLEARED),
        ),
    )


def last_machine_row(
    name: str, title: str, clause: str, plant: float, duplicate: float, load: float
) -> CodeRow:
    asked = (
        c.stays_within(0.8, 1.1, 0.1),
        c.holds_together(),
        c.settles(),
        c.meets_load(),
        c.frequency_settles(),
        c.frequency_against_power(),
    )
    title = f"Loss of the last machine: {title}"
    return CodeRow(name, title, clause, lambda f: last_machine(plant, duplicate, load), asked)


def profile_row(
    name: str,
    title: str,
    clause: str,
    steps: tuple[tuple[float, float], ...],
    recovery: float | None,
) -> CodeRow:
    """A change of the voltage that has to be ridden through.

    ``steps``: time after the first event [s] and voltage of the source [pu] from then on.
    ``recovery``: time of the code after which the power is back [s]; None where it gives none."""
    stop = 1.0 + steps[-1][0] + AFTER
    back = c.returns(
        "power after the disturbance", recovery, of_code=recovery is not None, events=(-1,)
    )
    judges = (c.holds_together(), c.settles(events=(-1,)), back)
    return CodeRow(name, title, clause, lambda f: voltage(STRENGTH, 0.5, steps, stop), judges)


def step_row(level: float, lasts: float, clause: str, recovery: float | None) -> CodeRow:
    kind = "dip" if level < 1 else "swell"
    title = f"The source goes to {level:g} pu for {lasts:.4g} s, half power"
    name = f"{kind}_{100 * level:g}".replace(".", "_")
    return profile_row(name, title, clause, ((0.0, level), (lasts, 1.0)), recovery)

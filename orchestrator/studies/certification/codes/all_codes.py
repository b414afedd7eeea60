"""Our grid codes for `gfor certify --code`, each a table of rows; their words stand in ``codes.toml``.

MISO's appendix H, AEMO's test framework, ERCOT's AGS-ESR and NOGRR245, Fingrid's SJV2024, NERC's PRC-029-1 and
Energinet's TR 3.3.1; RTE's rows have a module of their own."""

from orchestrator.studies.certification.codes import criteria as c
from orchestrator.studies.certification.codes import rte
from orchestrator.studies.certification.codes.programme import (
    jumps,
    last_machine,
    ramps,
    voltage,
    weakening,
)
from orchestrator.studies.certification.codes.row import CodeRow, DeclaredCode, GridCode, Judge
from orchestrator.systems.coupling.no_trip_regions import PRC029_HIGH, PRC029_LOW

RATIOS = (10.0, 3.0, 2.0, 1.5, 1.25)
"""Short-circuit ratios, down from 20: MISO BPM-015 r32 appendix H, AEMO's test framework of January 2024."""

FAULT = 4.0
"""Conductance of the balanced fault, in parts of the source's admittance: the voltage of the source alone falls to 0.23
pu, so that a plant that feeds into the fault does not lift it above half."""

CYCLES = 6  # duration of the fault, in periods
CLEARED = tuple(range(1, 2 * len(RATIOS), 2))
"""Numbers of the events with which the faults of the steps are cleared: the power is asked for after each of them."""

LEAST_INERTIA = 2.5  # least inertia constant [s]: ERCOT, model quality tests, revision 24
# short-circuit ratio of the rows of codes that ask for riding through: they name no grid
STRENGTH = 10.0
AFTER = 5.0  # how long a ride-through is looked at after the last step [s]

SJV_DIP = ((0.0, 0.0), (0.2, 0.85), (0.75, 0.90), (1.5, 1.0))
"""Fingrid: voltage over the time after the dip [s, pu], type D, as steps."""

_WITHIN = 0.05  # distance of a voltage that is tried from the end of its band [pu]
PRC_DIPS = tuple((round(below - _WITHIN, 2), lasts) for below, lasts in PRC029_LOW)
"""Voltage [pu], each within its band (below 0.25, 0.50, 0.70, 0.90), and for how long it has to be ridden through [s];
resources other than wind."""

PRC_SWELL = (
    1.15,
    dict(PRC029_HIGH)[1.1],
)  # voltage within the band above 1.10 [pu], and its time [s]
NOGRR_ZERO = (0.0, 0.15)  # no voltage [pu], and its time [s]
NOGRR_LEVELS = (0.2, 0.45, 0.65, 0.85)  # voltages of the dips between 0 and 0.9 [pu]
# highest voltage of each band [pu], and its time [s]
NOGRR_SWELLS = ((1.15, 1.0), (1.175, 0.5), (1.2, 0.2))
# NOGRR245, PRC-029: time after which the power is back once the voltage is within 0.90 and 1.05 pu
# [s]
RECOVERY = 1.0

# TR 3.3.1's profile of a dip
NONE = 0.15  # time at no voltage [s]
BACK = 1.5  # time of the profile's end [s]
PARTS = 9  # steps between them: the profile's slope as a staircase
AREAS = {"dk1": 0.85, "dk2": 0.9}  # voltage at that end, in the west and in the east [pu]


def _jumps(
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


def _ramps(
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


def _droop_ramps(title: str, clause: str) -> CodeRow:
    """A row of two codes; 1 and 5 are the events with which the holds above and below begin."""
    asked = (c.settles(), c.follows_droop(1, -1), c.follows_droop(5, 1))
    steps = (1.0, -1.0, -1.0, 1.0)
    return _ramps("rocof", title, clause, *asked, scr=10.0, rate=4.0, steps=steps)


def _weakening(clause: str) -> CodeRow:
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


def _last_machine(
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


def _profile(
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


def _step(level: float, lasts: float, clause: str, recovery: float | None) -> CodeRow:
    kind = "dip" if level < 1 else "swell"
    title = f"The source goes to {level:g} pu for {lasts:.4g} s, half power"
    name = f"{kind}_{100 * level:g}".replace(".", "_")
    return _profile(name, title, clause, ((0.0, level), (lasts, 1.0)), recovery)


def longest(level: float) -> float:
    """How long NOGRR245 asks for riding through a voltage up to 0.9 pu [s]."""
    return round((level + 0.084375) / 0.5625, 4)


def _stairs(end: float) -> tuple[tuple[float, float], ...]:
    """TR 3.3.1's line as a staircase beneath it, so that no step is easier than the line."""
    stairs = ((NONE + k * (BACK - NONE) / PARTS, k * end / PARTS) for k in range(PARTS))
    return ((0.0, 0.0), *((round(time, 6), level) for time, level in stairs), (BACK, 1.0))


_OPPOSED = c.opposes_jump(0, 1, 0.2), c.opposes_jump(1, -1, 0.2)
_OPPOSED_FOUR = tuple(
    c.opposes_jump(k, sign, c.OPPOSED, of_code=False) for k, sign in enumerate((1, -1, -1, 1))
)
_BACK = c.settles(), c.returns(events=(-1,))

MISO = GridCode.of(
    "miso",
    (
        _last_machine(
            "llsm_charging",
            "both plants charge at 50 %, load 50 %",
            "H, LLSM case 1",
            -0.5,
            -0.5,
            0.5,
        ),
        _last_machine(
            "llsm_limit", "plant 0 %, duplicate 100 %, load 100 %", "H, LLSM case 2", 0.0, 1.0, 1.0
        ),
        _last_machine(
            "llsm_balance", "both plants 50 %, load 75 %", "H, LLSM case 3", 0.5, 0.5, 0.75
        ),
        _droop_ramps("60 → 61 → 60 → 59 → 60 Hz at 4 Hz/s, SCR 10, 50 %", "H, ROCOF"),
        _jumps(
            "phase_jumps",
            "−10°, +10°, −25°, +25° at SCR 3, 50 %",
            "H, phase jump",
            3.0,
            (-10.0, 10.0, -25.0, 25.0),
            *_OPPOSED,
            c.responds_within(0, 1, 0.015),
            c.responds_within(1, -1, 0.015),
        ),
        _weakening("H, SCR ramp down with fault"),
    ),
)

AEMO = GridCode.of(
    "aemo",
    (
        _droop_ramps("50 → 51 → 50 → 49 → 50 Hz at 4 Hz/s, SCR 10, 50 %", "test 5"),
        _weakening("test 6"),
        *(
            _jumps(
                f"jump_{by:.0f}",
                f"±{by:g}° at SCR 3, 50 %",
                "test 7",
                3.0,
                (-by, by, by, -by),
                *_OPPOSED_FOUR,
                shown_only=by == 60.0,
            )
            for by in (10.0, 30.0, 60.0)
        ),
    ),
)

ERCOT = GridCode.of(
    "ercot",
    (
        _ramps(
            "inertia_down",
            "The frequency falls at 1 Hz/s for 0.5 s",
            "inertia",
            c.inertia(0, -1.0, 0.5, LEAST_INERTIA),
            c.settles(),
            scr=3.0,
            rate=1.0,
            steps=(-0.5,),
        ),
        _ramps(
            "inertia_up",
            "The frequency rises at 1 Hz/s for 0.5 s",
            "inertia",
            c.inertia(0, 1.0, 0.5, LEAST_INERTIA),
            c.settles(),
            scr=3.0,
            rate=1.0,
            steps=(0.5,),
        ),
        _jumps(
            "phase_jumps", "−10°, +10° at SCR 3, 50 %", "phase jump", 3.0, (-10.0, 10.0), *_OPPOSED
        ),
    ),
)

NOGRR245 = GridCode.of(
    "nogrr245",
    tuple(
        _step(level, lasts, "voltage ride-through", RECOVERY)
        for level, lasts in (
            NOGRR_ZERO,
            *((level, longest(level)) for level in NOGRR_LEVELS),
            *NOGRR_SWELLS,
        )
    ),
)

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
        _jumps(
            "jumps",
            "±30° at SCR 10, 50 %",
            "phase jump",
            10.0,
            (-30.0, 30.0, 30.0, -30.0),
            *_OPPOSED_FOUR,
        ),
        _ramps(
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

PRC029 = GridCode.of(
    "prc029",
    (
        *(_step(level, lasts, "R1, table 1", RECOVERY) for level, lasts in (*PRC_DIPS, PRC_SWELL)),
        _profile(
            "dips_in_10_s",
            "0.2 pu for 0.16 s twice in 10 s, half power",
            "R1, cumulative times",
            ((0.0, 0.2), (0.16, 1.0), (3.0, 0.2), (3.16, 1.0)),
            RECOVERY,
        ),
        _ramps(
            "rocof",
            "60 → 58.9 → 60 → 61.1 → 60 Hz at 5 Hz/s, half power",
            "R3, rate of change of frequency",
            *_BACK,
            scr=STRENGTH,
            rate=5.0,
            steps=(-1.1, 1.1, 1.1, -1.1),
        ),
        _jumps(
            "phase_jumps", "−25°, +25°, half power", "R1, jumps up to 25°", STRENGTH, (-25.0, 25.0)
        ),
    ),
)

TR331 = GridCode.of(
    "tr331",
    (
        *(
            _profile(
                f"dip_{area}",
                f"No voltage for {NONE:g} s, then up to {end:g} pu at {BACK:g} s, half power",
                f"fault ride-through, {area.upper()}",
                _stairs(end),
                None,
            )
            for area, end in AREAS.items()
        ),
        _step(1.2, 5.0, "overvoltage", None),
        _ramps(
            "rocof",
            "50 → 49 → 50 → 51 → 50 Hz at 2 Hz/s, half power",
            "rate of change of frequency",
            *_BACK,
            scr=STRENGTH,
            rate=2.0,
            steps=(-1.0, 1.0, 1.0, -1.0),
        ),
        _jumps("phase_jumps", "−20°, +20°, half power", "phase jump", STRENGTH, (-20.0, 20.0)),
    ),
)

# by what ``--code`` takes
CODES = {code.key: code for code in (MISO, AEMO, ERCOT, NOGRR245, FINGRID, PRC029, TR331)}

ALL = CODES | {"rte": DeclaredCode("rte", rte.DECLARED, rte.rte_code)}
"""By name, as the entry-point group `gfor_cosim.codes` declares them."""

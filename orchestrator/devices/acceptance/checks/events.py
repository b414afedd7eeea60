"""Dips, overvoltages and phase jumps, drawn at random from the report's seed, as rows of inputs."""

from cmath import rect
from collections.abc import Sequence
from math import pi

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.devices.acceptance.checks.running import EQUAL, STEP_TAKES
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Subject

# duration of an episode [s]: time for a deep dip of 0.45 s; a slow FMU gets a shorter one
EPISODE = 1.2
_HOLD = 10  # steps for which a small step beside the events stays
_WIGGLE = 0.3  # height of a small step, in parts of the usual one
_SPENT = 1.0  # time that events may take [s of a usual FMU]
# relative difference of two runs with events that counts where they differ slightly without
_FAINT = 1e-3

RANGES = {
    "shallow": (0.76, 0.95),
    "middle": (0.56, 0.74),
    "low": (0.36, 0.54),
    "deep": (0.06, 0.34),
    "swell": (1.06, 1.28),
    "high": (1.13, 1.28),
}
"""Bounds of the voltage [pu] by kind."""

# bounds of a phase jump's size [°], of either sign, by kind
JUMPS = {"jump": (26.0, 70.0), "small jump": (10.0, 24.0)}
Segment = tuple[complex, float]  # A factor on the voltage, and for how long [s]


def factor(draw: np.random.Generator, kind: str) -> complex:
    if kind in RANGES:
        return complex(round(draw.uniform(*RANGES[kind]), 3))
    return rect(1.0, draw.choice((-1, 1)) * round(draw.uniform(*JUMPS[kind]), 1) * pi / 180)


def series(draw: np.random.Generator) -> list[Segment]:
    """More short dips, overvoltages and jumps than a counter may wait for, with a rest after each."""
    kinds = draw.permutation(["deep", "middle", "swell", "jump"] * 4)
    return [
        part
        for kind in kinds
        for part in ((factor(draw, kind), 0.06), (1 + 0j, round(draw.uniform(0.3, 0.6), 3)))
    ]


def in_words(voltage: complex) -> str:
    angle = np.angle(voltage, deg=True)
    if abs(angle) > 1e-6:
        return f"phase jump of {angle:.3g}°"
    return (
        f"dip to {voltage.real:.3g} pu"
        if voltage.real < 1
        else f"overvoltage of {voltage.real:.3g} pu"
    )


def scale(subject: Subject, seconds: float) -> float:
    """By what the durations of so many seconds of events are multiplied: below 1 where steps are short or it ends.

    An experiment that is declared to be shorter is no bound: limits and signs are looked at for longer as well."""
    steps = seconds / subject.step_size
    fit = max(200.0, _SPENT / STEP_TAKES)
    ends = [subject.memory.get(end, seconds) / seconds for end in ("ended_at", "stops_at")]
    return float(min(1.0, fit / steps, *(0.9 * end for end in ends if end < 1)))


def rows(
    subject: Subject,
    segments: Sequence[Segment],
    purpose: str,
    times: float = 1.0,
    point: OperatingAt | None = None,
) -> Numbers:
    """Deviations of the inputs, one row a step, with small random steps of every input beside the events.

    ``segments``: what the voltage is multiplied by, one after another.
    ``purpose``: for what; each purpose has other random steps.
    ``point``: where it starts; the subject's own point where None."""
    counts = [max(1, round(times * lasts / subject.step_size)) for _, lasts in segments]
    total, wide = sum(counts), len(subject.inputs)
    heights = (
        subject.random(purpose).uniform(-1, 1, (total // _HOLD + 1, wide))
        * _WIGGLE
        * subject.amplitudes
    )
    found: Numbers = np.repeat(heights, _HOLD, axis=0)[:total]
    change = np.repeat([(f - 1) * (point or subject.point).voltage for f, _ in segments], counts)
    found[:, subject.inputs.index("v_re")] += change.real
    found[:, subject.inputs.index("v_im")] += change.imag
    return found


def episode(subject: Subject, purpose: str, point: OperatingAt | None = None) -> Numbers:
    """Rows with a deep dip that lasts, and a shallower one, an overvoltage and a jump, in any order."""
    draw = subject.random(f"{purpose}, events")
    lasting = {"deep": 0.38, "middle": 0.12, "swell": 0.07, "jump": 0.12}
    segments: list[Segment] = []
    for kind in draw.permutation(list(lasting)):
        segments += [(1, 0.06 * EPISODE), (factor(draw, kind), lasting[kind] * EPISODE)]
    return rows(subject, [*segments, (1, 0.07 * EPISODE)], purpose, scale(subject, EPISODE), point)


def allowed(apart: float, exact: float = EQUAL) -> float:
    """Relative difference up to which two runs with events are equal, from that of two runs without."""
    return exact if apart == 0 else max(exact, _FAINT)

"""Traces of its own work in a damping controller: answers that grow, integral parts at its limit, a smaller gain."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.devices.acceptance.checks.damping_swings import (
    DampingBench,
    Effect,
    FrequencySwing,
)

_AFTER = 18.0  # time at rest after a swing in which it has to calm down [s]
_EARLY = (3.0, 8.0)  # part of that time in which its answer is compared [s] …
_LATE = (13.0, 18.0)  # … with that in this one
_GROWS = 1.05  # later answer in parts of the earlier one from which it grows
_SWINGS_ON = 0.97  # the same of what swings about its mean, which an honest one damps
_BEYOND = 1.2  # later answer in parts of that to the swing itself, which no calm one has
_UNREST = 0.05  # movement at rest, in parts of the answer to a swing, that is no rounding
_LEFT = 0.02  # part of its answer to the swing below which nothing is left to judge
_SHORT = 0.6  # duration of a deviation that holds it at its limit [s]
_LONG = 3.0  # of a longer one
_OVER = 3.0  # these deviations, in parts of the one whose swing gives the limit
_LEAST_OVER = 1.5  # the same below which the limit is not reached for sure
_WATCHED = 4.0  # time after them [s]
_AT_LIMIT = 0.5  # part of the limit down to which the output is still held
_LONGER = 2.0  # how many times longer it may be held after the long one
_MARGIN = 0.3  # and beside that [s]
_HELD = 1.0  # time [s] for which no filter holds it that damps swings of 0.7 to 1.3 Hz: the paper's hold it 0.73 s
_USE = 0.5  # what strong swings have it give and take before it is asked again [pu·s, S_n]
_MOST_SWINGS = 10  # of them


@dataclass(frozen=True)
class DampingFault:
    """A fault by its name, and the sentence that shows it."""

    name: str
    words: str


def find_growth(bench: DampingBench, usual: tuple[Effect, ...], size: float) -> DampingFault | None:
    """Move the frequency by `size` [pu] and watch at rest: an answer that grows is its own instability.

    A swing leaves little in a slow integral part, for its halves take from each other; a push leaves all."""
    rest = bench.time_left(bench.lasts + _AFTER) - bench.lasts
    if rest < _AFTER:
        return None
    for title, lasts, swing in (
        ("a swing", bench.lasts, FrequencySwing(size, then=rest)),
        ("a push", _SHORT, FrequencySwing(size, lasting=_SHORT, then=rest)),
    ):
        for effect, course in zip(usual, bench.courses(swing), strict=True):
            early, late = (
                bench.part(course, lasts + begin, lasts + end) for begin, end in (_EARLY, _LATE)
            )
            if not _calms_down(effect.peak, early, late):
                before, after = (float(np.abs(part).max()) for part in (early, late))
                says = f"{effect.title} gives {after:.3g} pu {_LATE[0]:g} to {_LATE[1]:g} s after {title}, and "
                says += f"{before:.3g} pu {_EARLY[0]:g} to {_EARLY[1]:g} s after it, at rest"
                return DampingFault("POD unstable", says)
    return None


def find_unrest(bench: DampingBench, usual: tuple[Effect, ...]) -> DampingFault | None:
    """Look at a run without a swing: noise moves an output there as it does in a swing."""
    for effect, course in zip(usual, bench.courses(FrequencySwing(0.0)), strict=True):
        moves = float(np.ptp(bench.part(course, 0.5 * bench.lasts, bench.lasts)))
        if moves > _UNREST * effect.peak:
            says = f"{effect.title} moves by {moves:.3g} pu at rest, and gives {effect.peak:.3g} pu in a swing"
            return DampingFault("POD moves at rest", says)
    return None


def _calms_down(peak: float, early: Numbers, late: Numbers) -> bool:
    sizes = [float(np.abs(part).max()) for part in (early, late)]
    swings = [float(np.ptp(part)) for part in (early, late)]
    if sizes[1] < _LEFT * peak:
        return True
    swings_on = swings[1] > _SWINGS_ON * swings[0] and swings[1] > _LEFT * peak
    return not (swings_on or sizes[1] > _GROWS * sizes[0] or sizes[1] > _BEYOND * peak)


def find_windup(bench: DampingBench, usual: tuple[Effect, ...], size: float) -> DampingFault | None:
    """Hold each output at its limit for a short and a long time: how long it stays there must not grow with that.

    ``size``: that of the swing [pu] whose effect is ``usual``."""
    for number, (name, effect) in enumerate(zip(bench.names, usual, strict=True)):
        limit = bench.declared_limit(name)
        if not limit:
            continue
        unit = size * limit / max(effect.peak, 1e-9)
        deviation = min(_OVER * unit, bench.widest)
        if deviation < _LEAST_OVER * unit:
            continue
        for way in (1, -1):
            short, long = (
                _time_at_limit(bench, number, way * deviation, seconds, limit)
                for seconds in (_SHORT, _LONG)
            )
            if long > _LONGER * short + _MARGIN or max(short, long) > _HELD:
                says = (
                    f"{effect.title} stays at half of its limit or beyond for {_time(long)} after "
                )
                says += (
                    f"{_LONG:g} s of a deviation that goes beyond it, and for {_time(short)} after "
                )
                says += f"{_SHORT:g} s"
                return DampingFault("POD winds up", says)
    return None


def _time(seconds: float) -> str:
    return f"{_WATCHED:g} s or more" if seconds > 0.99 * _WATCHED else f"{seconds:.2g} s"


def _time_at_limit(
    bench: DampingBench, number: int, deviation: float, seconds: float, limit: float
) -> float:
    """How long [s] an output stays on its side, at half of its limit or beyond, once the deviation is over."""
    course = bench.courses(FrequencySwing(deviation, lasting=seconds, then=_WATCHED))[number]
    before = bench.part(course, 0.8 * seconds, seconds)
    side = np.sign(before.mean())
    after = side * bench.part(course, seconds, seconds + _WATCHED)
    if side * before[-1] < _AT_LIMIT * limit:
        return 0.0
    gone = np.flatnonzero(after < _AT_LIMIT * limit)
    return _WATCHED * float(gone[0] / len(after) if len(gone) else 1.0)


def find_tiredness(
    bench: DampingBench, usual: tuple[Effect, ...], size: float, strong: float, least: float
) -> DampingFault | None:
    """Ask again after swings in which it has given and taken half a second of S_n.

    Parameters
    ----------
    size, strong
        Amplitudes of the usual swing and of those that make it work [pu].
    least
        Part of the answer from which the difference is a fault.
    """
    uses = list(_uses(bench, strong))
    number = min(_MOST_SWINGS, max(2, ceil(_USE / max(min(uses), 1e-9))))
    parts = bench.apart_after_work(size, strong, number)
    worst = int(np.argmax(parts))
    if parts[worst] < least:
        return None
    says = f"{usual[worst].title} answers by {100 * parts[worst]:.3g} % otherwise 3 s after strong swings"
    says += f", in which it gave and took {number * uses[worst]:.2g} pu·s"
    return DampingFault("POD tires", says)


def _uses(bench: DampingBench, strong: float) -> Iterator[float]:
    """Use that one strong swing makes of each [pu·s, S_n]: what it gives and takes."""
    for effect in bench.effects(FrequencySwing(strong)):
        yield float(np.abs(effect.course).mean()) * bench.lasts

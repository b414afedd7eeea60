"""P or Q that follows the model's like one behind a first-order lag: of the recorder, or of the plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache

import numpy as np
from scipy.linalg import solve_banded

from orchestrator.core.arrays import Complex, rms
from orchestrator.studies.validation.causes import CauseKind, Explanation
from orchestrator.studies.validation.event import EventComparison, rms_error
from orchestrator.studies.validation.questions import Question, QuestionKind

_LAGS = (0.005, 2.0)  # [s] of transducers and of filters
_COUNT = 25  # of lags that are tried, each a quarter longer than the one before
_FINER = 5  # of lags around the best of these
_LEAST = 5e-4  # rms error of a signal [pu] below which nothing is told from it
_BEYOND = 2.0  # times the scatter before the event, by which the error is larger
_EXPLAINS = 0.35  # part of the error that a lag may leave, to be named
_PART = 0.05  # part of a signal's movement by which it is off at least
_TO_NOISE = (
    1.5  # times the scatter before the event, which a lag leaves that explains all of an error
)
_LEAVES = {CauseKind.LAG: 0.1, CauseKind.CLOCK: 0.25}
"""Part of the error that it leaves then at most: a lag has a shape to choose, and a delay has none."""
_ALIKE = (
    0.1  # part by which the lags of several recordings differ at most, of one recorder or plant
)


def ask_of_lag(comparison: EventComparison) -> Iterator[tuple[float, Question]]:
    """The lag of P, of Q or of both that explains most of that signal's error, with the part that it leaves."""
    event, own = comparison.event, comparison.played.power
    off = {name for name in ("p", "q") if _is_off(comparison, name)}

    @cache
    def errors_behind(lag: float) -> tuple[float, float]:
        return rms_error(_behind(own, lag / event.recording.interval), event)

    for signals in (("p", "q"), ("p",), ("q",)):
        if off.issuperset(signals):
            found = [*_explained(comparison, signals, errors_behind)]
            yield from found
            if found:
                return


def lag_alone(comparisons: Sequence[EventComparison]) -> Explanation | None:
    """The lag or delay that explains every event to the recording's noise, as a cause; None if there is more, or none.

    A parameter acts in loops, and P or Q are not behind their own by it to the noise."""
    found = [
        one
        for comparison in comparisons
        for question in comparison.questions
        for one in _as_cause(comparison, question)
    ]
    if not found or len(found) < len(comparisons):
        return None
    first = max(found, key=lambda one: one.error)
    same = all(
        one.name == first.name and abs(one.value - first.value) <= _ALIKE * abs(first.value)
        for one in found
    )
    return first if same else None


def _as_cause(comparison: EventComparison, question: Question) -> Iterator[Explanation]:
    """The lag or delay that a question names, where it leaves noise alone, and no other signal is off."""
    match question.kind:
        case QuestionKind.LAGGED:
            kind, value = CauseKind.LAG, float(question.figures["lag"])
        case QuestionKind.CLOCKS:
            kind, value = CauseKind.CLOCK, float(question.figures["delay"])
        case _:
            return
    signals = list(question.figures["signals"])  # none where the voltage comes late
    counted = signals if kind is CauseKind.LAG else ["p", "q"]  # of which the figures are
    noise = math.hypot(*(comparison.noise[name].scatter for name in counted))
    error, left = float(question.figures["error"]), float(question.figures["left"])
    others = [name for name in ("p", "q") if name not in signals]
    explained = left <= min(_TO_NOISE * noise, _LEAVES[kind] * error)
    if signals and explained and not any(_is_off(comparison, name) for name in others):
        which = " and ".join(name.upper() for name in signals)
        yield Explanation(
            kind,
            f"{'lag' if kind is CauseKind.LAG else 'delay'} of {which}",
            "s",
            now=0.0,
            value=value,
            error=error,
            left=left,
            noise=noise,
        )


def _is_off(comparison: EventComparison, name: str) -> bool:
    event = comparison.event
    measured = comparison.measured[name]
    part = event.recording.good & (event.recording.times > event.windows.begin)
    error = rms((comparison.simulated[name] - measured)[part])
    moved = rms(
        measured[part] - measured[event.windows.part("before", event.recording.times)].mean()
    )
    least = max(_LEAST, _BEYOND * comparison.noise[name].scatter, _PART * moved)
    return error > least and comparison.beyond_doubt(name)


def _explained(
    comparison: EventComparison,
    signals: tuple[str, ...],
    errors_behind: Callable[[float], tuple[float, float]],
) -> Iterator[tuple[float, Question]]:
    """The lag of some signals that explains most of their error; ``errors_behind``: rms errors of P and Q by lag."""
    event, own = comparison.event, comparison.played.power
    interval = event.recording.interval

    def together(errors: tuple[float, float]) -> float:
        return math.hypot(*(one for name, one in zip("pq", errors, strict=True) if name in signals))

    def left_behind(lag: float) -> float:
        return together(errors_behind(lag))

    lags = np.geomspace(*_LAGS, _COUNT)
    best = float(min(lags, key=left_behind))
    step = float(lags[1] / lags[0])
    best = float(min(best * np.geomspace(1 / step, step, 2 * _FINER + 1), key=left_behind))
    error, left = together(rms_error(own, event)), left_behind(best)
    inside = _LAGS[0] < best < _LAGS[1] and best > 0.5 * interval
    if inside and left <= _EXPLAINS * error:
        figures = {"signals": list(signals), "lag": best, "error": error, "left": left}
        yield left / error, Question(QuestionKind.LAGGED, figures)


def _behind(power: Complex, samples: float) -> Complex:
    """A power behind a lag of so many samples, at rest at the begin.

    Each sample less a part of the one before is known: equations in two bands. Their solver is imported already, and
    `scipy.signal` would take half a second."""
    keeps = math.exp(-1 / samples)
    bands = np.ones((2, len(power)))
    bands[1] = -keeps
    moves = solve_banded((1, 0), bands, (1 - keeps) * (power - power[0]))
    return np.asarray(power[0] + moves)

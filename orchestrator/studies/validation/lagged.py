"""P or Q that follows the model's like one behind a first-order lag: of the recorder, or of the plant."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.linalg import solve_banded

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.studies.validation.event import EventComparison, rms_error
from orchestrator.studies.validation.questions import Question, QuestionKind

_LAGS = (0.005, 2.0)  # [s] of transducers and of filters
_COUNT = 25  # of lags that are tried, each a quarter longer than the one before
_FINER = 5  # of lags around the best of these
_LEAST = 5e-4  # rms error of a signal [pu] below which nothing is told from it
_BEYOND = 2.0  # times the scatter before the event, by which the error is larger
_EXPLAINS = 0.35  # part of the error that a lag may leave, to be named
_PART = 0.05  # part of a signal's movement by which it is off at least


def ask_of_lag(comparison: EventComparison) -> Iterator[tuple[float, Question]]:
    """The lag of P, of Q or of both that explains most of that signal's error, with the part that it leaves."""
    for signals in (("p", "q"), ("p",), ("q",)):
        if all(_is_off(comparison, one) for one in signals):
            found = [*_explained(comparison, signals)]
            yield from found
            if found:
                return


def _is_off(comparison: EventComparison, name: str) -> bool:
    event = comparison.event
    measured = comparison.measured[name]
    part = event.recording.good & (event.recording.times > event.windows.begin)
    error = _rms((comparison.simulated[name] - measured)[part])
    moved = _rms(
        measured[part] - measured[event.windows.part("before", event.recording.times)].mean()
    )
    least = max(_LEAST, _BEYOND * comparison.noise[name].scatter, _PART * moved)
    return error > least and comparison.beyond_doubt(name)


def _rms(values: Numbers) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _explained(
    comparison: EventComparison, signals: tuple[str, ...]
) -> Iterator[tuple[float, Question]]:
    event, own = comparison.event, comparison.played.power
    interval = event.recording.interval

    def left_of(power: Complex) -> float:
        p, q = rms_error(power, event)
        return math.hypot(*(one for name, one in (("p", p), ("q", q)) if name in signals))

    def left_behind(lag: float) -> float:
        return left_of(_behind(own, lag / interval))

    lags = np.geomspace(*_LAGS, _COUNT)
    best = float(min(lags, key=left_behind))
    step = float(lags[1] / lags[0])
    best = float(min(best * np.geomspace(1 / step, step, 2 * _FINER + 1), key=left_behind))
    error, left = left_of(own), left_behind(best)
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

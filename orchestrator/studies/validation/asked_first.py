"""Questions whose yes leaves much less of the errors than any cause in the model: they are told before the causes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from orchestrator.studies.validation.causes import EXPLAINS, Explanation, nothing_to_explain
from orchestrator.studies.validation.event import EventComparison, rms_error
from orchestrator.studies.validation.questions import Question


@dataclass(frozen=True)
class AskedFirst:
    """Questions, each with its recording's label, and what they leave together [pu of the rating].

    ``error``, ``left``: rms error of P and Q of all recordings, as they are read and if each answer is yes."""

    asked: Sequence[tuple[str, Question]]
    error: float
    left: float
    noise: float  # the recordings' own

    @property
    def explains(self) -> bool:
        """Return whether most of the squared error beyond the noise goes away with a yes."""
        beyond = self.error**2 - self.noise**2
        return self.left**2 - self.noise**2 <= (1 - EXPLAINS) * beyond

    def goes_before(self, causes: Sequence[Explanation]) -> bool:
        """Return whether a yes explains most of the error, and clearly more of it than the best cause does.

        Parts of the error are compared: causes may be tried in a part of a recording."""
        if nothing_to_explain(causes) or not self.explains:
            return False
        part = self.left / self.error
        return all(one.leaves_clearly_more(part * one.error) for one in causes)


def asked_before(
    comparisons: Sequence[EventComparison], causes: Sequence[Explanation]
) -> AskedFirst | None:
    """Find the questions that explain clearly more than the causes; None where there are none."""
    found = _of_all(comparisons)
    return found if found is not None and found.goes_before(causes) else None


def _of_all(comparisons: Sequence[EventComparison]) -> AskedFirst | None:
    """The question of each recording that explains the most of its error; None where none is asked so."""
    asked, errors, lefts, noises = [], [], [], []
    for one in comparisons:
        error = left = math.hypot(*rms_error(one.played.power, one.event))
        best = min(_explaining(one), key=_part_left, default=None)
        if best is not None:
            asked.append((one.event.recording.label, best))
            error, left = float(best.figures["error"]), float(best.figures["left"])
        errors.append(error)
        lefts.append(left)
        noises += [one.noise[signal].scatter for signal in ("p", "q")]
    if not asked:
        return None
    each = math.sqrt(len(comparisons))
    return AskedFirst(asked, *(math.hypot(*x) / each for x in (errors, lefts, noises)))


def _explaining(comparison: EventComparison) -> Iterator[Question]:
    """Questions that were asked because a yes takes a part of the error away."""
    for one in comparison.questions:
        if {"error", "left"} <= one.figures.keys() and one.figures["error"] > 0:
            yield one


def _part_left(question: Question) -> float:
    return float(question.figures["left"]) / float(question.figures["error"])

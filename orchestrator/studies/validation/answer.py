"""The first sentence of a validation, wherever it is shown: the verdict by limits, or the error alone."""

from __future__ import annotations

from orchestrator.output.report.verdict_sentence import VerdictSentence
from orchestrator.studies.validation.event import EventComparison
from orchestrator.studies.validation.lasting import lasting_errors
from orchestrator.studies.validation.limits import LimitVerdict
from orchestrator.studies.validation.study import ValidationResult
from orchestrator.studies.validation.words import (
    error_sentence,
    lasting_sentence,
    open_sentence,
    worst_of,
    yardstick_sentence,
)

_GOOD = {LimitVerdict.MET: True, LimitVerdict.NOT_MET: False, LimitVerdict.OPEN: None}


def of_both(result: ValidationResult) -> list[EventComparison]:
    """The comparisons of the model, and of the other one of the plant where there is one, recording by recording."""
    if not result.others:
        return list(result.comparisons)
    pairs = zip(result.comparisons, result.others, strict=True)
    return [one for pair in pairs for one in pair]


def worst_device(result: ValidationResult) -> str:
    return str(worst_of(of_both(result)).device.name)


def error_alone(result: ValidationResult) -> str:
    compared = of_both(result)
    says, beside = error_sentence(compared), yardstick_sentence(compared)
    return f"{worst_device(result)}: {says}. {beside} Without --limits there is no verdict."


def verdict_of(result: ValidationResult) -> VerdictSentence | None:
    """Return the verdict by limits; None without any."""
    if result.verdict is None:
        return None
    compared = of_both(result)
    says = error_sentence(compared)
    left = open_sentence(result.criteria, result.devices)
    says += f"; {left}" if left else ""
    if result.verdict is LimitVerdict.MET:
        lasting = lasting_sentence(lasting_errors(compared), explained=result.request.explain)
        says += f"; {lasting}" if lasting else ""
    return VerdictSentence(_GOOD[result.verdict], str(result.verdict).upper(), says)

"""What a check is, and what it answers."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from math import isfinite
from typing import TYPE_CHECKING, Any

from orchestrator.vendor.checks.faults import REMEDIES

if TYPE_CHECKING:
    from orchestrator.vendor.checks.subject import Subject


class Verdict(StrEnum):
    """The answer in one word."""

    PASS = "pass"
    REMARK = "remark"
    FAIL = "fail"
    NOT_APPLICABLE = "not applicable"


@dataclass(frozen=True)
class Result:
    """What one check found.

    Attributes
    ----------
    check
        The check's name.
    fault
        Name of what is wrong; empty unless the check failed.
    evidence
        What was seen, with figures; for `NOT_APPLICABLE` the reason.
    remedy
        What to do about it.
    figures
        The measured figures, for programs.
    """

    check: str
    verdict: Verdict
    evidence: str
    fault: str = ""
    remedy: str = ""
    figures: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it, which knows no numbers that are none."""
        return {**asdict(self), "figures": _plain(self.figures)}

    @classmethod
    def of_dict(cls, values: dict[str, Any]) -> "Result":
        return cls(**{**values, "verdict": Verdict(values["verdict"])})


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, bool | int | str) or value is None:
        return value
    return float(value) if isfinite(value) else str(value)


@dataclass(frozen=True)
class Check:
    """One question to an FMU.

    Attributes
    ----------
    question
        What it asks, for the report.
    needs
        Checks whose failure leaves this one without a meaning.
    """

    name: str
    question: str
    needs: tuple[str, ...]
    run: "Callable[[Subject], Result]"


CHECKS: dict[str, Check] = {}
"""All checks by name, in the order in which they run."""


SAME = ("independence", "repeatability")
"""What must hold for two runs to be compared."""


def check(
    name: str, question: str, needs: tuple[str, ...] = ()
) -> "Callable[[Callable[[Subject], Result]], Callable[[Subject], Result]]":
    """Enter a function into `CHECKS`."""

    def enter(function: "Callable[[Subject], Result]") -> "Callable[[Subject], Result]":
        CHECKS[name] = Check(name, question, needs, function)
        return function

    return enter


def passed(name: str, evidence: str, **figures: Any) -> Result:
    return Result(name, Verdict.PASS, evidence, figures=figures)


def remarked(name: str, evidence: str, remedy: str, **figures: Any) -> Result:
    return Result(name, Verdict.REMARK, evidence, remedy=remedy, figures=figures)


def failed(name: str, fault: str, evidence: str, **figures: Any) -> Result:
    return Result(name, Verdict.FAIL, evidence, fault, REMEDIES[fault], figures)


def not_applicable(name: str, because: str) -> Result:
    return Result(name, Verdict.NOT_APPLICABLE, because)

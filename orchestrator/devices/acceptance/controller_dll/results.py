"""Results of checks of a controller DLL, with the source of each rule."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from orchestrator.devices.acceptance.checks import base
from orchestrator.devices.acceptance.checks.base import CheckResult, Verdict, Whose
from orchestrator.devices.acceptance.controller_dll.questions import (
    DLL_QUESTIONS,
    REMEDIES,
    SOURCES,
)
from orchestrator.devices.acceptance.controller_dll.subject import DllSubject


@dataclass(frozen=True)
class DllCheck:
    name: str
    run: Callable[[DllSubject], CheckResult]


DLL_CHECKS: dict[str, DllCheck] = {}  # by name, in the order in which they run


def dll_check(
    name: str,
) -> Callable[[Callable[[DllSubject], CheckResult]], Callable[[DllSubject], CheckResult]]:
    def enter(function: Callable[[DllSubject], CheckResult]) -> Callable[[DllSubject], CheckResult]:
        assert name in DLL_QUESTIONS
        DLL_CHECKS[name] = DllCheck(name, function)
        return function

    return enter


def passed(name: str, evidence: str, **figures: Any) -> CheckResult:
    return base.passed(name, evidence, **_with_source(name, figures))


def remarked(name: str, evidence: str, remedy: str, **figures: Any) -> CheckResult:
    return base.remarked(name, evidence, remedy, **_with_source(name, figures))


def failed(name: str, fault: str, evidence: str, **figures: Any) -> CheckResult:
    """A fault, whose name is a key of `REMEDIES`."""
    found = _with_source(name, figures)
    return CheckResult(
        name,
        Verdict.FAIL,
        evidence,
        fault,
        REMEDIES[fault],
        figures=found,
        whose=Whose.DLL,
    )


def not_applicable(name: str, because: str) -> CheckResult:
    return CheckResult(name, Verdict.NOT_APPLICABLE, because, figures=_with_source(name, {}))


def _with_source(name: str, figures: dict[str, Any]) -> dict[str, Any]:
    return {**figures, "source": SOURCES[name]}

"""Checks, and their results."""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from math import isfinite
from pathlib import Path
from typing import Any

from orchestrator.core.errors import UnsupportedFmuError
from orchestrator.devices.acceptance.checks.subject import Subject
from orchestrator.devices.binding import misfits

_OWN: dict[str, str] = tomllib.loads(
    Path(__file__).with_name("remedies.toml").read_text(encoding="utf-8")
)

REMEDIES = _OWN | misfits.REMEDIES


class Verdict(StrEnum):
    PASS = "pass"
    REMARK = "remark"
    FAIL = "fail"
    NOT_APPLICABLE = "not applicable"
    NOT_SUPPORTED = "not supported"


class Whose(StrEnum):
    NOBODY = ""
    FMU = "the FMU"
    DLL = "the controller DLL"
    BINDING = "the binding"
    HERE = "not supported here"
    CALL = "provoked by a forbidden call"


@dataclass(frozen=True)
class CheckResult:
    check: str
    verdict: Verdict
    evidence: str  # what was seen, with figures; for `NOT_APPLICABLE` the reason
    fault: str = ""  # name of what is wrong, or not supported; else empty
    remedy: str = ""
    figures: dict[str, Any] = field(default_factory=dict)  # the measured figures, for programs
    # whether it is the FMU that is wrong, this program or machine that lacks something, or a call that FMI forbids and
    # only the check makes
    whose: Whose = Whose.NOBODY

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON; NaN and infinities become text."""
        return {**asdict(self), "figures": _plain(self.figures)}

    @classmethod
    def of_dict(cls, values: dict[str, Any]) -> "CheckResult":
        return cls(
            **{
                **values,
                "verdict": Verdict(values["verdict"]),
                "whose": Whose(values.get("whose", "")),
            }
        )


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
    name: str
    question: str
    needs: tuple[str, ...]
    run: Callable[[Subject], CheckResult]


CHECKS: dict[str, Check] = {}  # all checks by name, in the order in which they run


SAME = ("independence", "repeatability")  # what must hold for two runs to be compared


def check(
    name: str, question: str, needs: tuple[str, ...] = ()
) -> Callable[[Callable[[Subject], CheckResult]], Callable[[Subject], CheckResult]]:
    def enter(function: Callable[[Subject], CheckResult]) -> Callable[[Subject], CheckResult]:
        if name in CHECKS:
            raise ValueError(f"there is a check {name!r} already; give this one another name")
        CHECKS[name] = Check(name, question, needs, function)
        return function

    return enter


def add_remedies(remedies: Mapping[str, str]) -> None:
    """Enter the remedies of faults that another distribution's checks find, by the fault's name."""
    known = [fault for fault, remedy in remedies.items() if REMEDIES.get(fault, remedy) != remedy]
    if known:
        raise ValueError(f"the fault {known[0]!r} has a remedy already; give yours another name")
    REMEDIES.update(remedies)


def put_in_order(names: Sequence[str]) -> None:
    """Sort the checks that were entered until now; those that come later run after them."""
    entered = {name: CHECKS[name] for name in names}
    assert entered.keys() == CHECKS.keys()
    CHECKS.clear()
    CHECKS.update(entered)


def passed(name: str, evidence: str, **figures: Any) -> CheckResult:
    return CheckResult(name, Verdict.PASS, evidence, figures=figures)


def remarked(name: str, evidence: str, remedy: str, **figures: Any) -> CheckResult:
    """A check that found something to ask about, which is no fault."""
    return CheckResult(name, Verdict.REMARK, evidence, remedy=remedy, figures=figures)


def failed(name: str, fault: str, evidence: str, **figures: Any) -> CheckResult:
    """A check that found a fault of the FMU.

    ``fault``: A key of `REMEDIES`, which has the remedy for it.
    ``figures``: what was measured, for the report: plain values by name.

    Raises a `ValueError` if the fault has no remedy."""
    if fault not in REMEDIES:
        raise ValueError(f"the fault {fault!r} has no remedy; give it one with add_remedies")
    return CheckResult(
        name,
        Verdict.FAIL,
        evidence=evidence,
        fault=fault,
        remedy=REMEDIES[fault],
        figures=figures,
        whose=Whose.FMU,
    )


def not_applicable(name: str, because: str) -> CheckResult:
    return CheckResult(name, Verdict.NOT_APPLICABLE, because)


def not_supported(name: str, error: UnsupportedFmuError) -> CheckResult:
    """Return what this program or this machine cannot do, which says nothing about the FMU."""
    return CheckResult(
        name, Verdict.NOT_SUPPORTED, error.evidence, error.fault, error.remedy, whose=Whose.HERE
    )


def provoked(name: str, evidence: str) -> CheckResult:
    """Return what an FMU does after a call that FMI forbids."""
    remedy = "only this check makes such a call, and our master never does; an FMU should refuse it, tell the author"
    return CheckResult(
        name,
        Verdict.REMARK,
        f"a call that FMI forbids provoked it: {evidence}",
        "",
        remedy,
        whose=Whose.CALL,
    )

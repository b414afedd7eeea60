"""Checks with inputs that an FMU should never get."""

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import ComponentError, EndedError
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.comparing import difference
from orchestrator.devices.acceptance.checks.running import EQUAL, affordable
from orchestrator.devices.acceptance.checks.subject import Subject

_STEPS = 50
_HIDDEN = ("no error, and finite outputs", False)
_SILENT = "outputs that are no numbers, and no error"


_LOOKED_AT = 3  # steps before and after the change of an input
_SMALL_MOVE = 1e-2  # [units of the inputs] far above rounding, and within what any device takes


@check("nan_input", "Does it tell of inputs that are no numbers, and get over them?", needs=SAME)
def nan_input(subject: Subject) -> CheckResult:
    if not subject.inputs:
        return not_applicable("nan_input", "because there are no Real inputs")
    steps, h = affordable(subject, 200), subject.step_size
    clean = subject.trajectory(steps, h, subject.one_step())
    answers = {
        str(bad): _answer(subject, np.full(len(subject.inputs), bad)) for bad in (np.nan, np.inf)
    }
    after = subject.trajectory(steps, h, subject.one_step())
    apart, place = difference(clean, after)
    if apart > EQUAL:
        says = f"{subject.watched[place]} of a new instance differs by {apart:.3g} after another one was given NaN"
        return failed("nan_input", "not a number stays", says, difference=apart)
    seen = "; ".join(f"{bad}: {answer}" for bad, (answer, _) in answers.items())
    if answers[str(np.nan)] == _HIDDEN and not _follows(subject):
        return remarked(
            "nan_input",
            f"{seen}; no output follows its inputs within {_LOOKED_AT} steps, so it need not have read them",
            "ask for fmi2Error where an input is not finite",
        )
    if answers[str(np.nan)] == _HIDDEN:
        says = f"{seen}: what it puts in the place of an input that is no number is invented"
        return failed("nan_input", "not a number hidden", says)
    if not all(told for _, told in answers.values()):
        return remarked(
            "nan_input",
            seen,
            "a master learns of it late; ask for fmi2Error where an input is not finite",
        )
    return passed("nan_input", seen)


def _follows(subject: Subject) -> bool:
    """Return whether an output moves as soon with its inputs as it was looked at with what is no number.

    An input that a clock reads later, or whose function is off, is passed over by an honest FMU as well."""
    still, moved = (
        _after(subject, np.full(len(subject.inputs), size)) for size in (0.0, _SMALL_MOVE)
    )
    return bool(np.any(np.abs(moved - still) > EQUAL))


def _after(subject: Subject, deviation: Numbers) -> Numbers:
    """Outputs a few steps after its inputs have moved."""
    with subject.running() as running:
        running.record(_LOOKED_AT, subject.step_size, subject.one_step())
        running.feed(deviation)
        for _ in range(_LOOKED_AT):
            running.step(subject.step_size)
        return running.read()


def _answer(subject: Subject, deviation: Numbers) -> tuple[str, bool]:
    try:
        values = _after(subject, deviation)
    except ComponentError as error:
        return f"{error.call} says {error.status}", True
    except EndedError:
        return "it ends its simulation", True
    finite = np.isfinite(values).all()
    return _HIDDEN if finite else ("no error, and outputs that are no numbers", False)


@check("extreme_inputs", "Does it give numbers, or an error, where its inputs are extreme?")
def extreme_inputs(subject: Subject) -> CheckResult:
    """Inputs far out, each alone and all together; a NaN or infinite output needs an error from the call."""
    if not subject.inputs:
        return not_applicable("extreme_inputs", "because there are no Real inputs")
    wild, silent, texts = list[str](), list[str](), list[str]()
    for size in (3.0, 10.0, 100.0, 1e6):
        for name, deviation in _deviations(subject, size):
            answer = _hold_inputs(subject, deviation)
            if answer is None:
                (wild if size <= 100.0 else silent).append(f"{name} moved by {size:g}")
            elif answer:
                texts.append(answer)
    if wild:
        return failed("extreme_inputs", "not a number", f"{wild[0]}: {_SILENT}", cases=wild)
    if silent:
        remedy = "keep its inputs within reason; the master stops where a number is none"
        return remarked("extreme_inputs", f"{silent[0]}: {_SILENT}", remedy, cases=silent)
    said = f"; it says: {texts[0]}" if texts else ""
    return passed("extreme_inputs", f"finite or refused up to 1e6{said}")


def _deviations(subject: Subject, size: float) -> list[tuple[str, Numbers]]:
    """Each input alone and all together, up and down, within declared bounds."""
    low, high = np.full(len(subject.inputs), -np.inf), np.full(len(subject.inputs), np.inf)
    rest = subject.start_inputs(None)
    for j, name in enumerate(subject.inputs):
        info = subject.description.variables[name]
        low[j] = -np.inf if info.minimum is None else info.minimum - rest[j]
        high[j] = np.inf if info.maximum is None else info.maximum - rest[j]
    found = []
    for sign in (1.0, -1.0):
        found.append(("all inputs", np.full(len(rest), sign * size)))
        for j, name in enumerate(subject.inputs[:4]):
            deviation = np.zeros(len(rest))
            deviation[j] = sign * size
            found.append((name, deviation))
    return [(name, np.clip(deviation, low, high)) for name, deviation in found]


def _hold_inputs(subject: Subject, deviation: Numbers) -> str | None:
    """Hold inputs: "" where all stays finite, the FMU's words where it refuses, None where it gives no numbers."""
    try:
        with subject.running() as running:
            if not np.isfinite(running.hold(deviation[None], _STEPS, subject.step_size)).all():
                return None
    except (ComponentError, EndedError) as error:
        return f"{error.status}: {error.log}"[:120]
    return ""

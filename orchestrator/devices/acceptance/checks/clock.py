"""The check of an FMU's answers at another time of day and on another date."""

import sys

import numpy as np

from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
)
from orchestrator.devices.acceptance.checks.comparing import difference
from orchestrator.devices.acceptance.checks.damping_swings import controllers
from orchestrator.devices.acceptance.checks.running import EQUAL
from orchestrator.devices.acceptance.checks.subject import Subject
from orchestrator.devices.fmi.description import runs_under_wine
from orchestrator.devices.fmi.port_mapping import without_binding

_STEPS = 2000
_MINUTE = 60  # [s]
_HOUR = 3600  # [s]
_DAY = 86400  # [s]
_YEAR = 31_557_600  # [s]
_SHIFTS = (
    (_MINUTE, _MINUTE, "a minute"),
    (_HOUR, 23 * _HOUR, "some hours"),
    (_DAY, 7 * _DAY, "some days"),
    (30 * _DAY, 330 * _DAY, "some months"),
    (_YEAR, 3 * _YEAR, "some years"),
    (8 * _YEAR, 12 * _YEAR, "ten years"),
    (-6 * _YEAR, -_YEAR, "some years, the other way"),
)
"""By how much the clock is shifted [s], least and most, and in words: trials, licences and timers know such times."""


@check("clock", "Does it answer alike at another time of day and on another date?", needs=SAME)
def clock(subject: Subject) -> CheckResult:
    """Run it in processes whose clocks are shifted, with all of its damping controllers on."""
    if sys.platform != "linux" or runs_under_wine(without_binding(subject.description)):
        return not_applicable(
            "clock", "because the clock of its process can be shifted on Linux only"
        )
    draw = subject.random("clock")
    on = {f"{name}.enabled": True for name in controllers(subject)}
    stimulus, h = subject.steps(hold=10 * subject.step_size), subject.step_size
    usual = subject.trajectory(_STEPS, h, stimulus, parameters=on)
    for least, most, words in _SHIFTS:
        shift = int(draw.integers(least, most, endpoint=True))
        try:
            with subject.with_clock(shift):
                other = subject.trajectory(_STEPS, h, stimulus, parameters=on)
        except RuntimeError as error:
            return not_applicable("clock", f"because the clock cannot be shifted here: {error}")
        apart, place = difference(usual, other)
        if apart > EQUAL:
            row = int(np.argmax(np.abs(usual - other)[:, place] > 0))
            says = f"{subject.watched[place]} is {usual[row, place]:.6g} now and {other[row, place]:.6g} where the "
            says += (
                f"clock of its process is {words} ({shift:+d} s) later, from t = {row * h:.4g} s on"
            )
            return failed("clock", "follows the clock", says, shift=shift)
    return passed("clock", f"{len(_SHIFTS)} other dates and times of day change nothing")

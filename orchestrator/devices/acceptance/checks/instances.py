"""Checks that instances of one FMU leave each other alone, and give the same answer twice."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import ComponentError, EndedError
from orchestrator.devices.acceptance.checks.base import (
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
)
from orchestrator.devices.acceptance.checks.comparing import difference
from orchestrator.devices.acceptance.checks.events import allowed, episode
from orchestrator.devices.acceptance.checks.running import EQUAL, affordable
from orchestrator.devices.acceptance.checks.settings import (
    Setting,
    elsewhere,
    tune,
    with_each_setting,
)
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Stimulus, Subject
from orchestrator.devices.fmi.port_mapping import BoundDescription

OTHER_POINT = OperatingAt(v=1.03, theta=0.4, P=0.7, Q=-0.1)
"""Where the other instance lives: off the usual operating point, so that what it leaves behind shows."""

_IN_ORDER = 50  # steps of a run that is set in reversed order: start values and inputs tell at once
_CHUNK = 50  # steps that one instance does before the other one's turn comes
IN_EVENTS = ", in dips and jumps as well"
NOT_IN_EVENTS = "; not judged in dips and jumps, which it refuses"


def apart_in_events(
    subject: Subject, runs: Callable[[], tuple[Numbers, Numbers]], usual: float
) -> tuple[float, str]:
    """How far two runs with dips and jumps are apart, and the output that shows it.

    Where they are equal, 0 and what to add to the evidence; an FMU may refuse such inputs with an error."""
    try:
        with subject.while_doing("in dips and jumps"):
            apart, place = difference(*runs())
    except (ComponentError, EndedError):
        subject.doing = ""
        return 0.0, NOT_IN_EVENTS
    return (apart, subject.watched[place]) if apart > allowed(usual) else (0.0, IN_EVENTS)


@check("independence", "Do two instances leave each other alone?")
def independence(subject: Subject) -> CheckResult:
    """Leave an instance idle beside another one that runs; then run both, with different inputs."""
    if subject.description.one_instance:
        return not_applicable(
            "independence", "because the FMU declares canBeInstantiatedOnlyOncePerProcess"
        )
    return first_fault(subject, _independent)


def first_fault(subject: Subject, look: Callable[[Subject, Setting], CheckResult]) -> CheckResult:
    """The first fault that is found with some parameters set, or else the result with the parameters as they are.

    Raises a `ComponentError` with the parameters as they are; a setting with which the FMU does not work is passed
    over."""
    results = []
    for found, said in with_each_setting(subject, lambda setting: look(subject, setting)):
        if found.fault:
            return replace(found, evidence=f"{found.evidence}{said}")
        results.append(found)
    return results[0]


def _independent(subject: Subject, setting: Setting) -> CheckResult:
    moved = _idle(subject, setting)
    if moved is not None:
        says = f"{moved} of an instance that stands still moves while another one runs"
        return failed("independence", "shared between instances", says)
    steps, h = affordable(subject, 300), subject.step_size
    stimulus = subject.steps(hold=10 * h)
    alone, again = (subject.trajectory(steps, h, stimulus, parameters=setting) for _ in range(2))
    if difference(alone, again)[0] > EQUAL:
        return passed(
            "independence", "an instance that stands still does not move while another one runs"
        )
    apart, place = difference(alone, _beside(subject, steps, stimulus, setting))
    if apart > EQUAL:
        says = f"{subject.watched[place]} differs by {apart:.3g} of its range as soon as a second one runs beside it"
        return failed("independence", "shared between instances", says, difference=apart)
    says = f"a second instance beside it changes nothing ({apart:.1g})"
    if not subject.port:
        return passed("independence", says, difference=apart)
    rows = episode(subject, "independence")
    large, output = apart_in_events(subject, lambda: _among_others(subject, rows, setting), apart)
    if large:
        says = f"{output} differs by {large:.3g} of its range in dips and jumps as soon as a second one has some too"
        return failed("independence", "shared between instances", says, difference=large)
    return passed("independence", f"{says}{output}", difference=apart)


def _among_others(subject: Subject, rows: Numbers, setting: Setting) -> tuple[Numbers, Numbers]:
    """A run alone, and one in turns with an instance that has dips and jumps of its own; equal ones where two runs
    alone differ, which is for 'repeatability' to tell."""
    alone, again = (subject.through(rows, parameters=setting) for _ in range(2))
    if difference(alone, again)[0] > 0:
        return alone, alone
    h, others, parts = subject.step_size, episode(subject, "independence, other", OTHER_POINT), []
    with (
        subject.running("first", parameters=setting) as first,
        subject.running("second", point=OTHER_POINT, parameters=setting) as second,
    ):
        for begin in range(0, len(rows), _CHUNK):
            for running, some in ((second, others), (first, rows)):
                running.time = begin * h
                part = some[begin : begin + _CHUNK]
                values = running.hold(part, len(part), h)
            parts.append(values)
    return alone, np.concatenate(parts)


def _idle(subject: Subject, setting: Setting) -> str | None:
    """An output of a standing instance that moves while another one runs."""
    h, stimulus = subject.step_size, subject.steps(hold=7 * subject.step_size, seed=2)
    with subject.running("idle", parameters=setting) as idle:
        idle.record(3, h, stimulus)
        before = idle.read()
        with subject.running("busy", point=OTHER_POINT, parameters=setting) as busy:
            busy.record(20, h, lambda t: 3 * stimulus(t))
        after = idle.read()
    apart, place = difference(before[None], after[None])
    return subject.watched[place] if apart > EQUAL else None


def _beside(subject: Subject, steps: int, stimulus: Stimulus, setting: Setting) -> Numbers:
    """A run of one instance, while another one that started elsewhere is fed and stepped otherwise."""
    h, other = subject.step_size, subject.steps(hold=7 * subject.step_size, seed=2)
    with subject.running("first", parameters=setting) as first:
        rows = [first.read()]
        with subject.running("second", point=OTHER_POINT, parameters=setting) as second:
            tune(second, elsewhere(subject, switches=False))
            for k in range(steps):
                first.time = k * h
                first.feed(stimulus(k * h))
                second.feed(3 * other(k * h))
                first.step(h)
                for _ in range(1 + (k % 5 == 0)):
                    second.step(h)
                rows.append(first.read())
    return np.array(rows)


@check("repeatability", "Does it give the same answer twice?", needs=("independence",))
def repeatability(subject: Subject) -> CheckResult:
    steps = affordable(subject, 1000)
    stimulus = subject.steps(hold=20 * subject.step_size)
    first, second = (subject.trajectory(steps, subject.step_size, stimulus) for _ in range(2))
    apart, place = difference(first, second)
    if apart > EQUAL:
        says = f"{subject.watched[place]} differs by {apart:.3g} of its range between two equal runs of {steps} steps"
        return failed("repeatability", "not repeatable", says, difference=apart)
    says = f"two runs of {steps} steps differ by {apart:.1g}"
    if not isinstance(subject.description, BoundDescription):  # a binding has an order of its own
        few = min(steps, _IN_ORDER)
        other = subject.trajectory(few, subject.step_size, stimulus, backwards=True)
        moved, place = difference(first[: few + 1], other)
        if moved > EQUAL:
            wrong = (
                f"{subject.watched[place]} differs by {moved:.3g} of its range if start values and inputs are set "
                "in reversed order"
            )
            return failed("repeatability", "order of setting matters", wrong, difference=moved)
    if not subject.port:
        return passed("repeatability", says, difference=apart)
    rows = episode(subject, "repeatability")
    large, output = apart_in_events(
        subject, lambda: (subject.through(rows), subject.through(rows)), apart
    )
    if not large:
        return passed("repeatability", f"{says}{output}", difference=apart)
    says = (
        f"{output} differs by {large:.3g} of its range between two equal runs with dips and jumps"
    )
    if apart_in_events(subject, lambda: (_first(subject, rows), _first(subject, rows)), apart)[0]:
        return failed("repeatability", "not repeatable", says, difference=large)
    says += (
        ", and not between the first runs of two processes: the first one leaves something behind"
    )
    return failed("repeatability", "instances differ", says, difference=large)


def _first(subject: Subject, rows: Numbers) -> Numbers:
    subject.process().close()  # the next instance is the first of another process
    return subject.through(rows)

"""Whether instances of one FMU leave each other alone, and begin anew as new ones do."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from orchestrator.acceptance.checks.base import SAME, CheckResult, check, failed, not_applicable, passed
from orchestrator.acceptance.checks.comparing import difference
from orchestrator.acceptance.checks.running import EQUAL, affordable
from orchestrator.acceptance.checks.settings import Setting, elsewhere, tune, with_each_setting
from orchestrator.acceptance.checks.subject import OperatingAt, Running, Stimulus, Subject
from orchestrator.arrays import Numbers
from orchestrator.errors import ComponentError

_OTHER = OperatingAt(v=1.03, theta=0.4, P=0.7, Q=-0.1)


@check("independence", "Do two instances leave each other alone?")
def independence(subject: Subject) -> CheckResult:
    """Leave an instance idle beside another one that runs; then run both, with different inputs."""
    if subject.description.one_instance:
        return not_applicable("independence", "because the FMU declares canBeInstantiatedOnlyOncePerProcess")
    return _first_fault(subject, _independent)


def _first_fault(subject: Subject, look: Callable[[Subject, Setting], CheckResult]) -> CheckResult:
    """The first fault that is found with some parameters set, or else the result with the parameters as they are.

    Raises
    ------
    ComponentError
        With the parameters as they are; a setting with which the FMU does not work is passed over.
    """
    results = []
    for found, said in with_each_setting(subject, lambda setting: look(subject, setting)):
        if found.fault:
            return replace(found, evidence=f"{found.evidence}{said}")
        results.append(found)
    return results[0]


def _independent(subject: Subject, setting: Setting) -> CheckResult:
    """Look with some parameters set."""
    moved = _idle(subject, setting)
    if moved is not None:
        says = f"{moved} of an instance that stands still moves while another one runs"
        return failed("independence", "shared between instances", says)
    steps, h = affordable(subject, 300), subject.step_size
    stimulus = subject.steps(hold=10 * h)
    alone, again = (subject.trajectory(steps, h, stimulus, parameters=setting) for _ in range(2))
    if difference(alone, again)[0] > EQUAL:
        return passed("independence", "an instance that stands still does not move while another one runs")
    apart, place = difference(alone, _beside(subject, steps, stimulus, setting))
    if apart > EQUAL:
        says = f"{subject.watched[place]} differs by {apart:.3g} of its range as soon as a second one runs beside it"
        return failed("independence", "shared between instances", says, difference=apart)
    return passed("independence", f"a second instance beside it changes nothing ({apart:.1g})", difference=apart)


def _idle(subject: Subject, setting: Setting) -> str | None:
    """An output of a standing instance that moves while another one runs."""
    h, stimulus = subject.step_size, subject.steps(hold=7 * subject.step_size, seed=2)
    with subject.running("idle", parameters=setting) as idle:
        idle.record(3, h, stimulus)
        before = idle.read()
        with subject.running("busy", point=_OTHER, parameters=setting) as busy:
            busy.record(20, h, lambda t: 3 * stimulus(t))
        after = idle.read()
    apart, place = difference(before[None], after[None])
    return subject.watched[place] if apart > EQUAL else None


def _beside(subject: Subject, steps: int, stimulus: Stimulus, setting: Setting) -> Numbers:
    """A run of one instance, while another one that started elsewhere is fed and stepped otherwise."""
    h, other = subject.step_size, subject.steps(hold=7 * subject.step_size, seed=2)
    with subject.running("first", parameters=setting) as first:
        rows = [first.read()]
        with subject.running("second", point=_OTHER, parameters=setting) as second:
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


@check("reset", "Is it like new after fmi2Reset?", needs=SAME)
def reset(subject: Subject) -> CheckResult:
    """Also with its tunable Booleans the other way: in the life before, and in the one after."""
    try:
        return _first_fault(subject, _like_new)
    except ComponentError as error:
        return failed("reset", "reset fails", str(error))


def _like_new(subject: Subject, setting: Setting) -> CheckResult:
    """Compare a run after fmi2Reset with one of a new instance, with some parameters set."""
    steps, h = affordable(subject, 300), subject.step_size
    stimulus, moved = subject.steps(hold=10 * h), elsewhere(subject)
    with subject.running(parameters=setting) as new:
        begun = new.component.values(moved)
        fresh = new.record(steps, h, stimulus)
    with subject.running(point=_OTHER, parameters=setting) as running:
        _live(running, steps)
        tune(running, moved)
        running.point = None
        running.reset()
        after = running.component.values(moved)
        again = running.record(steps, h, stimulus)
    if left := [n for n in moved if after[n] != begun[n]]:
        says = f"{left[0]} is {after[left[0]]:g} after fmi2Reset, and {begun[left[0]]:g} in a new instance"
        return failed("reset", "reset leaves something", says)
    apart, place = difference(fresh, again)
    if apart > EQUAL:
        says = f"{subject.watched[place]} differs by {apart:.3g} of its range in a run after fmi2Reset"
        return failed("reset", "reset leaves something", says, difference=apart)
    return passed("reset", f"a run after fmi2Reset differs by {apart:.1g} from one of a new instance", difference=apart)


@check("reinstantiation", "Is a later instance like the first?", needs=SAME)
def reinstantiation(subject: Subject) -> CheckResult:
    """Compare a first instance with later ones: after another's life while the library stays loaded, and alone."""
    steps, h = affordable(subject, 300), subject.step_size
    stimulus, later = subject.steps(hold=10 * h), []
    try:
        with subject.running("first") as first:
            fresh = first.record(steps, h, stimulus)
            if not subject.description.one_instance:
                with subject.running("second", point=_OTHER) as second:
                    _live(second, steps)
                later.append(subject.trajectory(steps, h, stimulus))
        later.append(subject.trajectory(steps, h, stimulus))
    except ComponentError as error:
        return failed("reinstantiation", "no second instance", str(error))
    apart, place = max(difference(fresh, again) for again in later)
    if apart > EQUAL:
        says = f"{subject.watched[place]} differs by {apart:.3g} of its range in a later instance"
        return failed("reinstantiation", "instances differ", says, difference=apart)
    return passed("reinstantiation", f"a run of a later instance differs by {apart:.1g}", difference=apart)


def _live(running: Running, steps: int) -> None:
    """Give an instance a life elsewhere."""
    elsewhere = running.subject.steps(hold=7 * running.subject.step_size, seed=3)
    running.record(steps, running.subject.step_size, lambda t: 2 * elsewhere(t))

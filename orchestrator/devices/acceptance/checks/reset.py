"""Checks that an earlier life leaves nothing behind: after fmi2Reset, and in an instance that is made later."""

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    passed,
)
from orchestrator.devices.acceptance.checks.comparing import difference
from orchestrator.devices.acceptance.checks.events import episode
from orchestrator.devices.acceptance.checks.instances import (
    OTHER_POINT,
    apart_in_events,
    first_fault,
)
from orchestrator.devices.acceptance.checks.running import EQUAL, affordable
from orchestrator.devices.acceptance.checks.settings import Setting, elsewhere, tune
from orchestrator.devices.acceptance.checks.subject import Running, Subject


@check("reset", "Is it like new after fmi2Reset?", needs=SAME)
def reset(subject: Subject) -> CheckResult:
    """Also with its tunable Booleans the other way: in the life before, and in the one after."""
    try:
        return first_fault(subject, _like_new)
    except ComponentError as error:
        return failed("reset", "reset fails", str(error))


def _like_new(subject: Subject, setting: Setting) -> CheckResult:
    """Compare a run after fmi2Reset with one of a new instance, with some parameters set."""
    steps, h = affordable(subject, 300), subject.step_size
    stimulus, moved = subject.steps(hold=10 * h), elsewhere(subject)
    with subject.running(parameters=setting) as new:
        begun = new.component.values(moved)
        fresh = new.record(steps, h, stimulus)
    with subject.running(point=OTHER_POINT, parameters=setting) as running:
        _live(running, steps)
        tune(running, moved)
        running.point = None
        running.reset()
        after = running.component.values(moved)
        again = running.record(steps, h, stimulus)
    left = [n for n in moved if after[n] != begun[n]]
    if left:
        says = f"{left[0]} is {after[left[0]]:g} after fmi2Reset, and {begun[left[0]]:g} in a new instance"
        return failed("reset", "reset leaves something", says)
    apart, place = difference(fresh, again)
    if apart > EQUAL:
        says = (
            f"{subject.watched[place]} differs by {apart:.3g} of its range in a run after fmi2Reset"
        )
        return failed("reset", "reset leaves something", says, difference=apart)
    says = f"a run after fmi2Reset differs by {apart:.1g} from one of a new instance"
    if not subject.port:
        return passed("reset", says, difference=apart)
    large, output = apart_in_events(subject, lambda: _after_reset(subject, setting), apart)
    if large:
        says = f"{output} differs by {large:.3g} of its range in dips and jumps after others and fmi2Reset"
        return failed("reset", "reset leaves something", says, difference=large)
    return passed("reset", f"{says}{output}", difference=apart)


def _after_reset(subject: Subject, setting: Setting) -> tuple[Numbers, Numbers]:
    """A run of a new instance, and one after a life with dips and jumps and fmi2Reset."""
    rows, life = episode(subject, "reset"), episode(subject, "reset, life", OTHER_POINT)
    fresh = subject.through(rows, parameters=setting)
    with subject.running(point=OTHER_POINT, parameters=setting) as running:
        running.hold(life, len(life), subject.step_size)
        running.point = None
        running.reset()
        return fresh, running.hold(rows, len(rows), subject.step_size)


@check("reinstantiation", "Is a later instance like the first?", needs=SAME)
def reinstantiation(subject: Subject) -> CheckResult:
    """Compare a first instance with later ones: after another's life while the library stays loaded, and alone."""
    steps, h = affordable(subject, 300), subject.step_size
    stimulus, later = subject.steps(hold=10 * h), []
    try:
        with subject.running("first") as first:
            fresh = first.record(steps, h, stimulus)
            if not subject.description.one_instance:
                with subject.running("second", point=OTHER_POINT) as second:
                    _live(second, steps)
                later.append(subject.trajectory(steps, h, stimulus))
        later.append(subject.trajectory(steps, h, stimulus))
    except ComponentError as error:
        return failed("reinstantiation", "no second instance", str(error))
    apart, place = max(difference(fresh, again) for again in later)
    if apart > EQUAL:
        says = f"{subject.watched[place]} differs by {apart:.3g} of its range in a later instance"
        return failed("reinstantiation", "instances differ", says, difference=apart)
    says = f"a run of a later instance differs by {apart:.1g}"
    if not subject.port:
        return passed("reinstantiation", says, difference=apart)
    large, output = apart_in_events(subject, lambda: _after_a_life(subject), apart)
    if large:
        says = f"{output} differs by {large:.3g} of its range in dips and jumps, in an instance after one that had some"
        return failed("reinstantiation", "instances differ", says, difference=large)
    return passed("reinstantiation", f"{says}{output}", difference=apart)


def _after_a_life(subject: Subject) -> tuple[Numbers, Numbers]:
    """A run, and the same one after another instance's dips and jumps; that one still lives where there may be two."""
    rows, life = (
        episode(subject, "reinstantiation"),
        episode(subject, "reinstantiation, life", OTHER_POINT),
    )
    fresh = subject.through(rows)
    with subject.running("second", point=OTHER_POINT) as second:
        second.hold(life, len(life), subject.step_size)
        if not subject.description.one_instance:
            return fresh, subject.through(rows)
    return fresh, subject.through(rows)


def _live(running: Running, steps: int) -> None:
    """Give an instance a life elsewhere."""
    elsewhere = running.subject.steps(hold=7 * running.subject.step_size, seed=3)
    running.record(steps, running.subject.step_size, lambda t: 2 * elsewhere(t))

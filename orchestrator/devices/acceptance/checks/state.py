"""Checks that a saved state is all of the state."""

from contextlib import ExitStack
from time import perf_counter

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
from orchestrator.devices.acceptance.checks.events import Segment, factor, rows, scale
from orchestrator.devices.acceptance.checks.instances import IN_EVENTS, NOT_IN_EVENTS
from orchestrator.devices.acceptance.checks.running import affordable
from orchestrator.devices.acceptance.checks.settings import (
    Setting,
    elsewhere,
    tune,
    with_each_setting,
)
from orchestrator.devices.acceptance.checks.subject import Running, Stimulus, Subject, saved
from orchestrator.devices.fmi.component import RealBatch

# relative difference above which something was not restored; an integrator may begin anew below it
_CLEAR = 1e-6

_EXACT = 1e-12
# the same with dips and jumps, which amplify what an integrator leaves that begins anew
_RESTARTED = 1e-2
_STEPS = 600
_READ = 1e-9  # relative difference of a state or parameter that is read just after it was restored


@check("state", "Does a saved state bring back everything?", needs=(*SAME, "reading"))
def state(subject: Subject) -> CheckResult:
    """Run, save, run on; restore, and run the same again: what was not saved goes on from where it was."""
    if not subject.description.can_save_state:
        return not_applicable("state", "because the FMU does not declare canGetAndSetFMUstate")

    def look(setting: Setting) -> tuple[str, float, int]:
        try:
            return _brought_back(subject, setting, elsewhere(subject))
        except ComponentError:
            if setting:
                raise
            return _brought_back(subject, setting, elsewhere(subject, switches=False))

    seen: tuple[float, int, str] = (0.0, 0, "")
    for (wrong, worst, place), said in with_each_setting(subject, look):
        if wrong:
            return failed("state", "hidden state", f"{wrong}{said}")
        seen = max(seen, (worst, place, said), key=lambda one: one[0])
    worst, place, where = seen
    steps = affordable(subject, _STEPS)
    if worst > _CLEAR:
        says = f"{subject.watched[place]} differs by {worst:.3g} of its range after fmi2SetFMUstate and {steps} "
        return failed(
            "state", "hidden state", f"{says}equal steps{where}{_which(subject)}", difference=worst
        )
    least = _CLEAR if worst <= _EXACT else _RESTARTED
    in_events = ""
    if subject.port:
        for (apart, text), said in with_each_setting(
            subject, lambda setting: _in_events(subject, setting)
        ):
            if apart > least:
                return failed("state", "hidden state", f"{text}{said}", difference=apart)
            in_events = in_events or (text if apart == 0 else IN_EVENTS)
    if worst > _EXACT:
        says = f"{subject.watched[place]} differs by {worst:.3g} of its range after fmi2SetFMUstate"
        remedy = "an integrator that begins anew does that; perturbations should be much larger"
        return remarked("state", says, remedy, difference=worst)
    subject.memory["restores"] = in_events == IN_EVENTS
    says = f"{steps} steps after fmi2SetFMUstate are the same ({worst:.1g}){in_events}"
    return passed("state", says, difference=worst)


def _which(subject: Subject) -> str:
    """The parameters without whose movement, before the state was saved and back after it, everything is restored."""

    def restored(moved: Setting) -> bool:
        try:
            return _brought_back(subject, {}, moved)[1] <= _CLEAR
        except ComponentError:
            return True

    every = elsewhere(subject)
    if not every or not restored({}):
        return ""
    alone = [name for name in every if not restored({name: every[name]})] or list(every)
    starts = subject.description.variables
    moves = [f"{name} from {starts[name].start} to {every[name]:g}" for name in alone[:3]]
    return f"; only where it was moved before: {', '.join(moves)}{' and more' if len(alone) > 3 else ''}"


def _in_events(subject: Subject, setting: Setting) -> tuple[float, str]:
    """The same with a state saved within a dip and one saved after it, restored after other dips and jumps.

    How far the runs are apart, and that in words, or what to add to the evidence."""
    draw = subject.random("state")

    def segments(*parts: tuple[str, float]) -> list[Segment]:
        return [(factor(draw, kind) if kind else 1, lasts) for kind, lasts in parts]

    before = segments(("", 0.1), ("middle", 0.12), ("", 0.1), ("deep", 0.25))
    in_dip = [(before[-1][0], 0.2), (1, 0.25)]
    later = segments(("", 0.05), ("deep", 0.4), ("", 0.1), ("jump", 0.1), ("", 0.05))
    elsewhere = segments(("", 0.02), ("deep", 0.42), ("jump", 0.08), ("", 0.05))
    all_of_it = (before, in_dip, later, elsewhere, in_dip, elsewhere, later)
    times = scale(subject, sum(lasts for part in all_of_it for _, lasts in part))
    begin, dip, after, away = (
        rows(subject, part, f"state {k}", times)
        for k, part in enumerate((before, in_dip, later, elsewhere))
    )
    h, found = subject.step_size, []
    try:
        with (
            subject.while_doing("in dips and jumps"),
            subject.running(parameters=setting) as running,
        ):
            running.hold(begin, len(begin), h)
            parts = (("within a dip", dip), ("after a dip", after))
            with ExitStack() as kept:
                saves = []
                for words, part in parts:
                    saves.append((words, part, running.time, kept.enter_context(saved(running))))
                    found.append(running.hold(part, len(part), h))
                seen = (0.0, IN_EVENTS)
                for (words, part, at, state), first in zip(saves, found, strict=True):
                    running.hold(away, len(away), h)
                    running.restore(state, at)
                    apart, place = difference(first, running.hold(part, len(part), h))
                    if apart > seen[0]:
                        says = f"{subject.watched[place]} differs by {apart:.3g} of its range after a state that was "
                        seen = apart, f"{says}saved {words} is restored after other dips and jumps"
                return seen
    except (ComponentError, EndedError):
        subject.doing = ""
        return 0.0, NOT_IN_EVENTS


@check("settable_states", "Does it take the states that it lets a master set?", needs=("reading",))
def settable_states(subject: Subject) -> CheckResult:
    """Set one state after another and read it back."""
    names = subject.description.states
    if not (subject.description.states_are_settable and names):
        return not_applicable(
            "settable_states", "because the FMU does not declare that its states can be set"
        )
    h = subject.step_size
    with subject.running() as running:
        running.record(3, h, subject.steps(hold=h))
        for name in names:
            before = float(running.component.values([name])[name])
            wanted = before + 1e-3 * max(1.0, abs(before))
            running.component.set({name: wanted})
            found = float(running.component.values([name])[name])
            if not abs(found - wanted) <= 1e-6 * abs(wanted - before):
                says = (
                    f"state {name} was {before:.9g}, was set to {wanted:.9g}, and reads {found:.9g}"
                )
                return failed("settable_states", "state not taken", says)
            running.component.set({name: before})
    return passed("settable_states", f"{len(names)} states read as they were set")


@check(
    "state_size", "How large is the state, and does it stay so?", needs=(*SAME, "reading", "state")
)
def state_size(subject: Subject) -> CheckResult:
    if not (subject.description.can_save_state and subject.description.can_serialize_state):
        return not_applicable("state_size", "because the FMU does not declare canSerializeFMUstate")
    h, sizes = subject.step_size, []
    stimulus = subject.steps(hold=10 * h)
    with subject.running() as running:
        for _ in range(4):
            begin = perf_counter()
            with saved(running) as kept:
                seconds = perf_counter() - begin
                sizes.append(len(running.component.serialize_state(kept)))
            running.record(50, h, stimulus)
        again = _serialised(running, h, stimulus)
    least = 8 * len(subject.description.states)
    figures = {"bytes": sizes[0], "microseconds": 1e6 * seconds}
    if sizes[-1] > sizes[0] and sizes == sorted(sizes) and len(set(sizes)) > 2:
        says = f"the serialised state grows from {sizes[0]} to {sizes[-1]} bytes in 150 steps"
        return failed("state_size", "growing state", says, **figures)
    if again is not None:
        return failed("state_size", "serialised state", again, **figures)
    if sizes[0] < least:
        says = f"{sizes[0]} bytes cannot hold {least // 8} continuous states"
        return failed("state_size", "incomplete state", says, **figures)
    return passed("state_size", f"{sizes[0]} bytes, saved in {1e6 * seconds:.0f} µs", **figures)


def _brought_back(subject: Subject, setting: Setting, moved: Setting) -> tuple[str, float, int]:
    """Return what reads otherwise after it was restored; the largest difference of two runs, and the output's place.

    Parameters are moved before the state is saved, and back before it is restored: they belong to it. A second state
    is saved and kept meanwhile."""
    steps, h = affordable(subject, _STEPS), subject.step_size
    stimulus = subject.steps(hold=15 * h)
    place = 0
    worst = 0.0
    with subject.running(parameters=setting) as running:
        states = RealBatch(running.component, subject.description.states)
        before = running.component.values(moved)
        # odd: a control may be between two of its samples
        running.record(steps // 2 | 1, h, stimulus)
        tune(running, {n: not before[n] if isinstance(v, bool) else v for n, v in moved.items()})
        tuned, at, size = running.component.values(moved), running.time, states.read().copy()
        with saved(running) as kept:
            first = running.record(steps, h, stimulus)
            tune(running, before)
            # Somewhere else, so that what stays behind shows.
            running.record(steps // 3 | 1, h, lambda t: -2 * stimulus(t))
            far = states.read().copy()
            with saved(running):
                for _ in range(2):
                    running.restore(kept, at)
                    now = states.read().copy()
                    for k, name in enumerate(states.names):
                        if abs(now[k] - size[k]) > _READ * max(
                            abs(size[k]), abs(far[k] - size[k]), 1e-6
                        ):
                            return (
                                f"state {name} was {size[k]:.9g} and reads {now[k]:.9g} after it",
                                0.0,
                                0,
                            )
                    found = running.component.values(moved)
                    stays = [n for n in moved if found[n] != tuned[n]]
                    if stays:
                        says = f"{stays[0]} was {tuned[stays[0]]:g} and is {found[stays[0]]:g} after it"
                        return f"parameters belong to a state: {says}", 0.0, 0
                    again = running.record(steps, h, stimulus)
                    apart, where = difference(first, again)
                    if apart > worst:
                        worst, place = apart, where
                    tune(running, before)
    return "", worst, place


def _serialised(running: Running, h: float, stimulus: Stimulus) -> str | None:
    """Tell what is wrong with a state that went through bytes and back, or into another instance: it may hold a
    pointer. None if nothing is."""
    at, subject = running.time, running.subject
    with saved(running) as kept:
        content = running.component.serialize_state(kept)
    first = running.record(50, h, stimulus)

    def wrong(taking: Running, refused: str, where: str) -> str | None:
        try:
            copy = taking.component.deserialize_state(content)
            taking.restore(copy, at)
        except ComponentError as error:
            return f"{refused}{error}"
        taking.component.free_state(copy)
        apart, place = difference(first, taking.record(50, h, stimulus))
        says = f"{subject.watched[place]} differs by {apart:.3g} of its range {where}"
        return None if apart <= _CLEAR else says

    here = wrong(running, "", f"after a state that went through {len(content)} bytes")
    if here is not None or subject.description.one_instance:
        return here
    with subject.running("another") as another:
        return wrong(
            another, "in another instance, ", "in another instance that takes the state's bytes"
        )

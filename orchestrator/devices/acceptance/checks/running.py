"""Checks that an FMU runs at all, and gives the same answer twice."""

from collections.abc import Callable
from math import isnan
from time import perf_counter

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
from orchestrator.devices.acceptance.checks.settings import elsewhere
from orchestrator.devices.acceptance.checks.subject import STEPS_IN_A_ROUND, Subject
from orchestrator.devices.fmi.component import RealBatch

RUN_FOR = 2.0  # how long an FMU is made to run [s of a usual one]

STEP_TAKES = 2.5e-6
"""Time [s] in which a usual FMU makes a step: budgets in seconds are so many steps, on any machine and of any FMU."""

_PATIENCE = 10.0  # how many times as long it may take to come to its experiment's end
_HELD = 50  # steps for which inputs stay
_ROUNDS = 4  # changes of the inputs between two looks at the clock

_WANDERS = 0.5  # part of its current's range by which that may differ a round of inputs later
_LOOK = 2.5  # simulated time [s] from one look at its memory to the next
LONGEST = 60.0  # simulated time [s] after which enough was seen
LEAST_STEPS = 20  # an FMU that ends by itself before that many steps has shown nothing
_MOST_STEPS = 200_000  # of one run that is compared
EQUAL = 1e-10  # relative difference up to which two runs are equal


@check("runs", "Does it run without crash, hang, exit, NaN or infinite values?")
def runs(subject: Subject) -> CheckResult:
    """Run to where the file says an experiment ends, at least for a while, and in reason."""
    h, ends = subject.step_size, subject.description.stop_time or 10.0
    stimulus, least = subject.steps(hold=_HELD * h), subject.memory.get("run_for", RUN_FOR)
    with subject.running() as running:
        spent = spent_since(subject)
        k = 0
        sizes = subject.memory["bytes"] = []
        seen, taken = list[Numbers](), list[float]()
        while k * h < max(ends, LONGEST) and spent() < (
            least if k * h >= min(ends, LONGEST) else _PATIENCE * least
        ):
            steps, running.time, looked = _HELD * _ROUNDS, k * h, perf_counter()
            try:
                values = running.record(steps, h, stimulus)
            except EndedError as error:
                return _ended(subject, error)
            except ComponentError as error:
                if (
                    error.time is None
                    or error.time < ends - 0.5 * h
                    or subject.description.stop_time is None
                ):
                    return failed("runs", "error in a step", str(error), time=error.time)
                subject.memory["stops_at"] = error.time
                return remarked(
                    "runs",
                    f"it stops after its experiment's end: {error}",
                    "do not run it for longer",
                )
            if not np.isfinite(values).all():
                row = int(np.argmin(np.isfinite(values).all(axis=1)))
                return _not_finite(subject, values[row], (k + row) * h)
            k += steps
            seen.append(values[-1])
            taken.append((perf_counter() - looked) / steps)
            if k * h >= _LOOK * (len(sizes) + 1):
                sizes.append((k, subject.memory_in_use()))
    # not what else the machine did
    seconds = subject.memory["seconds_per_step"] = float(np.percentile(taken, 25))
    subject.memory["wanders_at"] = _wanders(subject, np.array(seen)) * _HELD * _ROUNDS * h
    if k * h < min(ends, LONGEST) - 0.5 * h:
        says = f"not judged from t = {k * h:.4g} s on: {k} steps were enough, at {1e6 * seconds:.1f} µs a "
        says += f"step, and the experiment ends at t = {ends:g} s; nothing was wrong until then"
        remedy = "run the check for longer, or declare a longer step or a shorter experiment (DefaultExperiment)"
        return remarked("runs", says, remedy, steps=k)
    says = f"{k} steps of {h:g} s, {k * h:.3g} s in all, at {1e6 * seconds:.1f} µs a step; outputs were read at each"
    says += (
        ""
        if k * h >= ends - 0.5 * h
        else f"; its experiment's rest, to t = {ends:g} s, was not run"
    )
    return passed("runs", says, steps=k, step_size=h, microseconds_per_step=1e6 * seconds)


def _wanders(subject: Subject, seen: Numbers) -> int:
    """After how many looks its current is another one than a round of equal inputs before; 0 where it never is."""
    begun = STEPS_IN_A_ROUND // _ROUNDS
    if not subject.port or len(seen) <= begun:
        return 0
    current = seen[:, [subject.outputs.index(n) for n in ("i_re", "i_im")]]
    apart = (
        np.abs(current[begun:] - current[:-begun]).max(axis=1)
        > _WANDERS * np.ptp(current[:begun], axis=0).max()
    )
    return begun + int(np.argmax(apart)) if apart.any() else 0


def spent_since(subject: Subject) -> Callable[[], float]:
    """Count the steps from now on [s of a usual FMU]: neither a busy machine nor a slow FMU is seen less of."""
    begin = subject.steps_made
    return lambda: STEP_TAKES * (subject.steps_made - begin)


def _ended(subject: Subject, error: EndedError) -> CheckResult:
    """An orderly end; so early that nothing can be learned, it is a fault."""
    h, declared, ended = subject.step_size, subject.description.stop_time, error.ended_at
    steps, early = round(error.time / h), declared is not None and ended < declared - 0.5 * h
    text = f"it ended its simulation at t = {ended:.6g} s by itself"
    text += f", before the {declared:g} s that it declares" if early else ""
    text += f" (it says: {error.log})" if error.log else ""
    if steps < LEAST_STEPS:
        return failed("runs", "ends at once", text, time=ended)
    with subject.running() as running:  # what came with the refused step is lost
        values = running.record(steps, h, subject.steps(hold=_HELD * h))
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values).all(axis=1)))
        return _not_finite(subject, values[row], row * h)
    subject.memory["ended_at"] = ended
    return remarked(
        "runs", text, f"an orderly end, no error: let a run stop by t = {ended:.6g} s", time=ended
    )


def _not_finite(subject: Subject, values: Numbers, time: float) -> CheckResult:
    bad = [n for n, v in zip(subject.watched, values, strict=True) if not np.isfinite(v)]
    value = values[~np.isfinite(values)][0]
    says = f"{', '.join(bad[:3])} is {value} at t = {time:.6g} s, and fmi2DoStep returned OK"
    return failed("runs", "not a number", says, time=time)


def affordable(subject: Subject, steps: int, step_size: float | None = None) -> int:
    """Give these steps, or as many as half of the experiment that the file declares has, at most `_MOST_STEPS`."""
    fit = _MOST_STEPS
    ends = subject.ends
    return int(
        min(
            steps,
            fit,
            steps if ends is None else max(10, 0.5 * ends / (step_size or subject.step_size)),
        )
    )


@check("reading", "Does reading leave it as it was?", needs=SAME)
def reading(subject: Subject) -> CheckResult:
    """Read everything, several times and backwards, in one of two equal runs."""
    steps = affordable(subject, 300)
    stimulus = subject.steps(hold=10 * subject.step_size)
    plain = subject.trajectory(steps, subject.step_size, stimulus)
    rows = [plain[0]]
    with subject.running() as running:
        everything = [
            n
            for n, v in subject.description.variables.items()
            if v.type == "Real" and v.reference < 2**32 - 1
        ]
        backwards = RealBatch(running.component, everything[::-1])
        for k in range(steps):
            running.time = k * subject.step_size
            running.feed(stimulus(running.time))
            backwards.read()
            running.step(subject.step_size)
            once, twice = running.read(), (backwards.read(), running.read())[1]
            if not np.array_equal(once, twice, equal_nan=True):
                says = f"at t = {running.time:.6g} s, reading twice gives {once.tolist()[:3]} and {twice.tolist()[:3]}"
                return failed("reading", "reading changes it", says)
            rows.append(twice)
    apart, place = difference(plain, np.array(rows))
    if apart > EQUAL:
        says = f"{subject.watched[place]} differs by {apart:.3g} of its range where everything was read in between"
        return failed("reading", "reading changes it", says, difference=apart)
    return passed(
        "reading", f"{len(everything)} variables read backwards at every step change nothing"
    )


@check("start_values", "Do its variables start where the file says?")
def start_values(subject: Subject) -> CheckResult:
    variables = subject.description.variables
    names = [
        n
        for n, v in variables.items()
        if v.type == "Real"
        and v.start is not None
        and v.causality in ("parameter", "input")
        and v.reference < 2**32 - 1
        and not (subject.port and n in ("v_re", "v_im"))
    ]
    if not names:
        return not_applicable(
            "start_values", "because no Real parameter or input of its own has a start value"
        )
    component = subject.open()
    try:
        component.setup(0.0, None)
        component.enter_initialization_mode()
        values = component.get(names)
    except ComponentError as error:
        return not_applicable(
            "start_values", f"because it cannot be read while it is initialised: {error}"
        )
    finally:
        component.close()
    wrong = [
        f"{n} is {v:g} and {variables[n].start} is declared"
        for n, v in values.items()
        if isnan(v) or abs(v - variables[n].start_number) > 1e-9 * max(1.0, abs(v))
    ]
    if wrong:
        return failed("start_values", "start values differ", "; ".join(wrong[:3]))
    lost = _not_taken(subject)
    if lost:
        return failed("start_values", "parameter not taken", lost)
    return passed("start_values", f"{len(names)} parameters and inputs start as declared")


def _not_taken(subject: Subject) -> str | None:
    """A parameter that reads as before after it was set; None if there is none."""
    start = subject.description.variables
    wanted = elsewhere(subject, switches=False)
    if not wanted:
        return None
    try:
        with subject.running(parameters=wanted) as running:
            found = running.component.get(list(wanted))
    except ComponentError:
        return None  # it may refuse values that do not go together
    lost = [n for n, v in found.items() if v == start[n].start_number != wanted[n]]
    return (
        f"{lost[0]} was set to {wanted[lost[0]]:g} and stays {found[lost[0]]:g}" if lost else None
    )

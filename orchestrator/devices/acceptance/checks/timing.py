"""Checks that an FMU's answer does not depend on how a master steps it, and comes when it is due."""

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from orchestrator.core.arrays import Numbers, rms
from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.comparing import scales
from orchestrator.devices.acceptance.checks.port import voltage_rows
from orchestrator.devices.acceptance.checks.running import affordable
from orchestrator.devices.acceptance.checks.subject import Running, Stimulus, Subject
from orchestrator.devices.acceptance.checks.switching import switches_elsewhere

# times as much that twice the step may differ: a method of fourth order is 16 times as far off
_BEYOND = 32.0
_LARGE = 0.1
_CLEARLY = 0.15  # part of a difference that a shift may leave, and be its cause
_RATIOS = ((7, 10), (13, 10), (17, 12), (7, 4))
"""Other communication steps: a times the step where b of them last a steps; none is a multiple of another."""

_DELAYS = 5  # communication steps of delay that are looked for


# at which it is looked as well [pu]: a limit or an arrester may act there only
_VOLTAGES = (1.08, 0.6)


@check(
    "feedthrough",
    "Does what its outputs depend on at once agree with what it declares?",
    needs=("reading",),
)
def feedthrough(subject: Subject) -> CheckResult:
    """Change one input after another, without a step, and see which outputs follow."""
    if not subject.inputs or not subject.outputs:
        return not_applicable("feedthrough", "because there are no Real inputs, or no Real outputs")
    seen = _observed(subject)
    subject.memory["feedthrough"] = seen
    declared = {n: subject.description.feedthrough(n) for n in subject.outputs}
    hidden = {
        n: sorted(seen[n] - set(declared[n])) for n in subject.outputs if seen[n] - set(declared[n])
    }
    observed = {n: sorted(v) for n, v in seen.items()}
    if hidden:
        text = "; ".join(
            f"{n} follows {', '.join(names[:4])} at once" for n, names in list(hidden.items())[:3]
        )
        says = f"{text}, and the file says it does not"
        return failed("feedthrough", "undeclared feed-through", says, observed=observed)
    says = f"{sum(map(len, seen.values()))} direct dependencies seen, all of them declared"
    return passed("feedthrough", says, observed=observed)


def _observed(subject: Subject) -> dict[str, set[str]]:
    """For each output the inputs that move it without a step, at a few points of a run, and of the voltage."""
    seen: dict[str, set[str]] = {n: set() for n in subject.outputs}
    sizes, h = subject.amplitudes, subject.step_size
    with subject.running() as running:
        for count in (0, 3, 20):
            running.record(count, h, subject.steps(hold=5 * h))
            _note_direct(running, np.zeros(len(sizes)), seen)
        if subject.port:
            with suppress(ComponentError):  # it may refuse such a voltage
                for here in voltage_rows(running, np.array(_VOLTAGES, complex)):
                    _note_direct(running, here, seen)
    return seen


def _note_direct(running: Running, here: Numbers, seen: dict[str, set[str]]) -> None:
    """Move one input after another from one place, and note which outputs follow."""
    subject, sizes = running.subject, running.subject.amplitudes
    running.feed(here)
    before = running.read()
    for j, name in enumerate(subject.inputs):
        moved = here.copy()
        moved[j] += sizes[j]
        running.feed(moved)
        after = running.read()
        for k, output in enumerate(subject.outputs):
            if abs(after[k] - before[k]) > 1e-10 * (abs(before[k]) + abs(sizes[j])):
                seen[output].add(name)
    running.feed(here)


@check("delay", "Do its outputs come when they are due?", needs=(*SAME, "reading"))
def delay(subject: Subject) -> CheckResult:
    """Look for answers that are shifted by a number of communication steps, whatever these are."""
    runs = _at_step_sizes(subject)
    if isinstance(runs, str):
        return not_applicable("delay", f"because it runs with one communication step only: {runs}")
    for words, (fine, double, fourfold) in (("", runs), *_in_a_dip(subject)):
        late = _shift(fine, double, 2)
        if late and late == _shift(fine, fourfold, 4):
            says = f"the response{words} comes {late} communication step{'s' * (late > 1)} late, with any step size"
            return failed("delay", "delayed output", says, steps=late)
    stale = _stale(subject, declared=True)
    if stale:
        return failed("delay", "delayed output", stale, steps=1)
    stale = _stale(subject, declared=False)
    if stale:
        return remarked(
            "delay", stale, "its partners see it one step late; ask for outputs that follow at once"
        )
    says = f"no shift by communication steps is seen from {subject.step_size:g} s to {4 * subject.step_size:g} s"
    return passed("delay", says)


def _at_step_sizes(subject: Subject) -> tuple[Numbers, Numbers, Numbers] | str:
    """The response to one step of all inputs, with one, two and four times a step size.

    That is the FMU's own, or a quarter of it where four times as much leads nowhere: not every FMU that is good at its
    own step is so beyond."""
    if "step sizes" not in subject.memory:
        for base in (subject.step_size, subject.step_size / 4):
            subject.memory["base step"] = base
            subject.memory["step sizes"] = runs = _runs_from(subject, base, subject.one_step())
            if not isinstance(runs, str) and _stays(runs):
                break
    found: tuple[Numbers, Numbers, Numbers] | str = subject.memory["step sizes"]
    return found


def _in_a_dip(subject: Subject) -> Iterator[tuple[str, tuple[Numbers, Numbers, Numbers]]]:
    """The same in a dip to half of the voltage, for an FMU whose outputs take another way there."""
    if not subject.port:
        return
    with subject.running() as running:
        dip = voltage_rows(running, np.array([0.5 + 0j]))[0]
    runs = _runs_from(subject, subject.memory["base step"], lambda time: dip)
    if not isinstance(runs, str) and _stays(runs):
        yield " in a dip to half of the voltage", runs


def _runs_from(
    subject: Subject, base: float, stimulus: Stimulus
) -> tuple[Numbers, Numbers, Numbers] | str:
    steps = 4 * (affordable(subject, 400) // 4)
    try:
        one, two, four = (
            subject.trajectory(steps // many, many * base, stimulus) for many in (1, 2, 4)
        )
    except ComponentError as error:
        return str(error)
    return one, two, four


def _stays(runs: tuple[Numbers, Numbers, Numbers]) -> bool:
    """Return whether the longer steps lead to numbers of the same order."""
    fine, *coarse = runs
    size = np.abs(fine).max(initial=1e-9)
    return all(
        bool(np.isfinite(run).all()) and np.abs(run).max(initial=0.0) < 100 * size for run in coarse
    )


def _shift(fine: Numbers, coarse: Numbers, many: int) -> int:
    """By how many communication steps an output of the coarse run is late, and of the fine run as well; else 0.

    Late by ``count`` steps of any size, it lags ``count·(many − 1)`` fine steps more in the coarse run."""
    size, at = scales(fine, coarse), np.arange(1, len(coarse)) * many
    for column in range(fine.shape[1]):
        a, b = fine[:, column] / size[column], coarse[:, column] / size[column]
        plain = rms(b[1:] - a[at])
        if plain < 1e-4:
            continue
        for count in range(1, _DELAYS + 1):
            lag = count * (many - 1)
            late = at[at - lag >= 0]
            if len(late) > 3 and rms(b[late // many] - a[late - lag]) < _CLEARLY * plain:
                return count
    return 0


def _stale(subject: Subject, *, declared: bool) -> str | None:
    """Outputs that follow an input at once, but not when they are read: they jump in the next step, however short.

    ``declared``: look at the inputs that the file says they depend on at once; else at those of which it says nothing.
    """
    seen, h = subject.memory.get("feedthrough"), subject.step_size
    known = subject.description.output_dependencies
    if seen is None:
        return None
    for output in subject.outputs:
        said = known.get(output)
        claimed = [
            n
            for n in subject.inputs
            if (said is None and not declared) or (declared and n in (said or ()))
        ]
        for name in claimed:
            if name in seen[output]:
                continue
            (jump, size), (short, _) = (_jump(subject, output, name, step) for step in (h, h / 8))
            if jump > 1e-6 * max(size, 1.0) and short > 0.8 * jump:
                follows = "is declared to follow" if declared else "follows"
                return (
                    f"{output} {follows} {name} at once, but not when read: it jumps by {short:.3g} in the next, "
                    f"of {h / 8:g} s or of {h:g} s"
                )
    return None


def _jump(subject: Subject, output: str, name: str, step_size: float) -> tuple[float, float]:
    """How far one step moves an output after an input moved, beyond where it goes without, and the output's size."""
    ends = []
    for on in (0.0, 1.0):
        deviation = np.zeros(len(subject.inputs))
        deviation[subject.inputs.index(name)] = on * subject.amplitudes[subject.inputs.index(name)]
        with subject.running() as running:
            running.feed(deviation)
            running.step(step_size)
            ends.append(running.component.get([output])[output])
    return abs(ends[1] - ends[0]), abs(ends[0])


@check(
    "step_invariance",
    "Is its answer the same with other communication steps?",
    needs=(*SAME, "reading", "delay"),
)
def step_invariance(subject: Subject) -> CheckResult:
    runs = _at_step_sizes(subject)
    if isinstance(runs, str):
        says = f"it refuses another communication step: {runs}"
        return remarked("step_invariance", says, "couple it with its own step only")
    fine, double, fourfold = runs
    first, second = _typical(double, fine[::2]), _typical(fourfold, double[::2])
    h = subject.memory["base step"]
    figures = {"difference_H_2H": first, "difference_2H_4H": second}
    seen = (
        f"steps of {h:g} and {2 * h:g} s differ by {first:.3g} of the range, "
        f"{2 * h:g} and {4 * h:g} s by {second:.3g}"
    )
    converges = first < 0.75 * second
    breaks = second > _LARGE or second > max(1e-3, _BEYOND * first)
    pairs = [((fine, h), (double, 2 * h))]
    elsewhere = switches_elsewhere(subject.watched, pairs) if first > _LARGE else None
    if elsewhere:
        subject.memory["switching"] = True
        return _switching("step_invariance", elsewhere, seen, **figures)
    if first > _LARGE or (first > 1e-3 and not converges):
        return failed("step_invariance", "step-dependent answer", seen, **figures)
    if first > 1e-3:
        return remarked(
            "step_invariance",
            seen,
            "it converges, but needs a smaller communication step",
            **figures,
        )
    breaks = breaks and not switches_elsewhere(
        subject.watched, [((double, 2 * h), (fourfold, 4 * h))]
    )
    named = max(subject.description.default_step_size or 0.0, subject.use.step_size or 0.0)
    if breaks and h == subject.step_size and 4 * h <= named * (1 + 1e-9):
        return failed(
            "step_invariance",
            "step-dependent answer",
            f"{seen}, which it declares to bear",
            **figures,
        )
    if breaks and h == subject.step_size:
        remedy = f"keep to steps of {2 * h:g} s or smaller ones"
        return remarked("step_invariance", f"{seen}: no method converges so", remedy, **figures)
    if h < subject.step_size:
        seen += f"; with {4 * subject.step_size:g} s it leads nowhere"
        return remarked(
            "step_invariance",
            seen,
            "keep to its own communication step, or a smaller one",
            **figures,
        )
    return passed("step_invariance", seen, **figures)


def _switching(name: str, signals: list[str], seen: str, **figures: float) -> CheckResult:
    says = f"{', '.join(signals)} switches at other moments with another step, and nothing else differs; {seen}"
    remedy = "the moments of switching are as exact as the communication step: take a smaller one where they matter"
    return remarked(name, says, remedy, switching=signals, **figures)


def _typical(a: Numbers, b: Numbers) -> float:
    """The difference that most samples have, relative to the range, of the output that differs most.

    One sample beside an event, such as a bounce, says nothing."""
    count = min(len(a), len(b))
    apart = np.abs(a[:count] - b[:count]) / scales(a, b)
    return float(np.nan_to_num(np.percentile(apart, 70, axis=0), nan=np.inf).max(initial=0.0))


@check(
    "internal_step",
    "Does its internal step stay inside, where communication steps are no multiple of it?",
    needs=(*SAME, "reading", "delay", "step_invariance"),
)
def internal_step(subject: Subject) -> CheckResult:
    h = subject.memory.get("base step", subject.step_size)
    evens = subject.memory.get("step sizes")
    if isinstance(evens, str):
        return not_applicable(
            "internal_step", f"because it runs with one communication step only: {evens}"
        )
    total = max(20, 7 * affordable(subject, 400) // 10)
    try:
        plain = subject.trajectory(total, h, subject.one_step())
        odd = {
            (span, many): subject.trajectory(
                many * (total // span), span / many * h, subject.one_step()
            )
            for span, many in _RATIOS
        }
    except ComponentError as error:
        says = f"it refuses communication steps that are no multiple of its own: {error}"
        return remarked("internal_step", says, "couple it with multiples of its own step only")
    worst, share = max(
        (_typical(run[::many], plain[::span][: total // span + 1]), f"{span}/{many}")
        for (span, many), run in odd.items()
    )
    one_step = _typical(plain[1:], plain[:-1])
    figures = {"difference": worst, "of_one_step": one_step}
    seen = f"with {share} times the step of {h:g} s the answer differs by {worst:.3g} of the range"
    if worst > max(3 * one_step, 5e-3):
        pairs = [((plain, h), (run, span / many * h)) for (span, many), run in odd.items()]
        elsewhere = switches_elsewhere(subject.watched, pairs)
        if elsewhere:
            if subject.memory.get("switching"):
                return not_applicable(
                    "internal_step", "because only moments of switching differ, as was said above"
                )
            return _switching("internal_step", elsewhere, seen, **figures)
        return failed(
            "internal_step",
            "internal step leaks",
            f"{seen}; one step moves it by {one_step:.3g}",
            **figures,
        )
    if worst > 1e-3:
        return remarked("internal_step", seen, "prefer multiples of its internal step", **figures)
    return passed("internal_step", seen, **figures)

"""How often an FMU's outputs change: whether it takes the steps that it is asked to take."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import ComponentError
from orchestrator.core.units import whole_percent
from orchestrator.devices.acceptance.checks.base import (
    SAME,
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.running import affordable
from orchestrator.devices.acceptance.checks.subject import Subject

_FINER = 8  # it is also looked at with steps so many times smaller
_IDLE = 2.01  # steps from one change to the next above which more than half of all steps do nothing
# steps of a run; the next longer one where the last one saw too few changes
_LENGTHS = (200, 2000, 20000)
_SINGLE = 400  # steps of a run in which every input is set, and every output read, by itself
_CHANGES = 4  # times from change to change that a sample time takes to be seen
# part of all steps that must move the outputs for a step that does not to be a step that was
# skipped
_MOST_MOVE = 0.7
# mean steps from change to change that are every step: it may rest where a number is rounded
_MOST_STEPS = 1.05


@check(
    "sample_time",
    "Do its outputs change with every step, or at times of its own?",
    needs=(*SAME, "reading"),
)
def sample_time(subject: Subject) -> CheckResult:
    """Move all inputs before every step and see in which steps the outputs move."""
    h = subject.step_size
    own = _sample_time(subject, h)
    if own is None:
        return not_applicable("sample_time", "because its outputs change too seldom to tell")
    idle_at = _skipped(subject, h) if own <= h * 1.001 and subject.inputs else None
    if idle_at is not None:
        said = f"in the step to t = {idle_at:.6g} s nothing moves, although its inputs do, as in all others"
        return failed("sample_time", "step not honoured", said, idle_at=idle_at)
    if own <= h * 1.001:
        try:
            finer = _sample_time(subject, h / _FINER)
        except ComponentError:
            finer = None  # it has steps of its own size only, which is no fault
        if finer is None or finer <= h / _FINER * 1.001:
            return passed(
                "sample_time", f"its outputs change with every step of {h:g} s", sample_time=None
            )
        said = f"its outputs change every {_seconds(finer)} only; with steps of {_seconds(h)} that is every step"
        return passed("sample_time", said, sample_time=finer)
    part = f"{whole_percent(1 - h / own)} of all steps of {_seconds(h)}"
    idle = f"its outputs change every {_seconds(own)} only: {part} do nothing"
    if own > _IDLE * h and subject.step_is_given:
        return failed("sample_time", "step not honoured", idle, sample_time=own)
    remedy = f"couple it with steps of {_seconds(own)} or multiples of it; what it answers in between is old"
    return remarked("sample_time", idle, remedy, sample_time=own)


def _sample_time(subject: Subject, step_size: float) -> float | None:
    """Mean time from one change of the outputs to the next; None where they change too seldom, or by chance."""
    found: float | None = None
    for length in _LENGTHS:
        steps = affordable(subject, length, step_size)
        gaps = [_gap(column) for column in _changes(subject, steps, step_size).T]
        found = min((gap for gap in gaps if gap is not None), default=found)
        if steps < length or (
            found is not None and (length > _LENGTHS[0] or found == round(found))
        ):
            break  # what is no multiple of the step is known better after more of them
    if found is None:
        return None
    return found * step_size if found == round(found) else float(f"{found * step_size:.2g}")


def _skipped(subject: Subject, step_size: float) -> float | None:
    """Time of a single step in which no output moves although outputs move before and after it; else None."""
    moved = np.asarray(
        _changes(subject, affordable(subject, _LENGTHS[1], step_size), step_size).any(axis=1)
    )
    idle = np.flatnonzero(~moved[1:-1] & moved[:-2] & moved[2:]) + 1
    if not len(idle) or moved.mean() < _MOST_MOVE:
        return None
    return float(idle[0] + 1) * step_size


def _changes(subject: Subject, steps: int, step_size: float) -> NDArray[np.bool_]:
    """For each step whether it moved each output, shape (steps, outputs).

    Where an output follows an input at once, that would hide that nothing else moves: there it is read before the step
    as well, after the inputs were set."""
    stimulus = subject.motion(step_size)
    with subject.running() as running:
        if not any(subject.memory.get("feedthrough", {"": True}).values()):
            rows = running.record(steps, step_size, stimulus)
            before, after = rows[:-1], rows[1:]
        else:
            pairs = []
            for k in range(min(steps, _SINGLE)):
                running.time = k * step_size
                running.feed(stimulus(running.time))
                start = running.read()
                running.step(step_size)
                pairs.append((start, running.read()))
            before, after = np.array(pairs).transpose(1, 0, 2)
    size = np.maximum(np.abs(after).max(axis=0, initial=0.0), 1e-12)
    changed: NDArray[np.bool_] = np.abs(after - before) > 1e-13 * size
    return changed


def _gap(changed: NDArray[np.bool_]) -> float | None:
    """Mean number of steps from change to change, where these are as even as samples are."""
    gaps = np.diff(np.flatnonzero(changed))
    if len(gaps) < _CHANGES:
        return None
    mean = float(gaps.mean())
    if gaps.max() - gaps.min() <= 1:
        return mean if mean > _MOST_STEPS else 1.0
    return 1.0 if np.median(gaps) == 1 else None  # it rests at times


def _seconds(time: float) -> str:
    unit, size = next(
        (u, s)
        for u, s in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6))
        if time >= 0.0999 * s or u == "µs"
    )
    if unit == "ms" and time < 0.999e-3:
        unit = "µs"
        size = 1e-6
    return f"{time / size:.3g} {unit}"

"""The cause that would explain what a model does otherwise than the plant: a value or two, a switch, a delay, a limit.

Causes are tried where they can be: switches and kinds by a run each, numbers by one difference each, of which those
that promise the most are followed. Delays and limits are read from the responses. The voltage between two samples,
where it jumps, is nobody's error: the part of an error that it may have made is taken out of each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.studies.validation.cause_bench import (
    CauseBench,
    Responses,
    other_positions,
    squares_of,
)
from orchestrator.studies.validation.cause_bounds import with_bound
from orchestrator.studies.validation.cause_limits import levels_of_limits, limits_of_current
from orchestrator.studies.validation.cause_numbers import (
    Promise,
    follow,
    numbers_by_factors,
    numbers_by_slope,
    promises_of,
)
from orchestrator.studies.validation.cause_pairs import cause_beside, pair_of_limits
from orchestrator.studies.validation.causes import (
    CauseKind,
    CauseSearch,
    Explanation,
    delay_of,
    later,
    nothing_to_explain,
    without_worse_ways,
)
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import (
    RecordedEvent,
    cut_event,
    rms_error,
    rms_movement,
)
from orchestrator.studies.validation.residuals import Report

_MOST_RECORDED = 12.0  # length of the recordings with which causes are tried, all together [s]
_HELD_AFTER = (
    4.0  # part of an event after its begin in which the device is held in step [s]: a swing or two
)
_HELD_BEFORE = 0.5  # part before it, the same [s]
_LITTLE = 0.05  # part of the plant's movement (rms) by which a model that is in step may be off
_MUCH = 0.25
"""Part of the plant's movement (rms) that a cause may leave: one that leaves more of a model that fell out of step may
only keep it from falling, as a large reactance does."""

_MOST_EVENTS = 3  # those with the largest errors
_WORSE = 1.2  # times the squared error: a position that leaves more at a first look is none
_GAIN = re.compile(r"[Kk][^a-z]?.*|.*gain.*")  # last part of the name of a controller's gain


def explain_errors(
    device: PlayedDevice,
    events: Sequence[RecordedEvent],
    report: Report = lambda text: None,
    in_step: Sequence[RecordedEvent] | None = None,
) -> CauseSearch:
    """Causes that would explain the errors, each by itself, the one that leaves the least first.

    ``in_step``: the events up to where the device falls out of step, where it does. If nothing explains most of the
    error, causes are tried while the device is held in step. Of long recordings the first seconds of the events with
    the largest errors are looked at. Ctrl-C leaves the causes that were found until then."""
    found = _search(device, in_step or events, report, far=in_step is None)
    if nothing_to_explain(found.causes):
        return found
    enough = found.explains and found.causes[0].left <= _MUCH * _movement(events)
    if enough or not found.finished or not _misses_much(device, events):
        return _with_bounds(device, in_step or events, found, report)
    short = [cut_event(one, _HELD_AFTER, _HELD_BEFORE) for one in events]
    other = _search(device.in_step, short, report, _plain_error(device, short))
    if not (other.explains and _leaves_less(other, found)):
        taken = replace(found, finished=other.finished)
        return _with_bounds(device, in_step or events, taken, report)
    return _with_bounds(device.in_step, short, other, report)


def _with_bounds(
    device: PlayedDevice, events: Sequence[RecordedEvent], found: CauseSearch, report: Report
) -> CauseSearch:
    """The causes, each likely number with the bound of its values where the recordings tell no single one."""
    numbers = [one for one in found.causes if one.explains and one.is_number_alone]
    if not found.finished or not numbers:
        return found
    bounded: dict[str, Explanation] = {}
    try:
        bench = CauseBench(device, _looked_at(device, events), report)
        for one in numbers:
            bounded[one.name] = with_bound(bench, one)
    except KeyboardInterrupt:
        found = replace(found, finished=False)
    causes = [bounded.get(one.name, one) if one in numbers else one for one in found.causes]
    return replace(found, causes=causes)


def _movement(events: Sequence[RecordedEvent]) -> float:
    """The rms movement of P and Q after the events' begins [pu of the rating]."""
    return float(np.sqrt(np.mean([np.hypot(*rms_movement(one)) ** 2 for one in events])))


def _leaves_less(one: CauseSearch, other: CauseSearch) -> bool:
    """Return whether one search's first cause leaves less than that of another, where that explains anything."""
    return not other.explains or one.causes[0].left < other.causes[0].left


def _misses_much(device: PlayedDevice, events: Sequence[RecordedEvent]) -> bool:
    """Return whether some event's error is more than a little of what the plant moved: out of step it is all of it."""
    for one in events:
        error = np.hypot(*rms_error(device.play(one.recording, one.start).power, one))
        if error > _LITTLE * np.hypot(*rms_movement(one)):
            return True
    return False


def _plain_error(device: PlayedDevice, events: Sequence[RecordedEvent]) -> float:
    """The rms error of P and Q that plain play-back makes [pu of the rating].

    What gives way makes the error of a wrong model large: a cause that leaves more than plain play-back is none."""
    errors = [rms_error(device.play(one.recording, one.start).power, one) for one in events]
    return float(np.sqrt(np.mean([np.hypot(*one) ** 2 for one in errors])))


def _search(
    device: PlayedDevice,
    events: Sequence[RecordedEvent],
    report: Report,
    most: float = float("inf"),
    far: bool = True,
) -> CauseSearch:
    """Search all causes; ``most``: rms error that counts as the device's own at most [pu of the rating].

    ``far``: whether numbers are tried far from where they are as well. Before a model falls out of step little can be
    told of them, and the search that holds it in step follows."""
    found: list[Explanation] = []
    finished = True
    try:
        for one in _causes(device, events, report, far):
            found.append(replace(one, error=min(one.error, most)))
    except KeyboardInterrupt:
        finished = False
    kept = (one for one in found if one.left < one.error or one.cause is CauseKind.NOISE)
    better = sorted(kept, key=lambda one: one.left)
    return CauseSearch(without_worse_ways(better), finished, held=device.gives_way)


def _causes(
    device: PlayedDevice, events: Sequence[RecordedEvent], report: Report, far: bool
) -> Iterator[Explanation]:
    """Causes as they are found, the quickest first.

    Numbers are tried far from where they are, limits at levels, and two causes at once, only if what was found leaves
    more than the scatter. A run that is held in step takes three times as long: there the former is done if nothing
    explains, and the last for limits alone."""
    looked_at = _looked_at(device, events)
    bench = CauseBench(device, looked_at, report)
    noise = bench.noise_alone()
    if nothing_to_explain([noise]):
        yield noise
        return
    rough = bench if device.rough is device else CauseBench(device.rough, looked_at, report)
    told = explained = False
    best: Explanation | None = None  # of those with which the device can be run

    def seen(causes: Iterator[Explanation]) -> Iterator[Explanation]:
        nonlocal told, explained, best
        for one in causes:
            if one.values and (best is None or one.leaves_less_than(best)):
                best = one
            explained = explained or one.explains
            told = told or (one.explains and not one.leaves_much)
            yield one

    yield from seen(_positions(bench, rough))
    promises = list(promises_of(rough, rough.parameters("Real")))
    bench.idle = rough.idle
    yield from seen(numbers_by_slope(bench, rough, promises))
    yield from seen(_delays(rough, promises))
    yield from seen(limits_of_current(bench))
    if not told and device.gives_way:
        yield from seen(levels_of_limits(bench, rough))
    enough = explained if device.gives_way else told
    if far and not enough and bench.misses:
        yield from seen(numbers_by_factors(bench, rough, promises))
    if not told and best is not None:
        yield from seen(pair_of_limits(bench, rough, best))
    if not told and best is not None and not device.gives_way:
        yield from cause_beside(bench, rough, best)


def _looked_at(device: PlayedDevice, events: Sequence[RecordedEvent]) -> list[RecordedEvent]:
    if sum(one.recording.length for one in events) <= _MOST_RECORDED:
        return list(events)
    most = _MOST_RECORDED / min(len(events), _MOST_EVENTS)
    short = [cut_event(one, max(most - one.windows.begin, 0.5 * most)) for one in events]
    if len(short) <= _MOST_EVENTS:
        return short
    errors = [np.hypot(*rms_error(device.play(e.recording, e.start).power, e)) for e in short]
    return [short[k] for k in np.argsort(errors)[::-1][:_MOST_EVENTS]]


def _positions(bench: CauseBench, rough: CauseBench) -> Iterator[Explanation]:
    """Other positions of switches and of kinds, whole numbers within bounds, that do not fail at a first look."""
    best: Explanation | None = None
    rough.announce({info.name: value} for info, value in other_positions(bench))
    for info, value in other_positions(bench):
        bench.report(f"trying {info.name} = {str(value).lower()}")
        looked = rough.responses({info.name: value})
        if looked is None or squares_of(rough.errors(looked)) > _WORSE * squares_of(rough.error):
            continue
        found = looked if rough is bench else bench.responses({info.name: value})
        if found is None:
            continue
        now = bench.device.value(info.name)
        one = bench.explanation(CauseKind.POSITION, info.name, now, value, bench.errors(found))
        yield one
        if isinstance(value, bool) and (best is None or one.left < best.left):
            best = one
    if best is not None and best.left < best.error:
        yield from _tuned(bench, best)


def _tuned(bench: CauseBench, switch: Explanation) -> Iterator[Explanation]:
    """A switch in its other position, with the one number beside it that explains the most."""
    part, dot, _ = switch.name.rpartition(".")
    values = {switch.name: switch.value}
    other = CauseBench(bench.device.with_values(values), bench.events, bench.report, bench.hidden)
    beside = [info for info in other.parameters("Real") if info.name.startswith(part + dot)]
    promises = list(promises_of(other, beside)) if dot else []
    if promises:
        best = max(promises, key=lambda one: one.gain(other.error))
        value, left = follow(other, best)
        tuned = bench.explanation(CauseKind.POSITION, switch.name, switch.now, switch.value, left)
        yield replace(tuned, beside={best.number.name: value})


def _delays(bench: CauseBench, promises: Sequence[Promise]) -> Iterator[Explanation]:
    """The whole response later or earlier, and what each gain of a controller acts on.

    A delay before a gain moves the response as the gain does, by the part that comes later: both act at one place, and
    loops are closed around both."""
    steady = [
        np.full(len(power), event.start.power)
        for power, event in zip(bench.base, bench.events, strict=True)
    ]
    without: dict[str, Responses] = {"delay of the whole response": steady}
    for one in promises:
        if _GAIN.fullmatch(one.number.name.rpartition(".")[2]) and one.number.start:
            pairs = zip(bench.base, one.moves, strict=True)
            without[f"delay before {one.number.name}"] = [
                base - one.number.start * moves for base, moves in pairs
            ]
    intervals = [one.recording.interval for one in bench.events]
    for name, rest in without.items():
        delay = delay_of(bench.base, rest, intervals, bench.errors)
        if delay:
            left = bench.errors(later(bench.base, rest, intervals, delay))
            yield bench.explanation(CauseKind.DELAY, name, 0.0, delay, left, unit="s")

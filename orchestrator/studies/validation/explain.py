"""The one cause that would explain what a model does otherwise than the plant: a value, a switch, a delay or a limit.

Causes are tried where they can be: switches and kinds by a run each, numbers by one difference each, of which those
that promise the most are followed. Delays and limits are read from the responses. The voltage between two samples,
where it jumps, is nobody's error: the part of an error that it may have made is taken out of each."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from orchestrator.core.arrays import Complex, Numbers
from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.validation.causes import (
    CauseKind,
    CauseSearch,
    Explanation,
    cap_of_current,
    capped,
    delay_of,
    later,
)
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import (
    RecordedEvent,
    cut_event,
    noise_before,
    rms_error,
    rms_movement,
)
from orchestrator.studies.validation.hidden import HiddenPart, hidden_voltages, with_hidden
from orchestrator.studies.validation.parameters import NEVER, Adjustable, adjustable
from orchestrator.studies.validation.residuals import LEAST_SCATTER, Report

_MOST_RECORDED = 12.0  # length of the recordings with which causes are tried, all together [s]
_HELD_AFTER = (
    4.0  # part of an event after its begin in which the device is held in step [s]: a swing or two
)
_HELD_BEFORE = 0.5  # part before it, the same [s]
_LITTLE = 0.05  # part of the plant's movement (rms) by which a model that is in step may be off
_MOST_EVENTS = 3  # those with the largest errors
_STEP = 0.02  # difference for a sensitivity, as part of a parameter's reach
_WORSE = 1.2  # times the squared error: a position that leaves more at a first look is none
_FOLLOWED = 5  # numbers that are followed to their best value, those that promise the most
_MOST_STEPS = 5  # runs in which one is followed
_SETTLED = 1e-3  # part of the squared error: a smaller gain ends the following
_MOST_WORDS = 8  # positions of a whole number that are tried
_GAIN = re.compile(r"[Kk][^a-z]?.*|.*gain.*")  # last part of the name of a controller's gain
_LIMITS_ARE = (0.9, 2.0)  # times the plant's largest current, as numbers in pu that may be limits
_LEVELS = (0.95, 0.9, 0.85, 0.8, 0.75, 0.7)  # times that current, at which they are tried
_MOST_LIMITS = 12  # values that are tried as a limit, with the kinds that would use them

Values = Mapping[str, float | bool]
Responses = Sequence[Complex]


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
    found = _search(device, in_step or events, report)
    if found.explains or not found.finished or not _misses_much(device, events):
        return found
    short = [cut_event(one, _HELD_AFTER, _HELD_BEFORE) for one in events]
    other = _search(device.in_step, short, report, _plain_error(device, short))
    return replace(other if other.explains else found, finished=other.finished)


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
) -> CauseSearch:
    """Search all causes; ``most``: rms error that counts as the device's own at most [pu of the rating]."""
    found: list[Explanation] = []
    finished = True
    try:
        for one in _causes(device, events, report):
            if not any(one.same_as(other) for other in found):
                found.append(replace(one, error=min(one.error, most)))
    except KeyboardInterrupt:
        finished = False
    better = sorted((one for one in found if one.left < one.error), key=lambda one: one.left)
    return CauseSearch(better, finished, held=device.gives_way)


def _causes(
    device: PlayedDevice, events: Sequence[RecordedEvent], report: Report
) -> Iterator[Explanation]:
    """Causes as they are found, the quickest first."""
    looked_at = _looked_at(device, events)
    bench = _Bench(device, looked_at, report)
    rough = bench if device.rough is device else _Bench(device.rough, looked_at, report)
    yield from _positions(bench, rough)
    promises = list(_promises(rough, rough.parameters("Real")))
    bench.idle = rough.idle
    yield from _numbers(bench, rough, promises)
    yield from _delays(rough, promises)
    yield from _limits(bench)
    if device.gives_way:
        yield from _levels(bench, rough)


def _looked_at(device: PlayedDevice, events: Sequence[RecordedEvent]) -> list[RecordedEvent]:
    if sum(one.recording.length for one in events) <= _MOST_RECORDED:
        return list(events)
    most = _MOST_RECORDED / min(len(events), _MOST_EVENTS)
    short = [cut_event(one, max(most - one.windows.begin, 0.5 * most)) for one in events]
    if len(short) <= _MOST_EVENTS:
        return short
    errors = [np.hypot(*rms_error(device.play(e.recording, e.start).power, e)) for e in short]
    return [short[k] for k in np.argsort(errors)[::-1][:_MOST_EVENTS]]


@dataclass
class _Bench:
    """A device at events, with what was found of it so far.

    ``squares`` of an error: the mean over the events of the squares of the rms errors of P and Q [pu²].
    ``hidden``: how the voltage between samples moves the errors; that of another bench at the same events will do."""

    device: PlayedDevice
    events: Sequence[RecordedEvent]
    report: Report
    hidden: HiddenPart | None = None
    base: Responses = field(init=False)
    error: Numbers = field(init=False)
    noise: float = field(init=False)
    idle: list[VariableInfo] = field(default_factory=list)  # numbers that act on nothing

    def __post_init__(self) -> None:
        played = [self.device.play(one.recording, one.start) for one in self.events]
        self.base = [one.power for one in played]
        pairs = zip(self.events, played, strict=True)
        scatters = [noise_before(event, one) for event, one in pairs]
        self.noise = float(np.mean([n[s].scatter ** 2 for n in scatters for s in "pq"]) * 2) ** 0.5
        if self.hidden is None:
            self.hidden = self._hidden_part()
        self.error = self.errors(self.base)

    def _hidden_part(self) -> HiddenPart:
        """How the errors move with the voltage that no sample holds, one run for each unknown."""
        unknown = hidden_voltages(self.events)
        columns = []
        for one in unknown:
            self.report("looking between the samples")
            event = self.events[one.event]
            moved = with_hidden(event.recording, [one], {one.name: one.scale})
            responses = list(self.base)
            responses[one.event] = self.device.play(moved, event.start).power
            columns.append((self._plain(responses) - self._plain(self.base)) / one.scale)
        size = np.sqrt(sum(int(one.recording.good.sum()) for one in self.events))
        scatter = max(self.noise / np.sqrt(2), LEAST_SCATTER) / size
        return HiddenPart.of(columns, [one.scale for one in unknown], float(scatter))

    def parameters(self, kind: str) -> Iterator[VariableInfo]:
        for info in self.device.description.variables.values():
            if info.causality == "parameter" and info.type == kind and info.name not in NEVER:
                yield info

    def responses(self, values: Values) -> Responses | None:
        """The device's answers with other values; None where it does not run with them."""
        device = self.device.with_values(values)
        found: Responses | None = None
        tried = ", ".join(f"{name} = {_plainly(value)}" for name, value in values.items())
        with device.trials.trial(tried):
            found = [device.play(one.recording, one.start).power for one in self.events]
        return found

    def errors(self, responses: Responses) -> Numbers:
        """All errors of P and Q, of which the squares add up; those before the event count a start that is off.

        Without the part that the voltage between samples makes, as far as that is likely."""
        plain = self._plain(responses)
        return plain if self.hidden is None else self.hidden.taken_out_of(plain)

    def _plain(self, responses: Responses) -> Numbers:
        parts = []
        for event, power in zip(self.events, responses, strict=True):
            recording = event.recording
            error = (power - recording.power)[recording.good]
            size = np.sqrt(len(error) * len(self.events))
            parts += [error.real / size, error.imag / size]
        return np.concatenate(parts)

    def explanation(
        self,
        cause: CauseKind,
        name: str,
        now: float | bool | None,
        value: float | bool,
        left: Numbers,
        *,
        unit: str = "",
    ) -> Explanation:
        rms = [float(np.sqrt(one @ one)) for one in (self.error, left)]
        return Explanation(
            cause, name, unit, now, value, error=rms[0], left=rms[1], noise=self.noise
        )


def _positions(bench: _Bench, rough: _Bench) -> Iterator[Explanation]:
    """Other positions of switches and of kinds, whole numbers within bounds, that do not fail at a first look."""
    best: Explanation | None = None
    for info, value in _other_positions(bench):
        bench.report(f"trying {info.name} = {str(value).lower()}")
        looked = rough.responses({info.name: value})
        if looked is None or _squares(rough.errors(looked)) > _WORSE * _squares(rough.error):
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


def _other_positions(bench: _Bench) -> Iterator[tuple[VariableInfo, float | bool]]:
    for info in bench.parameters("Boolean"):
        yield info, not bench.device.value(info.name)
    for info in bench.parameters("Integer"):
        low, high = info.minimum, info.maximum
        if low is None or high is None or high - low >= _MOST_WORDS:
            continue
        for value in range(int(low), int(high) + 1):
            if value != bench.device.value(info.name):
                yield info, value


def _tuned(bench: _Bench, switch: Explanation) -> Iterator[Explanation]:
    """A switch in its other position, with the one number beside it that explains the most."""
    part, dot, _ = switch.name.rpartition(".")
    values = {switch.name: switch.value}
    other = _Bench(bench.device.with_values(values), bench.events, bench.report, bench.hidden)
    beside = [info for info in other.parameters("Real") if info.name.startswith(part + dot)]
    promises = list(_promises(other, beside)) if dot else []
    if promises:
        best = max(promises, key=lambda one: one.gain(other.error))
        value, left = _followed(other, best)
        tuned = bench.explanation(CauseKind.POSITION, switch.name, switch.now, switch.value, left)
        yield replace(tuned, beside={best.number.name: value})


@dataclass(frozen=True)
class _Promise:
    """A number, and what a small change of it does to the responses and to the errors, both by its unit."""

    number: Adjustable
    moves: Responses
    slope: Numbers

    def gain(self, error: Numbers) -> float:
        """The part that a straight line promises to take of the squared error [pu²]."""
        return float(self.slope @ error) ** 2 / float(self.slope @ self.slope)


def _numbers(bench: _Bench, rough: _Bench, promises: Sequence[_Promise]) -> Iterator[Explanation]:
    """The numbers that promise the most, each followed by itself to where it leaves the least."""
    ordered = sorted(promises, key=lambda one: -one.gain(rough.error))
    for one in ordered[:_FOLLOWED]:
        bench.report(f"following {one.number.name}")
        value, left = _followed(rough, one)
        number = one.number
        found = None if rough is bench else bench.responses({number.name: value})
        left = left if found is None else bench.errors(found)
        yield bench.explanation(
            CauseKind.VALUE, number.name, number.start, value, left, unit=number.unit
        )


def _promises(bench: _Bench, parameters: Iterable[VariableInfo]) -> Iterator[_Promise]:
    """The numbers among some parameters that move the response at all."""
    for info in parameters:
        one = adjustable(bench.device, info, None)
        if one.high <= one.low:
            continue
        step = _STEP * one.reach
        step = step if one.start + step <= one.high else -step
        bench.report(f"sensitivity to {one.name}")
        found = bench.responses({one.name: one.start + step})
        if found is None:
            continue
        slope = (bench.errors(found) - bench.error) / step
        if float(slope @ slope) * one.reach**2 > _SETTLED**2 * float(bench.error @ bench.error):
            pairs = zip(found, bench.base, strict=True)
            yield _Promise(one, [(moved - base) / step for moved, base in pairs], slope)
        else:
            bench.idle.append(info)


def _followed(bench: _Bench, promise: _Promise) -> tuple[float, Numbers]:
    """The best value of one number, by Gauss and Newton with secants for slopes."""
    number, slope = promise.number, promise.slope
    at, error = number.start, bench.error
    way = -float(slope @ error) / float(slope @ slope)
    for _ in range(_MOST_STEPS):
        value = min(max(at + way, number.low), number.high)
        found = bench.responses({number.name: value}) if value != at else None
        here = None if found is None else bench.errors(found)
        gained = -1.0 if here is None else float(error @ error - here @ here)
        if here is None or gained < 0:
            way *= 0.4
            continue
        slope = (here - error) / (value - at)
        done = gained < _SETTLED * float(error @ error)
        at, error = value, here
        size = float(slope @ slope)
        if done or size == 0:
            break
        way = -float(slope @ error) / size
    return at, error


def _delays(bench: _Bench, promises: Sequence[_Promise]) -> Iterator[Explanation]:
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


def _limits(bench: _Bench) -> Iterator[Explanation]:
    """A current that the plant does not exceed and the model does, and the parameters that would limit it so."""
    voltages = [np.abs(one.recording.voltage) for one in bench.events]
    measured = [one.recording.power for one in bench.events]
    limit = cap_of_current(bench.base, measured, voltages)
    if limit is None:
        return
    left = bench.errors(capped(bench.base, voltages, limit))
    yield bench.explanation(CauseKind.LIMIT, "limit of the current", None, limit, left, unit="pu")
    tried: list[tuple[float, VariableInfo, Values]] = []
    for info, values in itertools.islice(_limiters(bench, limit), _MOST_LIMITS):
        said = " with ".join(f"{name} = {value:.4g}" for name, value in values.items())
        bench.report(f"trying {said}")
        found = bench.responses(values)
        if found is not None:
            error = bench.errors(found)
            tried.append((float(error @ error), info, values))
    for count in (1, 2):  # a number by itself, which is the simpler cause, and one with a kind
        likely = [one for one in tried if len(one[2]) == count]
        if likely:
            _, info, values = min(likely, key=lambda one: one[0])
            yield from _limiter(bench, info, values)


def _levels(bench: _Bench, rough: _Bench) -> Iterator[Explanation]:
    """Numbers that may be limits of the current, at levels below the plant's largest: one of an axis acts below it.

    A model that is held in step far from the plant shows no level by itself, as `cap_of_current` looks for."""
    seen = max(_largest_current(one) for one in bench.events)
    tried: list[tuple[float, VariableInfo, Values]] = []
    for info in bench.parameters("Real"):
        value = bench.device.value(info.name)
        if info.unit != "pu" or not _LIMITS_ARE[0] * seen <= value <= _LIMITS_ARE[1] * seen:
            continue
        for part in _LEVELS:
            level = part * seen
            bench.report(f"trying {info.name} = {level:.4g}")
            found = rough.responses({info.name: level})
            if found is not None:
                tried.append((_squares(rough.errors(found)), info, {info.name: level}))
    if tried:
        _, info, values = min(tried, key=lambda one: one[0])
        yield from _limiter(bench, info, values)


def _largest_current(event: RecordedEvent) -> float:
    """Largest of the measured currents [pu of the rating]."""
    good = event.recording.good
    return float(np.abs(event.recording.power[good] / event.recording.voltage[good]).max())


def _limiters(bench: _Bench, limit: float) -> Iterator[tuple[VariableInfo, Values]]:
    """Numbers that may be limits and are too high, with a kind of the same part that would use them.

    Those that act on nothing come first: a limit that cuts a short peak moves the response a little, and more would."""
    idle = {info.name for info in bench.idle}
    above = [
        info
        for info in bench.parameters("Real")
        if info.unit == "pu" and bench.device.value(info.name) > limit
    ]
    for info in sorted(above, key=lambda one: one.name not in idle):
        yield info, {info.name: limit}
        part = info.name.rpartition(".")[0]
        for kind, value in _other_positions(bench):
            if kind.type == "Integer" and kind.name.rpartition(".")[0] == part:
                yield info, {kind.name: value, info.name: limit}


def _limiter(bench: _Bench, info: VariableInfo, values: Values) -> Iterator[Explanation]:
    """A parameter that limits the current, followed to its best value, with the kind that uses it."""
    device = bench.device.with_values(values)
    other = _Bench(device, bench.events, bench.report, bench.hidden)
    value, left = float(values[info.name]), other.error
    for promise in _promises(other, [info]):
        value, left = _followed(other, promise)
    kinds = [name for name in values if name != info.name]
    if kinds:
        name = kinds[0]
        now = bench.device.value(name)
        found = bench.explanation(CauseKind.POSITION, name, now, values[name], left)
        yield replace(found, beside={info.name: value})
    else:
        now = bench.device.value(info.name)
        yield bench.explanation(CauseKind.VALUE, info.name, now, value, left, unit=info.unit or "")


def _plainly(value: float | bool) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:.6g}"


def _squares(error: Numbers) -> float:
    return float(error @ error)
